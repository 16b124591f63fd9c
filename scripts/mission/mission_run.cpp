#include "scripts/mission/mission_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scripts/mission/examine.hpp"

namespace cardan {
namespace {

constexpr const char* kPersist = "persist{}";  // acts where a checkpoint is made
constexpr double kInstant = 1e-9;              // [s] what is closer than this happens at the same time ...
constexpr double kOfTime = 1e-15;              // ... or than this of the time, whose rounding the difference of two has
constexpr int kMostChanges = 100;              // of phases, or beginnings of each sequence, in one instant
constexpr double kMostIntervals = 500.0;       // of the history of steps, in the planned duration

/// An error of a script during the run.
RunFailure failure_of(const Diagnostic& d, const std::string& actor, double t) {
  RunFailure f{Code::controller_error, t, "", "", "", d.hint, ""};
  if (d.code == Code::lua_budget) f.code = Code::controller_budget;
  if (d.code == Code::no_memory) f.code = Code::no_memory_in_run;
  f.what = fmt::format("{}: {}", actor, d.about.empty() ? title_of(d.code) : d.about);
  if (!d.at.key_path.empty()) f.what += ", at " + d.at.key_path;
  f.what += place_of_failure(d.at.mark);
  if (!d.expected.empty()) f.what += "\n  expected: " + d.expected;
  if (!d.got.empty()) f.what += "\n  got:      " + d.got;
  if (!d.stack.empty()) f.what += "\n  stack:    " + d.stack;
  return f;
}

/// Of the history of steps: whole periods of the output, in every run of a mission the same, however far it goes.
Rational history_period(const MissionSpec& mission) {
  const Rational& output = mission.output_period;
  const double rows = mission.duration * static_cast<double>(output.denominator) / static_cast<double>(output.numerator);
  const double most = static_cast<double>(Rational::kLargest / output.numerator);
  return {output.numerator * static_cast<std::int64_t>(std::clamp(std::ceil(rows / kMostIntervals), 1.0, most)), output.denominator};
}

/// Whose function runs, as long as this is there.
struct Acting {
  Acting(Scenario& s, const std::string& actor) : scenario(s) { scenario.actor = actor; }
  ~Acting() { scenario.actor = {}; }
  Acting(const Acting&) = delete;
  Acting& operator=(const Acting&) = delete;
  Scenario& scenario;
};

}  // namespace

/// Calls a function of the script: what goes wrong in it is a failure of the run, in the name of `actor`.
template <class F>
void MissionRun::call(const std::string& actor, F&& function) {
  const Acting acting(s_, actor);
  try {
    function();
  } catch (const InputError& e) {
    if (s_.lua.is_interrupted()) throw;  // a person's wish, not a failure
    if (!s_.fault) throw NumericsError(failure_of(e.diagnostics().front(), actor, s_.sim->time()));
  }
  if (s_.fault) throw NumericsError(*std::exchange(s_.fault, std::nullopt));
}

MissionRun::MissionRun(Scenario& scenario, Recorder& recorder, std::vector<Output> outputs)
    : s_(scenario), recorder_(recorder), limits_(*scenario.sim) {
  Simulation& sim = *s_.sim;
  for (Warnings* warnings : {&s_.warnings, &sim.warnings()}) warnings->set_folder(s_.folder);
  happened_.assign(s_.events.size(), 0);
  for (std::size_t i = 0; i < s_.events.size(); ++i) {
    const ScriptEvent& e = s_.events[i];
    const std::string actor = fmt::format("event \"{}\"", e.name);
    sim.add_event({e.name,
                   [this, i, &e, actor](double t, const double* q, const double* v) {
                     return happened_[i] != 0 ? e.direction : crossing(e.when, actor, t, q, v);  // on the side to which it has gone
                   },
                   e.direction,
                   [this, i, &e, actor] {
                     const double t = s_.sim->time();
                     happened_[i] = e.once;
                     if (e.action) call(actor, [&] { e.action.call({&t, 1}, {}); });
                     change_phases(false);
                   }});
  }
  if (!s_.sequences.empty()) begin_sequences();
  for (const Controller& c : s_.controllers)
    sim.every(c.period, [this, &c, actor = fmt::format("controller \"{}\"", c.name)] { tick(c, actor); });
  if (s_.controllers.empty() && !s_.phases.empty()) sim.every(s_.mission.output_period, [this] { change_phases(true); });
  sim.record(recorder, std::move(outputs), s_.mission.output_period);
  sim.record_steps(history_period(s_.mission));
  if (limits_.needed()) sim.watch(s_.mission.output_period, [this] { limits_.see(*s_.sim); });
  if (const auto& period = s_.mission.checkpoint_period)
    sim.every(
        *period, [this] { make_checkpoint(); }, *period);  // after all others
  note_warnings();
  limits_.expected(sim, s_.end());  // told before the run: what is seen is news where it exceeds that
}

namespace {

std::string actor_of(const Sequences::Sequence& sequence) { return fmt::format("sequence \"{}\"", sequence.name); }

}  // namespace

/// What they wait for: instants, and the zeros of conditions, which are events of their own.
void MissionRun::begin_sequences() {
  Simulation& sim = *s_.sim;
  Sequences& all = s_.sequences;
  all.begin(s_.mission.checkpoint_period.has_value(), [this](const Sequences::Sequence& me, const std::string& what) {
    recorder_.note(Note::event, s_.sim->time(), {me.name, what});
  });
  sim.at_instants([&all] { return all.next(); }, [this] { go_on_with_sequences(); });
  for (int i = 0; i < static_cast<int>(all.all().size()); ++i) {
    const Sequences::Sequence& me = all.all()[static_cast<std::size_t>(i)];
    for (const bool from_a_side : {true, false}) {
      const auto located = [this, i, from_a_side, &me](double t, const double* q, const double* v) {
        if (!s_.sequences.is_located(i, from_a_side)) return 1.0;
        return (from_a_side ? me.wait.side : 1) * s_.sequences.seen(i, crossing(me.when, actor_of(me), t, q, v));
      };
      const auto crossed = [this, i, from_a_side, &me] {
        if (!s_.sequences.is_located(i, from_a_side)) return;  // what happened first in this instant has ended it
        call(actor_of(me), [&] { s_.sequences.crossed(i); });
        change_phases(false);
      };
      sim.add_event({me.name, located, from_a_side ? 1 : 0, crossed, false});
    }
  }
}

/// All that are due, in the order of their declaration.
void MissionRun::go_on_with_sequences() {
  if (phase_ == 0) change_phases(true);  // the first one has begun
  const int most = kMostChanges * static_cast<int>(s_.sequences.all().size());
  for (int n = 0; !s_.sim->stopped(); ++n) {
    const int i = s_.sequences.due(s_.sim->time());
    if (i < 0) return;
    const std::string actor = actor_of(s_.sequences.all()[static_cast<std::size_t>(i)]);
    if (n == most)
      throw NumericsError(RunFailure{Code::controller_error, s_.sim->time(), "", "",
                                     fmt::format("{}: sequences began {} times in one instant", actor, n),
                                     "of those that start each other one has to wait"});
    call(actor, [&] { s_.sequences.go_on(i); });
    change_phases(false);
  }
}

/// What the function of an event has to say is told in place of what the integrator made of it.
template <class F>
void MissionRun::told_by_events(F&& part) {
  event_interrupt_ = nullptr, event_failure_.reset();
  try {
    part();
  } catch (const NumericsError&) {
    if (event_interrupt_) std::rethrow_exception(std::exchange(event_interrupt_, nullptr));
    if (event_failure_) throw NumericsError(*event_failure_);
    for (const auto& device : s_.script_devices)
      if (device->failure()) {
        if (s_.lua.is_interrupted()) throw InputError({*device->failure()});
        throw NumericsError(failure_of(*device->failure(), fmt::format("device type \"{}\"", device->description().type), s_.sim->time()));
      }
    throw;
  }
}

void MissionRun::run(double t_end, const std::function<void(double t)>& progress) {
  s_.stage = Scenario::Stage::run;
  call(kPersist, [&] { s_.persistent.seal(); });
  note_warnings();
  try {
    told_by_events([&] { s_.sim->run(t_end, progress); });
    add_limits();
    look_elsewhere();
    if (scripts_act(s_)) add_seen_now(s_.changes.without_effect()), add_seen_now(still_hinges(*s_.sim));
    add_seen_now(open_latches(*s_.sim)), add_seen_now(faults_to_come(*s_.sim)), add_seen_now(never_happened()),
        add_seen_now(s_.sequences.unfinished());
    note_warnings();
  } catch (const InputError& e) {
    add_limits();
    if (s_.lua.is_interrupted() || s_.changes.actor().empty()) throw;  // a person's wish
    throw NumericsError(failure_of(e.diagnostics().front(), s_.changes.actor(), s_.sim->time()));
  } catch (const NumericsError&) {
    add_limits();
    try {
      look_elsewhere();
    } catch (const std::exception&) {  // the first failure is the one that is told
    }
    throw;
  }
  s_.stage = Scenario::Stage::end;
}

void MissionRun::remember(Archive& a) {
  a.block("mission")(phase_).finite(s_.phase_begun)(noted_, s_.warnings, limits_, std::span(happened_));
  if (phase_ > s_.phases.size() + 1 || noted_ > s_.warnings.all().size()) a.wrong("more phases or warnings than there are");
  s_.phase = phase_ == 0 || phase_ > s_.phases.size() ? std::string_view() : s_.phases[phase_ - 1].name;
  a.block("signals");
  for (const auto& signal : s_.signals) a(std::span(signal->values));
  if (!s_.sequences.empty()) a.block("sequences")(s_.sequences);
  a.block("script")(s_.persistent);
  if (a.reading()) s_.sequences.expect_standing(a);
  a.block(kKeptElsewhere)(elsewhere_);
}

void MissionRun::make_checkpoint() {
  if (s_.sim->stopped()) return;
  look_elsewhere();
  Archive all;
  s_.changes.remember(all);
  call(kPersist, [&] { remember(all); });
  Checkpoint checkpoint = all.checkpoint();
  checkpoint.merge(s_.sim->checkpoint());
  if (keep_) keep_(s_.sim->time(), std::move(checkpoint));
}

void MissionRun::resume(const Checkpoint& checkpoint) {
  s_.stage = Scenario::Stage::run;  // event functions are looked at
  s_.persistent.seal();
  Archive all(checkpoint);
  s_.changes.remember(all);
  remember(all);
  all.finish();
  told_by_events([&] { s_.sim->resume(checkpoint); });
  s_.changes.go_on();
  s_.look_at_state();
}

void MissionRun::look_elsewhere() {
  if (!elsewhere_.empty() || !scripts_act(s_)) return;
  call(kPersist, [&] { elsewhere_ = s_.persistent.elsewhere(); });
  for (std::string& lost : s_.sequences.lost()) elsewhere_.push_back(std::move(lost));
}

void MissionRun::add_limits() {
  s_.warnings.add(limits_.seen());
  note_warnings();
}

void MissionRun::add_seen_now(const Warnings& found) {
  for (const Warning& w : found.all()) s_.warnings.add(w.what, s_.sim->time());
}

Warnings MissionRun::never_happened() const {
  Warnings found;
  for (std::size_t i = 0; i < s_.events.size(); ++i)
    if (const ScriptEvent& e = s_.events[i]; e.once && happened_[i] == 0)
      found.add(Code::no_effect, {fmt::format("event \"{}\"", e.name), {s_.file.string(), 0, 0}},
                "it never happened: what it would have done was not done");
  for (const auto& signal : s_.signals) {
    const std::string path = "signals." + signal->channel.path;
    const auto told = [&](const Warning& w) { return w.what.at.key_path == path; };  // of one that was stored as nan
    if (std::ranges::all_of(signal->values, [](double x) { return std::isnan(x); }) && std::ranges::none_of(s_.sim->warnings().all(), told))
      found.add(Code::no_effect, {path, signal->declared}, "nothing stored a number: its channel is empty",
                "a controller, a phase or an action calls what `signals` returned for it");
  }
  return found;
}

void MissionRun::note_warnings() {
  for (; noted_ < s_.warnings.all().size(); ++noted_) note(recorder_, s_.warnings.all()[noted_]);
}

void MissionRun::tick(const Controller& c, const std::string& actor) {
  change_phases(true);
  if (s_.sim->stopped()) return;
  const double t = s_.sim->time();
  int left = 0;
  call(actor, [&] { left = c.step.call({&t, 1}, {}); });
  if (left > 0)
    s_.sim->warn(Code::no_effect, {actor, c.at.mark}, "its step returns a value, which nothing takes",
                 "commands are given where they act: hinge:torque(x), load:set(...), device:set(name, x)");
  change_phases(false);
}

/// The function of an event at a trial state. It may not throw through the integrator: its failure is kept for run().
double MissionRun::crossing(const LuaFunction& when, const std::string& actor, double t, const double* q, const double* v) {
  s_.q = q, s_.v = v, s_.z = v + s_.sim->model().nv, s_.trial_time = t, s_.in_event_function = true;
  double value = std::nan("");
  const Acting acting(s_, actor);
  try {
    when.call({&t, 1}, {&value, 1});
  } catch (const InputError& error) {
    if (s_.lua.is_interrupted()) event_interrupt_ = std::current_exception();
    event_failure_ = failure_of(error.diagnostics().front(), actor, s_.sim->time());
    value = std::nan("");
  }
  s_.in_event_function = false;
  s_.look_at_state();
  return value;
}

/// What follows the present phase, if another was asked for or, at a tick, it is over: its index, or how many there are.
std::optional<std::size_t> MissionRun::next_phase(bool at_tick) {
  if (s_.wanted_phase) return std::exchange(s_.wanted_phase, std::nullopt);
  if (!at_tick || phase_ > s_.phases.size() || s_.phases.empty()) return {};
  if (phase_ == 0) return 0;
  const Phase& present = s_.phases[phase_ - 1];
  const bool over = is_over(present);
  if (s_.wanted_phase) return std::exchange(s_.wanted_phase, std::nullopt);
  if (!over) return {};
  return present.next.empty() ? phase_ : index_of_phase(s_.phases, present.next);
}

/// Ends phases and begins those that follow, until one lasts.
void MissionRun::change_phases(bool at_tick) {
  for (int changes = 0; auto next = next_phase(at_tick); ++changes) {
    const std::string before(s_.phase);
    if (phase_ > 0 && phase_ <= s_.phases.size()) call_phase(s_.phases[phase_ - 1].exit, s_.phases[phase_ - 1]);
    if (s_.wanted_phase) next = std::exchange(s_.wanted_phase, std::nullopt);
    phase_ = *next + 1;
    s_.phase_begun = s_.sim->time();
    s_.phase = *next == s_.phases.size() ? std::string_view() : s_.phases[*next].name;
    recorder_.note(Note::phase, s_.phase_begun, {std::string(s_.phase)});
    if (changes == kMostChanges)
      throw NumericsError(
          RunFailure{Code::controller_error, s_.phase_begun, "", "",
                     fmt::format("the phases changed {} times in one instant, at last from \"{}\" to \"{}\"", changes, before, s_.phase),
                     "one of those that follow each other must last: a duration above zero, or until_ that is false at its beginning"});
    if (*next < s_.phases.size()) call_phase(s_.phases[*next].enter, s_.phases[*next]);
  }
}

bool MissionRun::is_over(const Phase& p) {
  const double t = s_.sim->time();
  if (t - s_.phase_begun >= p.duration - std::max(kInstant, kOfTime * std::abs(t))) return true;
  if (!p.until) return false;
  bool over = false;
  call(fmt::format("phase \"{}\"", p.name), [&] {
    s_.lua.protect(
        [&](lua_State* L) {
          p.until.push(L);
          lua_pushnumber(L, t);
          lua_call(L, 1, 1);
          over = lua_toboolean(L, -1) != 0;
          if (lua_isboolean(L, -1) || lua_isnil(L, -1)) return;
          p.until.push(L);
          refuse(Code::lua_runtime, {"result of until_", s_.lua.definition(L, -1)}, "true or false", describe_value(L, -2),
                 "every number is true in Lua, also 0: compare it, panel:angle() >= 1.57");
        },
        s_.lua.call_budget());
  });
  return over;
}

void MissionRun::call_phase(const LuaFunction& f, const Phase& p) {
  if (!f) return;
  const double t = s_.sim->time();
  call(fmt::format("phase \"{}\"", p.name), [&] { f.call({&t, 1}, {}); });
}

double MissionRun::value(const Measure& m, const char* what) {
  double x = 0.0;
  call(fmt::format("{} \"{}\"", what, m.name), [&] { m.value.call({}, {&x, 1}); });
  return x;
}

Check MissionRun::check(const Measure& m) {
  Check c;
  c.name = m.name;
  c.unit = m.unit;
  c.detail = m.condition;
  c.value = value(m, "check");
  c.pass = m.low <= c.value && c.value <= m.high;
  c.least = m.low, c.most = m.high;
  // Of two limits the nearer one.
  c.limit = std::isinf(m.high) || std::abs(c.value - m.low) < std::abs(c.value - m.high) ? m.low : m.high;
  return c;
}

Figure MissionRun::figure(const Measure& m) { return {m.name, value(m, "figure"), m.unit}; }

}  // namespace cardan
