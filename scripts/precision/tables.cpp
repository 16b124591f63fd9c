#include "scripts/precision/tables.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/io/hdf5_file.hpp"
#include "core/io/result_folder.hpp"

namespace cardan {
namespace {

constexpr double kShortRun = 0.02;   // [s] what clocks of processor time tell well
constexpr std::size_t kColumn = 12;  // characters of an error in the table

constexpr ErrorMeasure kMeasures[] = {ErrorMeasure::final, ErrorMeasure::l2, ErrorMeasure::largest};

std::string unit_text(std::size_t kind) {
  const std::string unit = precision_kinds()[kind].unit;
  return unit == "1" ? "-" : unit;
}
std::string with_unit(double x, std::size_t kind) {
  const std::string unit = precision_kinds()[kind].unit;
  return fmt::format("{:.2g}{}", x, unit == "1" ? "" : " " + unit);
}
std::string setting_text(const PrecisionSetting& s) { return s.name() + " " + s.rung(); }

struct Widths {
  std::size_t method = 10, formulation = 0;  // the latter 0: there is one alone
};
Widths widths_of(const PrecisionStudy& study) {
  Widths w;
  bool several = false;
  for (const PrecisionRow& row : study.rows) {
    w.method = std::max(w.method, row.setting.solver().size());
    w.formulation = std::max(w.formulation, row.setting.formulation.name.size());
    several = several || row.setting.formulation != study.rows.front().setting.formulation;
  }
  w.formulation = several ? std::max(w.formulation, std::size_t{11}) + 2 : 0;
  return w;
}
/// Characters before those of the errors.
std::size_t left_of_errors(const Widths& w) { return w.method + 8 + w.formulation + 2 + 9 + 2 + 9 + 2 + 9 + 2 + 8 + 2 + 8; }

Json finite(double x) { return std::isfinite(x) ? Json(x) : Json(); }

Json measures_json(const KindError& e) {
  Json out = Json::object();
  for (const ErrorMeasure m : kMeasures) out[std::string(name_of(m))] = finite(value_of(e, m));
  return out;
}

Json row_json(const PrecisionRow& row, const PrecisionSetting& own) {
  Json sets = Json::array(), errors = Json::object();
  for (const auto& [key, value] : row.setting.sets(own)) sets.push_back(key + "=" + value);
  for (std::size_t k = 0; k < row.errors.size(); ++k)
    if (row.errors[k]) {
      Json one = measures_json(*row.errors[k]);
      one["channel"] = row.errors[k]->channel;
      errors[precision_kinds()[k].name] = std::move(one);
    }
  Json out = {{"name", row.setting.name()},
              {"rung", row.setting.rung()},
              {"method", row.setting.method},
              {"formulation", row.setting.formulation.name},
              {"adaptive", row.setting.adaptive},
              {"settings", std::move(sets)},
              {"own", row.own}};
  if (row.setting.adaptive)
    out["relative"] = row.setting.relative, out["absolute"] = row.setting.absolute;
  else
    out["step_s"] = row.setting.step;
  out["failure"] = row.failure.empty() ? Json() : Json(row.failure);
  if (row.failure.empty()) {
    out["cpu_s"] = row.cpu_s, out["process_s"] = row.process_s, out["repeats"] = row.repeats;
    out["steps"] = row.steps, out["rhs_calls"] = row.rhs_calls, out["rejected"] = row.rejected, out["restarts"] = row.restarts;
    out["jacobian_products"] = row.jacobian_products;
    out["checks_passed"] = row.checks_passed, out["ended_by"] = row.ended_by, out["end_s"] = row.end_s;
    out["errors"] = std::move(errors);
  }
  out["folder"] = row.folder;
  return out;
}

/// "reference: dop853 1e-13, in double precision (in 113 bits: ...); its error: what cvode_adams 1e-13 differs by".
std::string reference_text(const PrecisionStudy& study) {
  const PrecisionReference& r = study.reference;
  if (r.runs.size() < 2) return "no reference: " + fmt::format("{}", fmt::join(r.attempts, "; "));
  if (r.extended)
    return fmt::format("reference: {}, in 113 bits; its error: what {} differs by, or the last bit of a double",
                       setting_text(r.runs[0].setting), setting_text(r.runs[1].setting));
  return fmt::format("reference: {}, in double precision{}; its error: what {} differs by{}", setting_text(r.runs[0].setting),
                     r.why_double.empty() ? "" : fmt::format(" (113 bits are not to be had: {})", r.why_double),
                     setting_text(r.runs[1].setting), r.one_method ? " (the same method: no other got there)" : "");
}

}  // namespace

namespace {
/// A line of the table: setting, cost, errors of `kinds`.
std::string precision_line(const PrecisionRow& row, const PrecisionStudy& study, const std::vector<std::size_t>& kinds,
                           ErrorMeasure measure, const Widths& w) {
  std::string text = fmt::format("{:<{}}{:<{}}  {:>9}", row.setting.solver() + (row.own ? " (yours)" : ""), w.method + 8,
                                 w.formulation > 0 ? "  " + row.setting.formulation.name : "", w.formulation, row.setting.rung());
  if (!row.failure.empty()) {
    const auto end = row.failure.find('\n');
    return text + "  failed: " + row.failure.substr(0, end) + "\n";
  }
  text += fmt::format("  {:>9.3g}  {:>9}  {:>8}  {:>8}", row.cpu_s, row.rhs_calls, row.steps, row.rejected);
  for (const std::size_t k : kinds) {
    const auto e = error_of(row, k, measure);
    const double floor = study.floor(k, measure);
    const auto front = pareto_front(study.rows, k, measure, RunCost::cpu, std::isnan(floor) ? 0.0 : floor);
    const bool on_it = std::ranges::any_of(front, [&](std::size_t i) { return &study.rows[i] == &row; });
    std::string cell = "-";
    if (e) cell = *e < floor ? fmt::format("<{:.1e}", floor) : std::isfinite(*e) ? fmt::format("{:.1e}", *e) : "not there";
    text += fmt::format("  {:>{}}{}", cell, kColumn - 3, on_it ? '*' : ' ');
  }
  if (!row.checks_passed) text += " checks failed";
  while (text.back() == ' ') text.pop_back();
  return text + "\n";
}
}  // namespace

std::string precision_table(const PrecisionStudy& study, const std::vector<std::size_t>& kinds, ErrorMeasure measure) {
  const Widths w = widths_of(study);
  std::string text = reference_text(study) + "\n";
  if (study.reference.runs.size() == 2 && !study.reference.attempts.empty())
    text += fmt::format("  no reference: {}\n", fmt::join(study.reference.attempts, "\n  no reference: "));
  text += fmt::format("\n{:<{}}{:<{}}  {:>9}  {:>9}  {:>9}  {:>8}  {:>8}", "method", w.method + 8, w.formulation > 0 ? "  formulation" : "",
                      w.formulation, "tolerance", "cpu [s]", "f calls", "steps", "rejected");
  for (const std::size_t k : kinds) text += fmt::format("  {:>{}} ", precision_kinds()[k].name, kColumn - 3);
  while (text.back() == ' ') text.pop_back();
  text += fmt::format("\n{:<{}}", "  error: " + std::string(name_of(measure)), left_of_errors(w));
  for (const std::size_t k : kinds) text += fmt::format("  {:>{}} ", unit_text(k), kColumn - 3);
  while (text.back() == ' ') text.pop_back();
  text += "\n";
  const PrecisionRow* failed = nullptr;
  for (const PrecisionRow& row : study.rows) {
    if (row.folder.empty()) continue;
    if (failed && row.failure == failed->failure && row.setting.solver() == failed->setting.solver()) continue;  // of a whole ladder once
    text += precision_line(row, study, kinds, measure, w);
    failed = row.failure.empty() ? nullptr : &row;
  }
  if (study.reference.runs.size() == 2) {
    text += fmt::format("{:<{}}", "reference: off by", left_of_errors(w));
    for (const std::size_t k : kinds) {
      const double floor = study.floor(k, measure);
      text += fmt::format("  {:>{}} ", std::isnan(floor) || precision_kinds()[k].of_the_run_itself ? "-" : fmt::format("{:.1e}", floor),
                          kColumn - 3);
    }
    while (text.back() == ' ') text.pop_back();
    text += "\n";
  }
  text += "* nothing is cheaper (processor time) and as good";
  const bool below = std::ranges::any_of(kinds, [&](std::size_t k) {
    return std::ranges::any_of(
        study.rows, [&](const PrecisionRow& row) { return error_of(row, k, measure).value_or(HUGE_VAL) < study.floor(k, measure); });
  });
  text += below ? "   < below what the reference may be off by\n" : "\n";
  if (std::ranges::any_of(study.rows, [](const PrecisionRow& row) { return row.failure.empty() && row.cpu_s < kShortRun; }))
    text += fmt::format("times below {:g} s tell little: look at the calls, or run for longer\n", kShortRun);
  return text;
}

std::string choice_text(const std::vector<PrecisionRow>& rows, const PrecisionStudy& study, const PrecisionChoice& choice,
                        const std::vector<ErrorBudget>& budgets, ErrorMeasure measure) {
  const auto errors = [&](const PrecisionRow& row) {
    std::vector<std::string> all;
    for (const ErrorBudget& b : budgets)
      if (const auto e = error_of(row, b.kind, measure)) all.push_back(with_unit(std::max(*e, floors_of(study, measure)[b.kind]), b.kind));
    return fmt::format("{}", fmt::join(all, ", "));
  };
  if (choice.row) {
    const PrecisionRow& row = rows[*choice.row];
    return fmt::format("{}, {:.3g} s, error {}", setting_text(row.setting), row.cpu_s, errors(row));
  }
  std::string why;
  for (const ErrorBudget& b : budgets)
    if (const double floor = floors_of(study, measure)[b.kind]; floor > b.most)
      why += std::isinf(floor) ? fmt::format("; {} was not measured", precision_kinds()[b.kind].name)
                               : fmt::format("; the reference itself may be off by {}", with_unit(floor, b.kind));
  if (!choice.nearest) return "none of the settings ended" + why;
  const PrecisionRow& row = rows[*choice.nearest];
  return fmt::format("none of the settings; nearest {}, {:.3g} s, error {}{}", setting_text(row.setting), row.cpu_s, errors(row), why);
}

std::string precision_answers(const PrecisionStudy& study, const PrecisionQuestion& question) {
  std::string text;
  const std::vector<double> floors = floors_of(study, question.measure);
  const auto answer = [&](const std::vector<ErrorBudget>& budgets) {
    return choice_text(study.rows, study, cheapest_within(study.rows, budgets, floors, question.measure, RunCost::cpu), budgets,
                       question.measure);
  };
  if (question.wanted) {
    text += fmt::format("\ncheapest for an error of {:g} ({}, in the unit of each)\n", *question.wanted, name_of(question.measure));
    for (const std::size_t k : study.kinds())
      text += fmt::format("  {:<11} {}\n", precision_kinds()[k].name, answer({{k, *question.wanted}}));
  }
  if (!question.budgets.empty()) {
    std::vector<std::string> all;
    for (const ErrorBudget& b : question.budgets)
      all.push_back(fmt::format("{} {}", precision_kinds()[b.kind].name, with_unit(b.most, b.kind)));
    text += fmt::format("\ncheapest for {}\n  {}\n", fmt::join(all, ", "), answer(question.budgets));
  }
  return text;
}

namespace {
std::string words(const SimplifiedModel& model, const SimplifiedRun& run) {
  std::vector<std::string> all;
  for (const std::size_t i : run.of) all.push_back(model.all[i].what);
  return all.empty() ? "the whole model" : fmt::format("{}", fmt::join(all, ", "));
}

/// Of a kind that was measured; else empty.
std::optional<double> added_of(const SimplifiedRun& run, std::size_t kind, ErrorMeasure measure) {
  if (!run.row.failure.empty() || kind >= run.added.size() || !run.added[kind]) return std::nullopt;
  return value_of(*run.added[kind], measure);
}
}  // namespace

std::string simplified_text(const SimplifiedModel& model, const PrecisionStudy& study, const PrecisionQuestion& question) {
  const SimplifiedRun& whole = model.runs.front();
  std::size_t width = 20;
  for (const SimplifiedRun& run : model.runs) width = std::max(width, words(model, run).size());
  std::string text = fmt::format("\nwhat the model has no need of, with {}\n{:<{}}", setting_text(whole.row.setting), "", width + 2);
  for (const ErrorBudget& b : question.budgets)
    text += fmt::format("  {:>{}}", std::string(precision_kinds()[b.kind].name) + " +", kColumn);
  text += fmt::format("  {:>9}  {:>9}  {:>10}  {:>6}\n", "cpu [s]", "f calls", "operations", "saves");
  for (std::size_t i = 0; i < model.runs.size(); ++i) {
    const SimplifiedRun& run = model.runs[i];
    text += fmt::format("{:<{}}", words(model, run), width + 2);
    if (!run.row.failure.empty()) {
      text += "  failed: " + run.row.failure.substr(0, run.row.failure.find('\n')) + "\n";
      continue;
    }
    for (const ErrorBudget& b : question.budgets) {
      const auto e = added_of(run, b.kind, question.measure);
      text += fmt::format("  {:>{}}", i == 0 || !e ? "-" : with_unit(*e, b.kind), kColumn);
    }
    text += fmt::format("  {:>9.3g}  {:>9}  {:>10.3g}", run.row.cpu_s, run.row.rhs_calls, run.operations);
    text += i > 0 && run.added.empty() ? "       -  with " + setting_text(run.row.setting)
                                       : fmt::format("  {:>4.0f} %", 100.0 * (1.0 - run.operations / whole.operations));
    if (!run.row.checks_passed) text += "  checks failed";
    text += "\n";
  }
  for (const Simplification& s : model.all)
    if (!s.refusal.empty())
      text += fmt::format("{:<{}}  not to be had: {}\n", s.what, width + 2, s.refusal.substr(0, s.refusal.find('\n')));
  const SimplifiedRun& chosen = model.runs[model.chosen];
  std::vector<std::string> errors;
  for (const ErrorBudget& b : question.budgets)
    if (const auto e = error_of(chosen.row, b.kind, question.measure))
      errors.push_back(with_unit(std::max(*e, study.floor(b.kind, question.measure)), b.kind));
  text += model.chosen == 0 ? "nothing is left out: what keeps the budget saves nothing\n"
                            : fmt::format("without: {}\n  {}, {:.3g} s, error {}: run like that\n", words(model, chosen),
                                          setting_text(chosen.row.setting), chosen.row.cpu_s, fmt::join(errors, ", "));
  return text;
}

namespace {
Json simplified_json(const SimplifiedModel& model, const PrecisionSetting& own) {
  Json all = Json::array(), runs = Json::array();
  for (const Simplification& s : model.all) {
    Json sets = Json::array();
    for (const auto& [key, value] : s.sets) sets.push_back(key + "=" + value);
    all.push_back({{"what", s.what}, {"settings", std::move(sets)}, {"refusal", s.refusal.empty() ? Json() : Json(s.refusal)}});
  }
  for (const SimplifiedRun& run : model.runs) {
    Json one = row_json(run.row, own), added = Json::object();
    for (std::size_t k = 0; k < run.added.size(); ++k)
      if (run.added[k]) added[precision_kinds()[k].name] = measures_json(*run.added[k]);
    one["without"] = run.of, one["added"] = std::move(added), one["operations"] = run.operations;
    runs.push_back(std::move(one));
  }
  return {{"simplifications", std::move(all)}, {"runs", std::move(runs)}, {"chosen", model.chosen}};
}
}  // namespace

Json precision_json(const PrecisionStudy& study, const PrecisionQuestion& question, const SimplifiedModel* model) {
  Json kinds = Json::array(), rows = Json::array(), runs = Json::array(), fronts = Json::object();
  const auto bad = study.not_converged();
  for (const std::size_t k : study.kinds()) {
    const PrecisionKind& kind = precision_kinds()[k];
    Json one = {{"name", kind.name}, {"unit", kind.unit}, {"meaning", kind.meaning}, {"against_reference", !kind.of_the_run_itself}};
    const bool measured = k < study.reference.difference.size() && study.reference.difference[k].has_value();
    if (measured && !kind.of_the_run_itself) {
      one["size"] = study.reference.difference[k]->size;
      for (const ErrorMeasure m : kMeasures) one["reference_off_by"][std::string(name_of(m))] = finite(study.floor(k, m));
      one["converged"] = std::ranges::find(bad, k) == bad.end();
    }
    kinds.push_back(std::move(one));
    Json front = Json::object();
    for (const ErrorMeasure m : kMeasures) {
      const double floor = study.floor(k, m);
      front[std::string(name_of(m))] = pareto_front(study.rows, k, m, RunCost::cpu, std::isnan(floor) ? 0.0 : floor);
    }
    fronts[kind.name] = std::move(front);
  }
  for (const PrecisionRow& row : study.rows)
    if (!row.folder.empty()) rows.push_back(row_json(row, study.own));
  for (const PrecisionRow& row : study.reference.runs) runs.push_back(row_json(row, study.own));
  Json out = {{"format", 1},
              {"title", study.title},
              {"scenario", study.scenario},
              {"about", study.about},
              {"complete", study.complete},
              {"reference",
               {{"precision", study.reference.extended ? "113 bits" : "double"},
                {"why_double", study.reference.why_double.empty() ? Json() : Json(study.reference.why_double)},
                {"by_two_methods", study.reference.runs.size() == 2 && !study.reference.one_method && !study.reference.extended},
                {"runs", std::move(runs)},
                {"attempts", study.reference.attempts}}},
              {"kinds", std::move(kinds)},
              {"rows", std::move(rows)},
              {"fronts_by_cpu_s", std::move(fronts)},
              {"measure", std::string(name_of(question.measure))},
              {"wanted", question.wanted ? Json(*question.wanted) : Json()}};
  Json budgets = Json::array();
  for (const ErrorBudget& b : question.budgets) budgets.push_back({{"kind", precision_kinds()[b.kind].name}, {"most", b.most}});
  out["budgets"] = std::move(budgets);
  out["model"] = model ? simplified_json(*model, study.own) : Json();
  return out;
}

void write_precision_h5(const std::string& path, const PrecisionStudy& study, const SimplifiedModel* model) {
  Hdf5File file = Hdf5File::create(name_before(path).string());
  file.make_group("/study");
  file.set_attribute("/study", "title", study.title);
  file.set_attribute("/study", "scenario", study.scenario);
  file.set_attribute("/study", "about", study.about);
  file.set_attribute("/study", "format", std::int64_t{1});
  const auto nan = std::numeric_limits<double>::quiet_NaN();
  const auto kinds = study.kinds();
  const auto put_errors = [&](const std::string& group, const std::vector<const PrecisionRow*>& rows) {
    for (const std::size_t k : kinds)
      for (const ErrorMeasure m : kMeasures) {
        std::vector<double> e;
        for (const PrecisionRow* row : rows) e.push_back(error_of(*row, k, m).value_or(nan));
        const std::string data = fmt::format("{}/errors/{}/{}", group, precision_kinds()[k].name, name_of(m));
        file.write(data, std::span<const double>(e));
        file.set_attribute(data, "unit", precision_kinds()[k].unit);
      }
  };
  // A group for each curve, rung by rung; names have no slash.
  std::vector<std::string> names;
  for (const PrecisionRow& row : study.rows)
    if (!row.folder.empty() && std::ranges::find(names, row.setting.name()) == names.end()) names.push_back(row.setting.name());
  for (const std::string& name : names) {
    std::string group = "/curves/" + name;
    std::replace(group.begin() + 8, group.end(), '/', '-');
    std::vector<const PrecisionRow*> rows;
    for (const PrecisionRow& row : study.rows)
      if (!row.folder.empty() && row.setting.name() == name) rows.push_back(&row);
    std::vector<std::string> failures;
    std::vector<std::int64_t> own;
    for (const PrecisionRow* row : rows) failures.push_back(row->failure), own.push_back(row->own ? 1 : 0);
    const auto put = [&](const char* what, const char* unit, const auto& value, bool of_setting = false) {
      std::vector<double> x;
      for (const PrecisionRow* row : rows) x.push_back(row->failure.empty() || of_setting ? static_cast<double>(value(*row)) : nan);
      file.write(group + "/" + what, std::span<const double>(x));
      file.set_attribute(group + "/" + what, "unit", unit);
    };
    put(
        "relative", "1", [](const PrecisionRow& r) { return r.setting.relative; }, true);
    put(
        "absolute", "1", [](const PrecisionRow& r) { return r.setting.absolute; }, true);
    put(
        "step", "s", [](const PrecisionRow& r) { return r.setting.step; }, true);
    put("cpu_s", "s", [](const PrecisionRow& r) { return r.cpu_s; });
    put("process_s", "s", [](const PrecisionRow& r) { return r.process_s; });
    put("steps", "1", [](const PrecisionRow& r) { return r.steps; });
    put("rhs_calls", "1", [](const PrecisionRow& r) { return r.rhs_calls; });
    put("rejected", "1", [](const PrecisionRow& r) { return r.rejected; });
    put("restarts", "1", [](const PrecisionRow& r) { return r.restarts; });
    put("jacobian_products", "1", [](const PrecisionRow& r) { return r.jacobian_products; });
    file.write(group + "/own", std::span<const std::int64_t>(own));
    file.set_attribute(group, "method", rows.front()->setting.solver());
    file.set_attribute(group, "formulation", rows.front()->setting.formulation.name);
    file.write(group + "/failure", failures, {failures.size()});
    put_errors(group, rows);
  }
  file.make_group("/reference");
  std::vector<std::string> settings;
  for (const PrecisionRow& row : study.reference.runs) settings.push_back(setting_text(row.setting));
  file.set_attribute("/reference", "runs", settings);
  file.set_attribute("/reference", "precision", study.reference.extended ? "113 bits" : "double");
  file.set_attribute("/reference", "attempts", study.reference.attempts);
  for (const std::size_t k : kinds)
    if (!precision_kinds()[k].of_the_run_itself)
      for (const ErrorMeasure m : kMeasures) {
        const std::string data = fmt::format("/reference/off_by/{}/{}", precision_kinds()[k].name, name_of(m));
        file.write(data, study.floor(k, m));
        file.set_attribute(data, "unit", precision_kinds()[k].unit);
      }
  if (model) {
    std::vector<std::string> without, failures;
    std::vector<const PrecisionRow*> rows;
    std::vector<double> operations, calls, cpu;
    for (const SimplifiedRun& run : model->runs) {
      without.push_back(words(*model, run)), failures.push_back(run.row.failure), rows.push_back(&run.row);
      const bool ended = run.row.failure.empty();
      operations.push_back(ended ? run.operations : nan), cpu.push_back(ended ? run.row.cpu_s : nan);
      calls.push_back(ended ? static_cast<double>(run.row.rhs_calls) : nan);
    }
    file.make_group("/model");
    file.set_attribute("/model", "without", without);
    file.set_attribute("/model", "failure", failures);
    file.set_attribute("/model", "chosen", static_cast<std::int64_t>(model->chosen));
    for (const auto& [name, unit, x] : {std::tuple{"operations", "1", &operations}, {"rhs_calls", "1", &calls}, {"cpu_s", "s", &cpu}}) {
      file.write(fmt::format("/model/{}", name), std::span<const double>(*x));
      file.set_attribute(fmt::format("/model/{}", name), "unit", unit);
    }
    put_errors("/model", rows);
    for (const std::size_t k : kinds) {
      std::vector<double> added;
      for (const SimplifiedRun& run : model->runs) added.push_back(added_of(run, k, ErrorMeasure::largest).value_or(nan));
      const std::string data = fmt::format("/model/added/{}", precision_kinds()[k].name);
      file.write(data, std::span<const double>(added));
      file.set_attribute(data, "unit", precision_kinds()[k].unit);
    }
  }
  file.rename(path);
  file.close();
}

std::string settings_text(const PrecisionSetting& setting, const PrecisionSetting& own, const std::vector<std::string>& about) {
  std::string text;
  for (const std::string& line : about) text += "# " + line + "\n";
  for (const auto& [key, value] : setting.sets(own)) text += key + "=" + value + "\n";
  return text;
}

}  // namespace cardan
