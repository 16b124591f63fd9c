#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "core/base/units.hpp"
#include "core/io/result_folder.hpp"
#include "core/io/sha256.hpp"
#include "core/model/loops.hpp"
#include "core/model/validate.hpp"
#include "core/sim/diagonalised_form.hpp"
#include "core/sim/fastest_motion.hpp"
#include "core/sim/run_header.hpp"
#include "core/sim/vehicle_extended.hpp"
#include "scripts/bindings/open.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/interrupt.hpp"
#include "scripts/commands/simplifications.hpp"
#include "scripts/commands/streams.hpp"
#include "scripts/mission/examine.hpp"
#include "scripts/precision/tables.hpp"
#include "scripts/report/page.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

constexpr const char* kNumbers = "precision.h5";
constexpr const char* kData = "precision.json";
constexpr const char* kPage = "precision.html";
constexpr const char* kSettings = "settings.txt";

constexpr const char* kExtended = "extended";  // of --reference: as long as --limit allows
constexpr const char* kPointing = "pointing";  // which is an attitude

constexpr double kReferenceTolerance = 1e-13;
constexpr const char* kFirstReferences[] = {"dop853", "cvode_adams"};  // of high order, of two families
constexpr double kExtendedLimit = 20.0;  // [s] that a run in extended precision is tried, unless it is asked for
constexpr int kDenseByDefault = 40;      // velocities: the twin's work grows with their third power
constexpr const char* kUsualColumns[] = {"attitude", "position", "angle", "modes", "momentum", "energy", "constraint"};

struct PrecisionArguments {
  ScenarioArguments scenario;
  std::string out, tolerances = "1e-4:1e-12", steps, measure = "largest";
  std::optional<double> until, wanted;
  std::vector<std::string> methods, formulations, reference, kinds, budgets;
  double reference_tolerance = kReferenceTolerance, limit = 600.0;
  int jobs = 1, repeats = 0;
  bool whole_model = false, keep_runs = false, quiet = false;
};

[[noreturn]] void wrong_option(const char* option, std::string expected, std::string got, std::string hint = {}) {
  refuse(Code::command_line, {option}, std::move(expected), std::move(got), std::move(hint));
}

std::size_t kind_named(const char* option, const std::string& name) {
  if (name == kPointing) return index_of_kind("attitude");
  std::vector<std::string> legal;
  for (const PrecisionKind& k : precision_kinds()) legal.emplace_back(k.name);
  const std::size_t k = index_of_kind(name);
  if (k == legal.size())
    wrong_option(option, fmt::format("a kind of error: {}", fmt::join(legal, ", ")), in_quotes(name), did_you_mean(name, legal));
  return k;
}

/// "attitude=1e-6 rad"
ErrorBudget budget_of(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == 0 || equals == std::string::npos) wrong_option("--budget", "KIND=ERROR: attitude=\"1e-6 rad\"", in_quotes(text));
  const std::size_t kind = kind_named("--budget", text.substr(0, equals));
  const auto value = parse_quantity(text.substr(equals + 1), precision_kinds()[kind].unit);
  if (const auto* fault = std::get_if<QuantityFault>(&value)) refuse(fault->code, {"--budget"}, fault->expected, fault->got, fault->hint);
  const double most = std::get<double>(value);
  if (!(most > 0.0)) wrong_option("--budget", "an error > 0", in_quotes(text));
  return {kind, most};
}

ErrorMeasure measure_of(const std::string& name) {
  std::vector<std::string> legal;
  for (const ErrorMeasure m : {ErrorMeasure::final, ErrorMeasure::l2, ErrorMeasure::largest}) {
    if (name == name_of(m)) return m;
    legal.emplace_back(name_of(m));
  }
  wrong_option("--measure", fmt::format("a measure: {}", fmt::join(legal, ", ")), in_quotes(name), did_you_mean(name, legal));
}

/// In extended precision: at a tolerance beyond doubles, and at one that is looser.
std::vector<PrecisionSetting> extended_references() {
  std::vector<PrecisionSetting> out;
  for (const MethodKind& kind : integration_methods())
    if (kind.extended)
      for (const double relative : {1e-21, 1e-18}) {
        PrecisionSetting& s = out.emplace_back();
        s.method = kind.name, s.relative = s.absolute = relative;
      }
  return out;
}

/// What of a scene has no extended precision; empty: it has.
std::string not_extended(const Scenario& s) {
  if (std::string of_model = VehicleExtended::refusal(*s.model); !of_model.empty()) return of_model;
  for (const HingeLoad& load : s.model->loads)
    if (load.law == HingeLaw::stop) return "stops of hinges, whose contact is found in double";
  return {};
}

/// Methods that a reference is made by, the best first: those that are named, or all that choose their steps.
std::vector<PrecisionSetting> references(const PrecisionArguments& a, double tightest) {
  std::vector<PrecisionSetting> out;
  const auto automatic = [](const PrecisionSetting& s) {
    return std::ranges::any_of(integration_methods(), [&](const MethodKind& kind) { return kind.automatic && kind.name == s.method; });
  };
  for (const PrecisionSetting& s : precision_methods({}))
    if (s.adaptive && !automatic(s) && std::ranges::none_of(out, [&](const PrecisionSetting& one) { return one.method == s.method; }))
      out.push_back(s);
  const auto first = [](const PrecisionSetting& s) { return std::ranges::find(kFirstReferences, s.method) - std::begin(kFirstReferences); };
  std::ranges::stable_sort(out, [&](const PrecisionSetting& x, const PrecisionSetting& y) { return first(x) < first(y); });
  if (!a.reference.empty() && a.reference != std::vector<std::string>{kExtended}) {
    std::vector<PrecisionSetting> named;
    for (const std::string& name : a.reference) {
      std::vector<std::string> legal;
      for (const PrecisionSetting& s : out) legal.push_back(s.method);
      const auto found = std::ranges::find(out, name, &PrecisionSetting::method);
      if (found == out.end())
        wrong_option("--reference", fmt::format("a method that chooses its steps: {}", fmt::join(legal, ", ")), in_quotes(name),
                     did_you_mean(name, legal));
      named.push_back(*found);
    }
    if (named.size() != 2 || named[0] == named[1])
      wrong_option("--reference", "two methods, dop853,cvode_adams, or extended", fmt::format("{}", fmt::join(a.reference, ",")));
    out = std::move(named);
  }
  for (PrecisionSetting& s : out) s.relative = std::min(a.reference_tolerance, tightest);
  return out;
}

constexpr const char* kSquareRoot = "square_root";

/// What puts all hinges that have a square-root form into it; nothing: none is there that is not in it, or the loops are closed without.
Sets in_square_root_form(const Model& m) {
  Sets out;
  if (!m.spec->loops.empty() && m.spec->loop_form != LoopForm::automatic && m.spec->loop_form != LoopForm::multipliers) return out;
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const HingeSpec& hinge = m.spec->bodies[i].hinge;
    if (hinge.factor == HingeFactor::cholesky && !hinge.locked && takes_square_root(*m.user[i].hinge))
      out.emplace_back(body_path(m.spec->bodies[i]) + ".hinge.factor", hinge_factors()[static_cast<std::size_t>(HingeFactor::square_root)]);
  }
  return out;
}

/// Of a scene, its own first.
std::vector<Formulation> formulations_of(const Scenario& s) {
  const std::string& own = name_of(s.mission.simulation.dynamics);
  std::vector<Formulation> out = {{own, {}}};
  const bool diagonal = DiagonalisedForm::refusal(*s.model).empty();
  for (const Dynamics d : {Dynamics::standard, Dynamics::diagonalised, Dynamics::diagonalised_rates, Dynamics::dense})
    if (name_of(d) != own && (diagonal || !is_diagonalised(d))) out.push_back({name_of(d), {{"mission.dynamics", name_of(d)}}});
  if (Sets sets = in_square_root_form(*s.model); !sets.empty()) {
    if (own != Formulation::kStandard) sets.emplace_back("mission.dynamics", Formulation::kStandard);
    out.push_back({kSquareRoot, std::move(sets)});
  }
  if (s.model->loops.empty()) return out;
  LoopForm as_it_stands = s.model->spec->loop_form;
  if (as_it_stands == LoopForm::automatic) as_it_stands = s.model->loops.embedding ? LoopForm::embedding : LoopForm::multipliers;
  for (const LoopForm form : {LoopForm::multipliers, LoopForm::embedding, LoopForm::dae}) {
    const std::string& name = loop_forms()[static_cast<std::size_t>(form)];
    if (form == as_it_stands) continue;
    out.push_back({name, {{"vehicle.loop_form", name}}});
    if (own != Formulation::kStandard) out.back().sets.emplace_back("mission.dynamics", Formulation::kStandard);
  }
  return out;
}

/// What is run: methods with their ladders, in the scene's own formulation or in those that are named. Of none named the others stand
/// beside with what the scenario says itself.
std::vector<PrecisionSetting> grid_of(const std::vector<PrecisionSetting>& ladders, const std::vector<Formulation>& there,
                                      const std::vector<std::string>& named, const PrecisionSetting& own, int nv) {
  std::vector<PrecisionSetting> out;
  for (const Formulation& f : named.empty() ? std::vector<Formulation>{there.front()} : formulations_named(named, there))
    for (const PrecisionSetting& s : ladders) out.push_back(s), out.back().formulation = f;
  if (!named.empty()) return out;
  for (const Formulation& f : std::span(there).subspan(1)) {
    if (f.name == name_of(Dynamics::dense) && nv > kDenseByDefault) continue;
    const bool diagonal = f.name == name_of(Dynamics::diagonalised) || f.name == name_of(Dynamics::diagonalised_rates);
    if (diagonal && !DiagonalisedForm::refusal({.method = own.method, .linear_solver = own.linear_solver}).empty()) continue;
    out.push_back(own), out.back().formulation = f;
  }
  return out;
}

/// Of all that the numbers depend on beside settings and options: this program, its sweeps, the files that the scenario reads.
std::string identity_of(const Scenario& s, const std::string& program) {
  Sha256 hash;
  const auto add = [&](const std::string& text) { hash.add(text.data(), text.size()), hash.add("\n", 1); };
  add(sha256_of_file(program));
  add(sweeps_name());
  for (const auto* files : {&s.inputs, &s.plugins, &s.modal_files})
    for (const InputFile& f : *files) add(f.name), add(f.sha256);
  return hash.digest();
}

std::string how_it_went(const PrecisionRow& row) {
  return !row.failure.empty() ? "failed: " + row.failure.substr(0, row.failure.find('\n'))
                              : fmt::format("{:.3g} s{}", row.cpu_s, row.taken ? ", of before" : "");
}

std::string progress_line(std::size_t done, std::size_t all, const PrecisionRow& row, bool reference) {
  const std::string what = fmt::format("{} {}", row.setting.name(), row.setting.rung());
  const std::string how = how_it_went(row);
  return reference ? fmt::format("reference  {:<24} {}\n", what, how) : fmt::format("{:>4} of {:<4} {:<24} {}\n", done, all, what, how);
}

std::string model_line(const std::string& without, const PrecisionRow& row) {
  return fmt::format("without    {}, {} {}: {}\n", without, row.setting.name(), row.setting.rung(), how_it_went(row));
}

/// Where the two runs of the reference differ by too much.
std::vector<Diagnostic> doubts_of(const PrecisionStudy& study) {
  std::vector<Diagnostic> out;
  const auto bad = study.not_converged();
  if (bad.empty()) return out;
  std::vector<std::string> how;
  for (const std::size_t k : bad) {
    const KindError& d = *study.reference.difference[k];
    const std::string unit = precision_kinds()[k].unit;
    how.push_back(fmt::format("{} {:.2g}{}", precision_kinds()[k].name, d.largest, unit == "1" ? "" : " " + unit));
  }
  const auto name = [](const PrecisionRow& r) { return r.setting.name() + " " + r.setting.rung(); };
  out.push_back({Code::reference_doubt,
                 {"reference"},
                 fmt::format("two runs that agree to {:g} of what they measure", kConverged),
                 fmt::format("{} and {} differ: {}", name(study.reference.runs[0]), name(study.reference.runs[1]), fmt::join(how, ", ")),
                 "the table tells nothing below these errors; --until a shorter time, or --reference two other methods"});
  return out;
}

int interrupted(const PrecisionStudy& study) {
  say(fmt::format("\nInterrupted. The {} runs that ended are kept: the same command goes on. No table is written; one of before stays.\n",
                  study.kept));
  return 128 + Interruption::signal();
}

int precision(const PrecisionArguments& a, bool as_json) {
  PrecisionQuestion question;
  question.measure = measure_of(a.measure);
  question.wanted = a.wanted;
  if (a.wanted && !(*a.wanted > 0.0 && std::isfinite(*a.wanted))) wrong_option("--wanted", "an error > 0", fmt::format("{:g}", *a.wanted));
  for (const std::string& text : a.budgets) question.budgets.push_back(budget_of(text));
  if (a.whole_model && a.budgets.empty()) wrong_option("--whole-model", "--budget beside it", "none");
  std::vector<std::size_t> columns;
  for (const std::string& name : a.kinds) columns.push_back(kind_named("--kinds", name));
  std::vector<PrecisionSetting> methods = precision_methods(a.methods);
  const std::vector<double> tolerances = tolerance_ladder(a.tolerances);
  std::vector<double> steps = a.steps.empty() ? std::vector<double>{} : step_ladder(a.steps);
  if (!(a.reference_tolerance >= 1e-14 && a.reference_tolerance <= 1e-6))
    wrong_option("--reference-tolerance", "a number from 1e-14 to 1e-6", fmt::format("{:g}", a.reference_tolerance));
  if (!(a.limit > 0.0 && std::isfinite(a.limit))) wrong_option("--limit", "a time > 0 s", fmt::format("{:g}", a.limit));
  if (a.until && !(*a.until > 0.0 && std::isfinite(*a.until)))
    wrong_option("--until", "a finite time > 0 s", fmt::format("{:g}", *a.until));

  ScenarioOptions options = a.scenario.options();
  options.print = [](std::string_view) {};  // it is said in each run
  options.until = a.until;
  PrecisionOrder order;
  PrecisionStudy study;
  std::vector<Formulation> formulations;
  std::string without_extended;
  int nv = 0;
  {
    const auto s = open_scenario(options);
    try_start(*s);
    order.program = fs::read_symlink("/proc/self/exe").string();
    order.scenario = s->file;
    for (const Setting& set : options.settings) order.settings.emplace_back(set.key, set.value);
    order.seed = a.scenario.seed;
    if (a.until) order.until = fmt::format("{}", *a.until);
    order.identity = identity_of(*s, order.program);
    const SimulationOptions& simulation = s->mission.simulation;
    std::vector<std::pair<std::string, double>> by_kind = {{"angle", simulation.tolerances.angle},
                                                           {"position", simulation.tolerances.position},
                                                           {"rate", simulation.tolerances.rate},
                                                           {"velocity", simulation.tolerances.velocity},
                                                           {"modes", simulation.tolerances.modes}};
    std::erase_if(by_kind, [](const auto& kind) { return kind.second == 0.0; });
    order.own = own_setting(simulation.integrator, simulation.absolute_tolerance, std::move(by_kind));
    formulations = formulations_of(*s);
    order.own.formulation = formulations.front();
    nv = s->model->nv;
    without_extended = not_extended(*s);
    if (a.methods.empty() && !s->model->loops.absolute) std::erase_if(methods, [](const PrecisionSetting& m) { return m.method == "ida"; });
    const bool needs_steps = std::ranges::any_of(methods, [](const PrecisionSetting& m) { return !m.adaptive; });
    if (steps.empty() && needs_steps) {
      const Rational& p = s->mission.output_period;
      steps = usual_steps(fastest_motion(s->model, s->sim->state().q.data()).rate, p.value(), s->end());
    }
    study.title = s->mission.title.empty() ? s->file.filename().string() : s->mission.title;
    study.scenario = s->file.string();
  }
  order.grid = grid_of(precision_grid(methods, tolerances, steps, order.own), formulations, a.formulations, order.own, nv);
  order.reference = references(a, tolerances.back());
  const bool insists = a.reference == std::vector<std::string>{kExtended};
  if (insists && !without_extended.empty())
    refuse(Code::unsupported, {"--reference"}, "a scene that has 113 bits throughout", without_extended, "--reference dop853,cvode_adams");
  order.not_extended = a.reference.empty() || insists ? without_extended : "";
  if ((a.reference.empty() || insists) && without_extended.empty()) order.extended = extended_references();
  order.extended_cpu_s = insists ? a.limit : std::min(a.limit, kExtendedLimit);
  const auto standard = std::ranges::find(formulations, Formulation::kStandard, &Formulation::name);
  for (PrecisionSetting& s : order.extended) s = with_tolerance(s, s.relative, order.own);
  for (auto* all : {&order.reference, &order.extended})
    for (PrecisionSetting& s : *all) s.formulation = *standard;
  order.loosest_reference = std::max(1e-10, a.reference_tolerance);
  order.jobs = a.jobs, order.repeats = a.repeats, order.cpu_s = a.limit, order.keep_runs = a.keep_runs;
  order.out = !a.out.empty() ? fs::path(a.out)
                             : fs::path("out") / "precision" / fs::absolute(order.scenario).lexically_normal().parent_path().filename();
  const ResultFolder folder(order.out, {kNumbers, kData, kPage, kSettings});
  order.out = folder.path();

  const Interruption interruption;
  order.stop = [] { return Interruption::flag().load(); };
  order.told = [&](std::size_t done, std::size_t all, const PrecisionRow& row, bool reference) {
    if (!a.quiet) complain(progress_line(done, all, row, reference));
  };
  order.told_model = [&](const std::string& without, const PrecisionRow& row) {
    if (!a.quiet) complain(model_line(without, row));
  };
  {
    PrecisionStudy done = run_study(order);
    done.title = std::move(study.title), done.scenario = std::move(study.scenario);
    study = std::move(done);
  }
  if (Interruption::flag()) return interrupted(study);
  if (study.reference.runs.size() < 2) {
    RunFailure none;
    none.code = Code::no_reference;
    none.t = std::nan("");
    for (const std::string& attempt : study.reference.attempts) none.what += (none.what.empty() ? "" : "\n  ") + attempt;
    none.hint = "a larger --limit, --until a shorter time, or --reference two methods that can do what the scene needs";
    throw NumericsError(std::move(none));
  }
  for (const auto& [name, value] : {std::pair{"seed", order.seed}, {"until [s]", order.until}})
    if (!value.empty()) study.about.push_back(fmt::format("{} {}", name, value));
  for (const auto& [key, value] : order.settings) study.about.push_back(fmt::format("--set {}={}", key, value));
  study.about.push_back("sweeps " + sweeps_name());

  const auto there = study.kinds();
  if (columns.empty())
    for (const char* name : kUsualColumns)
      if (const std::size_t k = index_of_kind(name); std::ranges::find(there, k) != there.end()) columns.push_back(k);
  say(fmt::format("{}\n{}", study.title, precision_table(study, columns, question.measure)));
  say(precision_answers(study, question));
  for (const Diagnostic& doubt : doubts_of(study)) complain(render(doubt) + "\n");

  int code = 0;
  const std::vector<double> floors = floors_of(study, question.measure);
  const PrecisionChoice choice = cheapest_within(study.rows, question.budgets, floors, question.measure, RunCost::cpu);
  std::optional<SimplifiedModel> model;
  if (!question.budgets.empty() && choice.row && !a.whole_model) {
    std::vector<Simplification> all;
    {
      const auto s = open_scenario(options);
      all = simplifications_of(*s, options);
    }
    model = simplify(order, study, std::move(all), question.budgets, question.measure, *choice.row,
                     [&](const Sets& sets) { return counted_operations(options, sets); });
    if (Interruption::flag()) return interrupted(study);
    say(simplified_text(*model, study, question));
  }
  const SimplifiedModel* simplified = model ? &*model : nullptr;
  const Json data = precision_json(study, question, simplified);
  std::vector<Diagnostic> unwritten;
  write_result(folder / kData, json_text_with_nulls(data), unwritten);
  try {
    write_precision_h5((folder / kNumbers).string(), study, simplified);
  } catch (const InputError& e) {
    unwritten.push_back(e.diagnostics().front());
  } catch (const NumericsError& e) {  // of HDF5
    unwritten.push_back({.code = Code::cannot_write, .at = {{}, {(folder / kNumbers).string()}}, .got = e.failure().what});
  }
  write_result(folder / kPage, page::filled("Precision: " + study.title, data, page::precision()), unwritten);
  std::string files = (folder / kPage).string();
  if (!question.budgets.empty()) {
    if (const auto row = choice.row ? choice.row : choice.nearest) {
      std::vector<std::string> about = {"cardan run SCENARIO --settings " + std::string(kSettings),
                                        choice_text(study.rows, study, choice, question.budgets, question.measure)};
      PrecisionSetting setting = study.rows[*row].setting;
      if (model && model->chosen > 0) {
        const SimplifiedRun& run = model->runs[model->chosen];
        setting = run.row.setting;
        about.back() = choice_text({run.row}, study, {.row = 0, .nearest = 0}, question.budgets, question.measure);
        for (const std::size_t i : run.of) about.push_back("without: " + model->all[i].what);
      }
      write_result(folder / kSettings, settings_text(setting, study.own, about), unwritten);
      files += ", " + (folder / kSettings).string();
    }
    if (!choice.row) code = 1;
  }
  say(fmt::format("\n{} runs, {} of before. {}\n", study.runs, study.taken, files));
  return report_unwritten(std::move(unwritten), as_json, code);
}

}  // namespace

void add_precision(CommandLine& line) {
  Command& command = line.command("precision", "Run a scenario with many methods and tolerances: what does a digit cost?");
  auto a = std::make_shared<PrecisionArguments>();
  a->scenario.add_to(command, line);
  command
      .option("--methods", a->methods,
              "These integrators alone, of several linear solvers all or one: dopri5,cvode_bdf/krylov; default: all that compute in "
              "double")
      .split_at_commas()
      .type_name("METHODS");
  command
      .option("--formulations", a->formulations,
              "Each method in these forms of the equations: standard,dense, where loops are closed multipliers or embedding, or all; "
              "default: that of the scenario, the others once each")
      .split_at_commas()
      .type_name("FORMS");
  command.option("--tolerances", a->tolerances, "Relative tolerances: 1e-4:1e-12 (the default), 1e-4:1e-12:17 or 1e-4,1e-7")
      .type_name("LADDER");
  command
      .option("--steps", a->steps,
              "Steps in s of methods that take equal ones: 0.1:0.001 or 0.1,0.02; default: from where the method is stable, five times "
              "halved")
      .type_name("LADDER");
  command
      .option("--reference", a->reference,
              "Two methods in double, dop853,cvode_adams, or `extended`, in 113 bits for as long as --limit allows; default: extended "
              "where the scene has it and it takes less than 20 s, else the first two methods that get there")
      .split_at_commas()
      .type_name("METHODS");
  command
      .option("--reference-tolerance", a->reference_tolerance, "Where the reference begins; default 1e-13, or the tightest of the ladder")
      .type_name("NUMBER");
  command.option("--kinds", a->kinds, "Columns of the table: attitude,modes,energy; the files have all of them")
      .split_at_commas()
      .type_name("KINDS");
  command.option("--measure", a->measure, "final, l2 (over the recorded instants), or largest (the default)").type_name("MEASURE");
  command.option("--wanted", a->wanted, "Tell the cheapest setting for this error, of each kind by itself").type_name("ERROR");
  command
      .option("--budget", a->budgets,
              "Tell the cheapest setting and model that keep this error, attitude=\"1e-6 rad\", and write them as settings.txt for "
              "`cardan run --settings`; may be repeated: all at once. Exit code 1 where none does")
      .type_name("KIND=ERROR");
  command.flag("--whole-model", a->whole_model, "With --budget: methods and tolerances alone, nothing of the vehicle is left out");
  command.option("--until", a->until, "End of the runs in s, instead of the mission's duration").type_name("SECONDS");
  command.option("-j,--jobs", a->jobs, "How many run side by side; default 1, so that times mean something")
      .type_name("N")
      .between(1, 1024);
  command.option("--repeat", a->repeats, "Run each so often and keep the least time; default: of short runs up to five")
      .type_name("N")
      .between(1, 1000);
  command.option("--limit", a->limit, "Processor time in s that one run may take; default 600").type_name("SECONDS");
  command.option("--out", a->out, "Folder of the results; default: out/precision/<folder of the scenario>").type_name("DIR");
  command.flag("--keep-runs", a->keep_runs, "Keep run.h5 of every run; else of those of the reference");
  command.flag("--quiet", a->quiet, "No progress");
  command.action([&line, a] { return precision(*a, line.json_errors()); });
}

}  // namespace cardan
