// What a run warns of and what ends it, told by the names of its vehicle: numbers that are not finite, steps that lead nowhere, devices,
// fields and plugins that fail.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include "core/base/finite.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/model/doubts.hpp"
#include "core/model/validate.hpp"
#include "core/sim/device_corners.hpp"
#include "core/sim/expected_stiffness.hpp"
#include "core/sim/fastest_motion.hpp"
#include "core/sim/loop_doubts.hpp"
#include "core/sim/plugin_faults.hpp"
#include "core/sim/simulation.hpp"
#include "core/sim/whirling_hinge.hpp"

namespace cardan {
namespace {

/// Where steps vanish, the level of a flexible body may be why: its inertia goes to zero, and what turns about that direction has no bounds
/// (docs/mathematics/flexible.md, 2). What would break down with modes a tenth larger; empty: nothing.
std::optional<RunFailure> close_to_no_inertia(const Model& m, const State& state) {
  if (m.flexible.empty() || !m.loops.all.empty()) return {};
  Eigen::VectorXd q = state.q;
  for (const UserBody& u : m.user) q.segment(u.eta, u.n_modes) *= 1.1;
  Workspace ws(m);
  if (articulate_at_rest(m, ws, q.data()) || !(ws.breakdown.value < 0.0)) return {};
  return describe_breakdown(m, ws.breakdown, state.t);
}

}  // namespace

/// Body or device, and which of its states; `state`: index into [q, v, z].
std::pair<std::string, std::string> Simulation::named_state(int state) const {
  const Model& m = *model_;
  for (const Device& d : m.devices.all) {
    const int i = state - m.nq - m.nv - d.z;
    if (i >= 0 && i < static_cast<int>(d.family->n_states)) return {d.name, d.family->states[i].name};
  }
  const bool is_q = state < m.nq;
  for (const UserBody& u : m.user) {
    const int i = is_q ? state - u.q : state - m.nq - u.v;
    const auto& names = is_q ? u.q_names : u.v_names;
    if (i >= 0 && i < std::ssize(names)) return {u.name, names[static_cast<std::size_t>(i)]};
    const int mode = is_q ? state - u.eta : state - m.nq - u.etadot;
    if (u.n_modes > 0 && mode >= 0 && mode < u.n_modes) return {u.name, fmt::format("mode {}", mode + 1)};
  }
  return {"", fmt::format("state {}", state)};
}

RunFailure Simulation::not_finite(int state, double value) const {
  RunFailure f{Code::not_finite, state_.t, "", "", "", "too large a step, or a command that grows without limit?", ""};
  std::tie(f.body, f.what) = named_state(state);
  f.what += std::isnan(value) ? " = nan" : value > 0 ? " = inf" : " = -inf";
  return f;
}

void Simulation::expect_finite(const std::vector<double>& x) {
  const int n = static_cast<int>(x.size());
  if (all_finite(x.data(), n)) return;
  const int bad = first_not_finite(x.data(), n);
  fail(not_finite(bad, x[static_cast<std::size_t>(bad)]));
}

/// Where loops could not be kept closed, at a state that may be a trial one.
void Simulation::keep_broken(double t, const double* q) {
  if (obstacle_.breakdown.row < 0) return;
  obstacle_.t = t, obstacle_.q.assign(q, q + model_->nq), obstacle_.drives = drives_;
}

/// What the sweeps know about a step that the integrator gave up.
RunFailure Simulation::explain(const RunFailure& failure) const {
  if (!thrown_.empty())
    return {Code::plugin_failed, state_.t, "", "", thrown_, "a fault of the plugin: cardan check-plugin tries what it can", ""};
  if (const std::string told = gravity_stopped_.empty() ? told_of_gravity() : gravity_stopped_; !told.empty())
    return {
        Code::field_failed,
        state_.t,
        "",
        "",
        told,
        std::string(
            begun_ ? "where the vehicle is may be outside of what the field knows: another field, or `outside: hold` where it can hold"
                   : "the vehicle is where its file says, without a place in the origin of the world, until `initial` of the mission has "
                     "given another: ask after it. Outside of what the field knows: another field, or `outside: hold` where it can hold") +
            (prescribed_.empty() ? "" : "; a body on a given motion that stands for what pulls: its `com` outside of it"),
        ""};
  const Obstacle& o = obstacle_;
  if (o.breakdown.body != 0) {
    RunFailure f = describe_breakdown(*model_, o.breakdown, state_.t);
    if (o.breakdown.row >= 0) tell_singular_posture(*model_, o.breakdown, o.t, o.q.data(), o.drives.data(), f);
    if (!std::isfinite(o.breakdown.value)) f.code = Code::not_finite;
    if (!o.culprit.empty()) f.hint = o.culprit;
    return f;
  }
  if (const FieldFault* tried = devices_ ? devices_->tried_limit() : nullptr) return beyond_a_field(*tried);
  if (devices_ && devices_->fault().device >= 0) {
    const Device& d = model_->devices.all[static_cast<std::size_t>(devices_->fault().device)];
    return {Code::device_failed,
            state_.t,
            "",
            "",
            fmt::format("{}: {}", told_device(d), devices_->fault().what),
            "its parameters and inputs; what it reads may be outside of what it is made for",
            ""};
  }
  if (o.bad_rate < 0) {
    RunFailure f = failure;
    if (f.code != Code::step_too_small || integrator_->worst() < 0) return f;
    std::string state;
    std::tie(f.body, state) = named_state(integrator_->worst());
    f.what += fmt::format(", most of it that of {}", state);
    if (const auto close = close_to_no_inertia(*model_, state_))
      f.hint = fmt::format("it comes to {} (N0107) with modes a tenth larger: {}", close->what, close->hint);
    return f;
  }
  RunFailure f = not_finite(model_->nq + o.bad_rate, o.vdot);
  if (!o.culprit.empty()) f.hint = o.culprit;
  return f;
}

RunFailure Simulation::beyond_a_field(const FieldFault& fault) const {
  const Device& d = model_->devices.all[static_cast<std::size_t>(fault.device)];
  return {Code::device_failed,
          state_.t,
          "",
          "",
          fmt::format("{}: {}", told_device(d), fault.what),
          "another field, or `outside: hold` where it can hold",
          ""};
}

void Simulation::warn(Code code, Located at, std::string about, std::string hint) {
  const std::size_t before = warnings_.all().size();
  warnings_.add(code, std::move(at), std::move(about), std::move(hint), state_.t);
  if (warnings_.all().size() == before) return;
  if (recorder_) note(*recorder_, warnings_.all().back());
  if (told_) told_(warnings_.all().back());
}

void Simulation::say_doubts() {
  Warnings doubts = doubts_at_start(*model_, state_.q.data(), state_.v.data());
  doubts.add(loops_far_from_home(*this));
  for (const Warning& w : doubts.all()) warn(w.what.code, w.what.at, w.what.about, w.what.hint);
}

/// Before the first step; of a run that is resumed, which may go further, unless it was told so before.
void Simulation::foresee_stiffness(double t_end) {
  if (std::exchange(foreseen_, true)) return;
  const Warnings expected = expected_stiffness(model_, state_.q.data(), options_.integrator, schedule_.shortest_period(), t_end - state_.t);
  for (const Warning& w : expected.all())
    if (std::ranges::none_of(warnings_.all(), [&](const Warning& told) {
          return told.what.code == w.what.code && told.what.at.key_path == w.what.at.key_path;
        }))
      warn(w.what.code, w.what.at, w.what.about, w.what.hint);
}

/// The integrator found that stability sets its steps.
void Simulation::say_stiff() {
  FastestMotion fastest;
  if (!warned_stiff_) {
    fastest = fastest_motion(model_, state_.q.data());
    if (FastestMotion pushed = swing_of_devices(*model_, state_.t, state_); pushed.rate > fastest.rate) fastest = std::move(pushed);
  }
  warned_stiff_ = true;
  const double h = statistics().last_step;
  constexpr double kExplains = 0.1;  // steps at the border of stability are about one over the fastest rate
  const bool explains = fastest.rate * h >= kExplains;
  const std::string why = !(fastest.rate > 0) ? ""
                          : explains          ? fmt::format("; fastest is {}, {:.3g} 1/s", fastest.what, fastest.rate)
                                     : "; no mode, spring or damper is that fast: look at friction, contacts and states of devices";
  warn(Code::stiff_scene, {"integrator.method", {}},
       fmt::format("stability and not accuracy sets the steps of {}, {:.2g} s: {:.1e} of them to t = {:g} s{}", integrator_name(), h,
                   (t_end_ - state_.t) / h, t_end_, why),
       explains && !fastest.decays ? kSwingHint : kStiffHint);
}

/// The integrator found that rounding sets its steps.
void Simulation::say_rounding(const StepReport& report) {
  for (const Warning& w : warnings_.all())
    if (w.what.code == Code::rounding_sets_steps) return;
  const double h = statistics().last_step;
  const auto [body, what] = named_state(report.rounded);
  warn(Code::rounding_sets_steps, {"integrator.relative", {}},
       fmt::format("rounding and not accuracy sets the steps of {}, {:.2g} s: {:.1e} of them to t = {:g} s. That of the states is worth "
                   "{:.2g} times "
                   "the error that is allowed, most of it in that of {}.{}",
                   integrator_name(), h, (t_end_ - state_.t) / h, t_end_, report.rounding, body, what),
       "a larger integrator.relative, by tens until nothing is told. Stiff forces between vehicles far from the origin have few digits of "
       "what lies between these: `hinge: {type: free, to: TARGET}` of the base of one counts it from the other");
}

/// Near the lock of a gimbal the steps follow its rates, not the body's.
void Simulation::say_whirling() {
  const WhirlingHinge near = whirling_hinge(*model_, workspace_, state_.v.data());
  if (near.body == 0) return;
  const auto user = std::ranges::find_if(model_->user, [&](const UserBody& u) { return u.sweep == near.body && !u.merged; });
  const BodySpec& body = model_->spec->bodies[static_cast<std::size_t>(user - model_->user.begin())];
  if (body.hinge.factor == HingeFactor::square_root) return;  // keeps its digits
  Located at = model_->spec->locate(body_path(body) + ".hinge");
  for (const Warning& w : warnings_.all())
    if (w.what.code == Code::near_singular && w.what.at.key_path == at.key_path) return;
  warn(Code::near_singular, std::move(at),
       fmt::format(
           "the rates of the hinge of {} are {:.2g} times as fast as it turns: its axes are nearly in one plane, the lock of gimbals, "
           "where steps get as short and errors grow",
           body.name, near.times),
       "a hinge of type ball, whose quaternion has no such place, `factor: square_root`, which keeps the digits, or other axes "
       "(`sequence`)");
}

/// "field earth (acme/oblate) at bus: earth is asked beyond its limit inside: ..."; empty where nothing is wrong with it in the last
/// evaluation.
std::string Simulation::told_of_gravity() const {
  for (std::size_t k = 1; gravity_field_ >= 0 && k < model_->bodies.size(); ++k) {
    const Field& field = model_->fields[static_cast<std::size_t>(gravity_field_)];
    const int beyond = gravity_beyond(static_cast<int>(k));
    const std::string told = beyond == -1 ? fmt::format("gravity of {} is not finite", told_name(field)) : told_beyond(field, beyond);
    if (!told.empty())
      return fmt::format("field {} ({}) at {}: {}", field.name, field.source->family->type,
                         model_->user[static_cast<std::size_t>(model_->owner[k])].name, told);
  }
  return {};
}

/// Bits of limits of the field of gravity, at the mass centre of a sweep body in the last evaluation; -1: it is not finite there.
int Simulation::gravity_beyond(int k) const {
  if (!workspace_.has_world() || model_->bodies[static_cast<std::size_t>(k)].kind == BodyKernel::rotor) return 0;
  const FieldSource& f = *model_->field.source;
  const SweepBody& b = model_->bodies[static_cast<std::size_t>(k)];
  const RigidInertia<double>& M = b.n_modes > 0 ? workspace_.modal_of(k)->M_rr : b.M;
  if (!(M.m > 0.0)) return 0;
  const Pose<double>& body = workspace_.pose_W(k);
  const Vec3<double> p = body.p + body.R * ((1.0 / M.m) * M.h);
  const double point[3] = {p.x, p.y, p.z};
  double value[CARDAN_FIELD_NUMBERS];
  const cardan_field_args args{sizeof args, moment_->t, f.packed.data(), moment_->prepared};
  const int beyond = f.family->evaluate(&args, 1, point, value, nullptr);
  return all_finite(value, 3) ? beyond | moment_->beyond : -1;
}

/// After a step: no motion goes on beyond what its fields know. Where they know no value beyond, smaller and smaller steps come nearer to
/// the limit for ever: after some that hardly went further it ends there.
void Simulation::expect_within_fields() {
  const FieldFault* tried = devices_ ? devices_->tried_limit() : nullptr;
  const bool near = !gravity_stopped_.empty() || tried;
  const bool crawls = near && headway_.crawls(state_.t, t_end_);
  if (crawls && !gravity_stopped_.empty()) fail(explain({}));
  const FieldFault* passed = devices_ ? devices_->passed_limit() : nullptr;
  if (!passed && crawls) passed = tried;
  if (passed) fail(beyond_a_field(*passed));
  if (!near) return;
  gravity_stopped_.clear();
  if (devices_) devices_->forget_limit();
}

/// Fields that gave what they have at the end of what they know, at an accepted state.
void Simulation::say_held_fields() {
  for (std::size_t i = 0; i < model_->fields.size(); ++i) {
    const Field& field = model_->fields[i];
    if (field.source->held == 0) continue;
    int beyond = devices_ ? devices_->held_fields()[i] : 0;
    if (static_cast<int>(i) == gravity_field_)
      for (std::size_t k = 1; k < model_->bodies.size(); ++k) beyond |= gravity_beyond(static_cast<int>(k));
    if (beyond != 0)
      warn(Code::field_held,
           model_->spec->locate(i < model_->spec->fields.size() ? fmt::format("fields.{}.outside", field.name) : "gravity.field"),
           held_text(field, beyond), "outside: refuse ends the run there");
  }
}

/// Called where an exception is caught: of a fault of ours it goes on.
void Simulation::keep_thrown(const std::string& what, const double* x) {
  if (!plugins_) throw;
  if (!thrown_.empty()) return;
  for (const DeviceForces* d : {devices_.get(), on_trial_.get()}) {
    if (!d) continue;
    if (d->called().device >= 0)
      thrown_ = fmt::format("{}: {} throws: {}", told_device(model_->devices.all[static_cast<std::size_t>(d->called().device)]),
                            d->called().function, what);
    else if (d->field_asked() >= 0)
      thrown_ = fmt::format("field {}: evaluate throws: {}", told_name(model_->fields[static_cast<std::size_t>(d->field_asked())]), what);
    if (!thrown_.empty()) return;
  }
  thrown_ = plugin_at_fault(*model_, x ? x : state_.q.data(), x ? x + model_->nq : state_.v.data());
  if (thrown_.empty() && gravity_field_ >= 0 && is_of_plugin(model_->fields[static_cast<std::size_t>(gravity_field_)].origin))
    thrown_ = fmt::format("field {}: evaluate throws: {}", told_name(model_->fields[static_cast<std::size_t>(gravity_field_)]), what);
  if (thrown_.empty()) thrown_ = fmt::format("a function of a plugin throws, and not when it is asked again: {}", what);
}

/// Where a row is written: what laws have tried at random holds here too.
void Simulation::expect_good_plugins() {
  std::string told;
  const bool whole = unless_thrown([&] {
    told = plugin_at_fault(*model_, state_.q.data(), state_.v.data());
    if (told.empty() && devices_) told = plugin_at_fault(*model_, *devices_);
    if (told.empty() && gravity_field_ >= 0 && workspace_.has_world() && model_->bodies.size() > 1) {
      const Vec3<double> at = workspace_.pose_W(1).p;
      const double point[3] = {at.x, at.y, at.z};
      told = plugin_at_fault(model_->fields[static_cast<std::size_t>(gravity_field_)], *moment_, 1, point);
    }
  });
  if (whole && told.empty()) return;
  if (whole) thrown_ = told;
  fail(explain({}));
}

/// A run that goes on after it has failed, perhaps from another state, is told of what comes.
void Simulation::forget_failure() {
  gravity_stopped_.clear(), thrown_.clear(), obstacle_.forget();
  impulse_.by = -1;
  stretch_ = std::numeric_limits<double>::infinity();
  for (Limit& limit : limits_) limit.ahead = false;
}

void Simulation::fail(RunFailure failure) {
  if (recorder_) {
    std::vector<double> x(static_cast<std::size_t>(model_->nq + model_->nv + model_->devices.n_z));
    pack(x.data());
    keep_steps();
    recorder_->restart_state(state_.t, x);
    recorder_->flush();
  }
  throw NumericsError(std::move(failure));
}

}  // namespace cardan
