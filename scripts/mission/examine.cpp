#include "scripts/mission/examine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/dynamics/fields.hpp"
#include "core/model/devices.hpp"
#include "core/model/doubts.hpp"
#include "core/model/loops.hpp"
#include "core/model/validate.hpp"
#include "core/operators/system_properties.hpp"
#include "core/sim/choose_method.hpp"
#include "core/sim/diagonalised_form.hpp"
#include "core/sim/flexible_limits.hpp"
#include "core/sim/outputs.hpp"
#include "core/sim/twin_dynamics.hpp"
#include "core/sim/vehicle_extended.hpp"
#include "core/sim/vehicle_implicit_form.hpp"
#include "core/sim/vehicle_linear_part.hpp"
#include "core/sim/vehicle_momentum_form.hpp"
#include "core/soa/field_at.hpp"
#include "core/spatial/eigen_bridge.hpp"

namespace cardan {
namespace {

// A tick takes a microsecond at best, and the integrator starts again after it: some 10 us. A day at least, and minutes.
constexpr double kTooManyTicks = 1e10, kManyTicks = 1e7;
constexpr double kLargeBytes = 2e9;
constexpr double kLeftOfPull = 1e-9;  // of the weight: some 0.1 m in each turn of a low orbit

std::string bytes_text(double bytes) {
  const char* units[] = {"B", "kB", "MB", "GB", "TB", "PB"};
  int i = 0;
  for (; bytes >= 1000.0 && i < 5; ++i) bytes /= 1000.0;
  return fmt::format("{:.3g} {}", bytes, units[i]);
}

/// The tolerances of `ida` beside the rounding of places, which in absolute coordinates are far from the origin of the world and hold
/// the hinges: finer ones its iteration never meets.
void expect_tolerances_above_rounding(const Scenario& s) {
  const SimulationOptions& o = s.mission.simulation;
  if (o.integrator.method != "ida") return;
  operators::TreeOperators tree(open_tree(s.model));
  tree.at(s.sim->state().q.data());
  const operators::Placements placed(tree);
  double far = 0.0;
  for (const operators::Placement& frame : placed.bodies) far = std::max(far, (placed.reference.p + placed.reference.R * frame.p).norm());
  const double absolute = o.absolute_tolerance > 0.0 ? o.absolute_tolerance : o.integrator.relative_tolerance;
  double least = absolute;
  for (const double x : {o.tolerances.position, o.tolerances.rate, o.tolerances.velocity})
    if (x > 0.0) least = std::min(least, x);
  const double rounding = std::numeric_limits<double>::epsilon() * far;
  if (least >= rounding) return;
  refuse(
      Code::out_of_range, {"mission.integrator.absolute", {s.file.string(), 0, 0}},
      fmt::format("absolute tolerances of {:.1e} at least: places {:.3g} m from the origin of the world are known to that", rounding, far),
      fmt::format("{:g}{}", least, o.absolute_tolerance == 0.0 && least == absolute ? ", as `relative`" : ""),
      fmt::format("absolute = {:.0e} beside `relative`, or a method whose coordinates are relative: dopri5, dop853", 10.0 * rounding));
}

/// `subject`: "controller \"law\"", "device wheel", whose ticks come every `period` seconds.
void look_at_period(Scenario& s, const Located& at, const std::string& subject, double period) {
  const double ticks = s.end() / period;
  const std::string got = fmt::format("a tick every {:.3g} s: {:.3g} of them in {:g} s", period, ticks, s.end());
  if (ticks > kTooManyTicks)
    refuse(Code::out_of_range, at, fmt::format("at most {:g} ticks in a run", kTooManyTicks), got, "did you mean another unit?");
  if (ticks > kManyTicks)
    s.warnings.add(Code::mission_doubt, at, fmt::format("{} has {}, and the integrator starts again after each", subject, got),
                   "ten times the fastest motion of interest is enough");
}

void look_at_ticks(Scenario& s) {
  for (const Controller& c : s.controllers) look_at_period(s, c.at, fmt::format("controller \"{}\"", c.name), c.period.value());
  for (const DeviceSpec& d : s.model->spec->devices) {
    const auto at = [&](const char* key) { return s.model->spec->locate(fmt::format("devices.{}.{}", d.name, key)); };
    if (d.rate > 0.0 || d.period > 0.0)
      look_at_period(s, at(d.rate > 0.0 ? "rate" : "period"), "device " + d.name, d.rate > 0.0 ? 1.0 / d.rate : d.period);
    if (d.offset > s.end())
      s.warnings.add(Code::no_effect, at("offset"),
                     fmt::format("the first tick of {}, at {:g} s, is after the end of the run at {:g} s", d.name, d.offset, s.end()));
  }
}

/// Fields that know nothing of the end of the run: their weather or bulletin ends before.
void look_at_dates(Scenario& s) {
  FieldMoments moments(*s.model);
  for (std::size_t i = 0; i < s.model->fields.size(); ++i) {
    const Field& field = s.model->fields[i];
    const int beyond = moments.at(static_cast<int>(i), s.end()).beyond;
    if (field.source->refuses(beyond))
      s.warnings.add(Code::mission_doubt, s.model->spec->locate("fields." + field.name),
                     fmt::format("at the end of the run, at {:g} s, {}: the run ends before, where something asks it there", s.end(),
                                 told_beyond(field, beyond)),
                     "a shorter duration, or a file of more days");
  }
}

/// Loops that are open at the start, and what the mission chose that takes no closed ones.
void look_at_open_loops(Scenario& s) {
  const Model& m = *s.model;
  if (!m.loops.empty() || m.spec->loops.empty()) return;
  const std::string& method = s.mission.simulation.integrator.method;
  const bool by_method = advances_linear_part(method) || method.starts_with("variational");
  if (!by_method && s.mission.simulation.dynamics != Dynamics::diagonalised) return;
  s.warnings.add(Code::mission_doubt, {by_method ? "mission.integrator.method" : "mission.dynamics", {s.file.string(), 0, 0}},
                 fmt::format("loop {} is open until the mission closes it, and {} takes no closed loops: the run ends there",
                             m.spec->loops.front().name, by_method ? method : name_of(Dynamics::diagonalised) + " dynamics"),
                 by_method ? "dopri5, dop853; auto finds one" : "dynamics = \"standard\"");
}

/// `method = "auto"`: from here on it is the one that was chosen. One that does not take the vehicle is refused.
void choose_method_of(Scenario& s) {
  IntegratorOptions& i = s.mission.simulation.integrator;
  const auto told = std::ranges::find(s.mission.defaults_used, "mission.integrator.method", [](const auto& d) { return d.first; });
  if (s.model->loops.absolute && told != s.mission.defaults_used.end() && i.fixed_step == 0.0) {  // no method was asked for
    i.method = "ida", told->second = "ida, that of loop_form: dae";
    s.sim->set_options(s.mission.simulation);
  }
  const std::string not_taken = advances_linear_part(i.method)        ? VehicleLinearPart::refusal(*s.model)
                                : i.method.starts_with("variational") ? VehicleMomentumForm::refusal(*s.model)
                                : i.method == "extended"              ? VehicleExtended::refusal(*s.model)
                                : i.method == "ida"                   ? VehicleImplicitForm::refusal(*s.model)
                                                                      : "";
  if (!not_taken.empty())
    refuse(Code::unsupported, {"mission.integrator.method", {s.file.string(), 0, 0}}, "a method that takes " + not_taken,
           i.method + ", which does not", i.method == "ida" ? VehicleImplicitForm::way_out(*s.model) : "dopri5, dop853; auto finds one");
  if (s.mission.simulation.dynamics == Dynamics::dense) expect_twin_takes(*s.model, i, {"mission.dynamics", {s.file.string(), 0, 0}});
  if (i.method != "auto") return;
  MethodChoice choice = choose_method(s.model, shortest_interval(s), i, s.mission.simulation.dynamics);
  i = std::move(choice.options);
  s.mission.why_method = std::move(choice.why);
  s.mission.defaults_used.emplace_back("mission.integrator.method", fmt::format("{}, chosen by auto: {}", i.method, s.mission.why_method));
  s.sim->set_options(s.mission.simulation);
}

/// A body that is pulled, with all that is fixed to it.
struct Pulled {
  const BodySpec* spec;
  bool several;
  bool anywhere;          // its hinge has a place
  Eigen::Vector3d place;  // [m] of its mass centre, world axes
  double gyration;        // [m] radius about that
};
std::vector<Pulled> pulled_bodies(const std::shared_ptr<const Model>& model, const double* q) {
  std::vector<Pulled> found;
  const Model& m = *model;
  operators::TreeOperators tree(open_tree(model));  // poses and masses are those of the closed one
  tree.at(q);
  const operators::Placements placed(tree);
  for (std::size_t i = 0; i < tree.bodies().size(); ++i) {
    const Eigen::Matrix<double, 6, 6> M = tree.M(static_cast<int>(i)).topLeftCorner<6, 6>();  // [J, m c~; -m c~, m]
    const double mass = M(3, 3);
    if (mass <= 0.0) continue;
    const int user = tree.bodies()[i].user, sweep = m.user[static_cast<std::size_t>(user)].sweep;
    const Eigen::Vector3d com = Eigen::Vector3d(M(2, 4), M(0, 5), M(1, 3)) / mass;
    const operators::Placement &frame = placed.bodies[i], &reference = placed.reference;
    found.push_back({&m.spec->bodies[static_cast<std::size_t>(user)],
                     std::ranges::any_of(m.user, [&](const UserBody& u) { return u.merged && u.sweep == sweep; }),
                     std::ranges::count(m.user[static_cast<std::size_t>(user)].v_units, "m/s") == 3,
                     reference.p + reference.R * (frame.p + frame.R * com),
                     std::sqrt(std::max(0.0, 0.5 * M.topLeftCorner<3, 3>().trace() / mass - com.squaredNorm()))});
  }
  return found;
}

/// The pull is to second order in size over distance (docs/mathematics/gravity.md, 2): all that mass and inertia tell of one body, and not
/// of several that are fixed to each other. The third difference of gravity over its size, along itself: (size / distance)^3 of the weight
/// about one centre. And a pull that nothing has: a start in other units.
void look_at_pull(Scenario& s) {
  constexpr double kMostPull = 1e4;  // [m/s^2] the Sun has 274 at its surface
  const GravityField& gravity = s.model->field;
  if (!gravity.pulls()) return;
  const FieldMoment* moment = s.sim->gravity_moment();
  for (const Pulled& b : pulled_bodies(s.model, s.sim->state().q.data())) {
    const auto at = [&](const Eigen::Vector3d& x) { return to_eigen(soa::field_at<double>(gravity, {x[0], x[1], x[2]}, moment)); };
    const Eigen::Vector3d weight = at(b.place);
    if (b.anywhere && weight.norm() > kMostPull)
      s.warnings.add(
          Code::unusual_value, s.model->spec->locate(body_path(*b.spec) + ".hinge"),
          fmt::format("{} begins at [{:.6g}, {:.6g}, {:.6g}] m, where gravity is {:.3g} m/s^2: no planet has more than 25, the Sun 274",
                      b.spec->name, b.place.x(), b.place.y(), b.place.z(), weight.norm()),
          "a place without a unit is in m: 6878.137 km");
    if (!b.several || !gravity.gradient) continue;
    const Eigen::Vector3d step = 0.5 * b.gyration * weight.normalized();
    const Eigen::Vector3d third = at(b.place + 3.0 * step) - at(b.place - 3.0 * step) - 3.0 * (at(b.place + step) - at(b.place - step));
    const double rest = third.norm() / (24.0 * weight.norm());
    if (!(rest >= kLeftOfPull)) continue;
    s.warnings.add(Code::beyond_the_model, s.model->spec->locate(body_path(*b.spec)),
                   fmt::format("{}, with what is locked to it, has a radius of gyration of {:.3g} m: its pull is to second order in that, "
                               "which leaves out some {:.1g} of the weight",
                               b.spec->name, b.gyration, rest),
                   "bodies on hinges that move, `prescribed` ones too, are pulled each where it is");
  }
}

void look_at_sizes(Scenario& s) {
  std::size_t columns = 1;  // time
  for (const Output& o : mission_outputs(s)) columns += o.channel.components.size();
  const double rows = s.end() / s.mission.output_period.value(), bytes = rows * static_cast<double>(columns * sizeof(double));
  if (rows > kTooManyTicks)
    refuse(Code::out_of_range, {"mission.output", {s.file.string(), 0, 0}}, fmt::format("at most {:g} rows in a run", kTooManyTicks),
           fmt::format("a row every {:.3g} s: {:.3g} of them in {:g} s", s.mission.output_period.value(), rows, s.end()),
           "a lower mission.output.rate, or a shorter run; did you mean another unit?");
  if (bytes > kLargeBytes)
    s.warnings.add(Code::large_run, {"mission.output", {s.file.string(), 0, 0}},
                   fmt::format("{:.3g} rows of {} numbers: run.h5 will take about {}", rows, columns, bytes_text(bytes)),
                   "a lower mission.output.rate, or fewer nodes and reactions");
  const IntegratorOptions& i = s.mission.simulation.integrator;
  const double n = s.model->nq + s.model->nv, dense = 3.0 * n * n * sizeof(double);  // Jacobian, its saved copy, Newton matrix
  if (is_implicit(i.method) && i.method != "ida" && i.linear_solver != "krylov" && dense > kLargeBytes)
    s.warnings.add(Code::large_run, {"mission.integrator.linear_solver", {s.file.string(), 0, 0}},
                   fmt::format("{:g} states: the dense matrices of {} take about {}", n, i.method, bytes_text(dense)),
                   "linear_solver = \"krylov\" needs none");
}

}  // namespace

std::vector<Output> mission_outputs(Scenario& s) {
  std::vector<Output> all = standard_outputs(*s.sim, {s.mission.reactions, s.mission.nodes});
  for (const auto& signal : s.signals)
    all.push_back({signal->channel, [&values = signal->values](double* x) { std::copy(values.begin(), values.end(), x); }});
  return all;
}

void expect_away_from_centre(const std::shared_ptr<const Model>& model, const double* q) {
  if (model->gravity.kind != GravitySpec::Kind::central) return;
  for (const Pulled& b : pulled_bodies(model, q)) {
    const double distance = (b.place - model->gravity.centre).norm();
    if (distance > b.gyration) continue;
    refuse(Code::bad_initial_state, model->spec->locate(body_path(*b.spec) + ".hinge.initial"),
           "mass centres away from the centre of the field",
           fmt::format("body {} is at the centre of gravity.central: its mass centre is {:.3g} m from it, its radius of gyration "
                       "{:.3g} m",
                       b.spec->name, distance, b.gyration),
           "give its orbit: initial: {position: [7000 km, 0, 0], velocity: [0, 7.5 km/s, 0]}, or `initial` in the mission, before what "
           "asks for its motion");
  }
}

Warnings still_hinges(const Simulation& sim) {
  Warnings found;
  const Model& m = sim.model();
  for (std::size_t i = 0; i < m.user.size(); ++i)
    for (const int c : m.spec->bodies[i].hinge.prescribed) {
      const UserBody& u = m.user[i];
      if (sim.profile(u.v + c) || sim.state().v[u.v + c] != 0.0) continue;
      found.add(Code::no_effect, m.spec->locate(body_path(m.spec->bodies[i]) + ".hinge.prescribed"),
                fmt::format("{} of {} is prescribed, and nothing gives it a motion: it stands still",
                            u.v_names[static_cast<std::size_t>(c)], u.name),
                fmt::format("sat:hinge(\"{}\"):profile{{...}}, or `locked: true`", u.name));
    }
  for (const Loop& loop : m.loops.all)
    if (loop.drive >= 0 && !sim.loop_profile(loop.name))
      found.add(Code::no_effect, m.spec->locate(fmt::format("loops.{}.prescribed", loop.name)),
                fmt::format("{} is prescribed, and nothing gives it a motion: it stands still", loop.name),
                fmt::format("sat:loop(\"{}\"):profile{{...}}, or no `prescribed`", loop.name));
  return found;
}

Warnings open_latches(const Simulation& sim) {
  Warnings found;
  const Model& m = sim.model();
  for (const Device& d : m.devices.all) {
    const auto mark = [&](std::string_view name) -> const double* {
      for (std::uint32_t i = 0; i < d.family->n_marks; ++i)
        if (d.family->marks[i].name == name) return &sim.state().marks[static_cast<std::size_t>(d.mark) + i];
      return nullptr;
    };
    const double *closed = mark("closed"), *missed = mark("missed");
    if (!closed || *closed != 0.0) continue;
    found.add(Code::no_effect, m.spec->locate("devices." + d.name),
              missed && *missed > 0.0 ? fmt::format("{} has caught nothing: its place was passed too fast, times {:g}", d.name, *missed)
                                      : fmt::format("{} has caught nothing: nothing came to its place", d.name));
  }
  return found;
}

Warnings faults_to_come(const Simulation& sim) {
  Warnings found;
  for (const RunningFault& f : sim.faults())
    if (!f.begun)
      found.add(Code::no_effect, {"fault of " + sim.told_port(f), {}},
                fmt::format("it begins at {:g} s, and the run ended before", f.from));
  return found;
}

double shortest_interval(const Scenario& s) {
  double interval = s.sim->shortest_period();
  const bool phases_tick = s.controllers.empty() && !s.phases.empty();
  if (!s.mission.simulation.between_steps || phases_tick) interval = std::min(interval, s.mission.output_period.value());
  for (const Controller& c : s.controllers) interval = std::min(interval, c.period.value());
  return interval;
}

bool scripts_act(const Scenario& s) { return !s.controllers.empty() || !s.phases.empty() || !s.events.empty() || !s.sequences.empty(); }

/// Rates that nothing gives are those that go with given motions, lengths and offsets as these begin. Where all are given the run says what
/// becomes of them.
void follow_profiles(Scenario& s) {
  if (s.model->loops.all.empty() || (s.model->loops.n_drives == 0 && !s.model->has_prescribed())) return;
  State state = s.sim->state();
  auto spec = std::make_shared<SystemSpec>(s.beginning ? *s.beginning : *s.changes.described());
  for (std::size_t i = 0; i < spec->bodies.size(); ++i) {
    const UserBody& u = s.model->user[i];
    for (int c = 0; c < u.nv; ++c)
      if (const MotionProfile* profile = s.sim->profile(u.v + c); profile && state.v[u.v + c] == 0.0)
        spec->bodies[i].hinge.begins.emplace_back(c, state.v[u.v + c] = profile->rate(state.t));
  }
  s.sim->set_state(state);
  if (s.sim->loops_that_begin_otherwise().empty()) return;
  for (LoopSpec& loop : spec->loops) {
    if (!loop.prescribed || loop.open) continue;
    const MotionProfile* profile = s.sim->loop_profile(loop.name);
    loop.rate = profile ? profile->rate(state.t) : 0.0;
  }
  try {
    const std::shared_ptr<const Model> closed = compile(spec, s.registry, s.compile_options());
    const State start = closed->initial_state();
    state.q = start.q, state.v = start.v;
    s.sim->set_state(state);
    s.beginning = std::move(spec), s.moved_by_beginning = closed->loops.moved;
  } catch (const InputError&) {  // given rates do not go with the profiles: expect_profiles() tells which
  }
}

void examine(Scenario& s) {
  s.warnings.add(s.model->spec->warnings);
  follow_profiles(s);
  s.sim->expect_profiles();
  const SimulationOptions& options = s.mission.simulation;
  if (is_diagonalised(options.dynamics))
    DiagonalisedForm::expect_honoured(*s.model, options.dynamics, options.integrator, {"mission.dynamics", {s.file.string(), 0, 0}});
  choose_method_of(s);
  look_at_open_loops(s);
  expect_away_from_centre(s.model, s.sim->state().q.data());
  look_at_pull(s);
  expect_tolerances_above_rounding(s);
  look_at_ticks(s);
  look_at_dates(s);
  if (!scripts_act(s))
    s.warnings.add(held_back(*s.model->spec)), s.warnings.add(idle_at_hinges(*s.model)), s.warnings.add(still_hinges(*s.sim));
  s.warnings.add(unheeded_validity(*s.model)), s.warnings.add(idle_keys(*s.model));
  look_at_sizes(s);
  s.warnings.add(FlexibleLimits(*s.sim).expected(*s.sim, s.end()));
}

void try_start(Scenario& s) {
  for (int i = 0; i < s.model->nv; ++i)
    if (const MotionProfile* profile = s.sim->profile(i)) s.sim->v(i) = profile->rate(s.sim->time());
  s.look_at_state();
  s.sim->vdot();
  const double t = s.sim->time();
  for (const ScriptEvent& e : s.events) {
    double value = 0.0;
    s.actor = e.name;
    s.trial_time = t, s.in_event_function = true;
    e.when.call({&t, 1}, {&value, 1});
    s.in_event_function = false;
  }
}

void try_sequences(Scenario& s) {
  s.stage = Scenario::Stage::run;
  if (!s.phases.empty()) s.phase = s.phases[0].name, s.phase_begun = s.sim->time();
  s.sequences.begin(false, {});
  for (int i; (i = s.sequences.due(s.sim->time())) >= 0 && !s.sim->stopped();) {
    const std::string& name = s.sequences.all()[static_cast<std::size_t>(i)].name;
    s.actor = name;
    s.sequences.go_on(i);
  }
}

/// What a function of the end may lack at the start: numbers and tables that the run sets. A name that is not there, an argument of another
/// kind, a function that nobody has written and several values in place of one are no better at the end.
bool may_come(const Diagnostic& d) {
  if (d.code != Code::lua_runtime) return d.got == "nil" || d.got == "no value";
  return d.at.key_path != "results" && d.about.find("attempt to call") == std::string::npos;
}

Warnings measures_at_start(Scenario& s) {
  Warnings found;
  s.stage = Scenario::Stage::end;
  const auto look = [&](const char* kind, const Measure& m) {
    double ignored = 0.0;
    s.actor = m.name;
    try {
      m.value.call({}, {&ignored, 1});
    } catch (const InputError& e) {
      const Diagnostic& d = e.diagnostics().front();
      if (may_come(d)) return;
      std::string why(d.about.empty() ? title_of(d.code) : d.about);
      for (const auto& [word, text] : {std::pair{"expected", &d.expected}, {"got", &d.got}})
        if (!text->empty()) why += fmt::format(", {} {}", word, *text);
      found.add(Code::mission_doubt, d.at, fmt::format("{} \"{}\" fails at the start: {}", kind, m.name, why),
                "so it will at the end of a run (N0303), unless the run changes what it asks for");
    } catch (const NumericsError&) {  // of the state: that of the end is another one
    }
  };
  for (const Measure& m : s.checks) look("check", m);
  for (const Measure& m : s.figures) look("figure", m);
  return found;
}

std::vector<std::string> kept_elsewhere_at_start(Scenario& s) {
  s.stage = Scenario::Stage::run;
  s.persistent.seal();
  const double t = s.sim->time();
  const auto call = [&](const LuaFunction& f, const std::string& actor) {
    if (!f) return;
    s.actor = actor;
    f.call({&t, 1}, {});
  };
  if (!s.phases.empty()) {
    s.phase = s.phases[0].name;
    s.phase_begun = t;
    call(s.phases[0].enter, s.phases[0].name);
  }
  try_sequences(s);
  for (const Controller& c : s.controllers) s.sim->every(c.period, [&] { call(c.step, c.name); });
  if (!s.controllers.empty()) s.sim->run(t);  // the first instant: what sensors read is there
  s.wanted_phase.reset();                     // nothing began
  return s.persistent.elsewhere();
}

}  // namespace cardan
