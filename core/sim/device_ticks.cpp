// Devices in a run: their ticks on the schedule, and what they do at their roots.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/noise.hpp"
#include "core/model/device_units.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

namespace {

/// Its noise, and what it may change.
std::size_t numbers_of_tick(const Device& d) { return std::size_t{d.family->n_noise} + d.family->n_states + d.family->n_marks; }

}  // namespace

/// Puts devices with a sampled part on the schedule, who gives before who takes: sensors at once, others after the controllers.
void Simulation::sample_devices(bool late) {
  if (!devices_) return;
  if (late && std::exchange(actuators_tick_, true)) return;
  for (const int i : model_->devices.order) {
    const Device& d = model_->devices.all[static_cast<std::size_t>(i)];
    if (!d.family->tick || ticks_late(d) != late) continue;
    const Rational period = period_of(*model_, d);
    noise_.resize(std::max(noise_.size(), numbers_of_tick(d)));
    const auto id = static_cast<std::size_t>(id_of(now_.device, i));
    add_task(
        period, offset_of(*model_, d),
        [this, id, tick = period.value()] {
          const int device = now_.device[id];
          delays_.shift(model_->devices, device, [this](int input, double number) { set_device_input(input, number); });
          draw_faults(device, true), tick_device(device, tick), draw_faults(device, false);
        },
        false, static_cast<int>(id));
  }
  if (!late) return;
  // After all ticks of an instant: what is taken later is what outputs are now.
  for (std::size_t i = 0; i < model_->devices.all.size(); ++i)
    if (std::ranges::any_of(model_->devices.delays, [&](const DelayLine& line) { return line.clock == static_cast<int>(i); })) {
      const Device& clock = model_->devices.all[i];
      const int id = id_of(now_.device, static_cast<int>(i));
      add_task(
          period_of(*model_, clock), offset_of(*model_, clock), [this, id] { sample_delays(now_.device[static_cast<std::size_t>(id)]); },
          false, id);
    }
}

/// Whether the ticks of a device change what it gives and nothing else, no motion and no instant.
bool Simulation::only_looks(int index) const {
  const Devices& all = model_->devices;
  const Device& d = all.all[static_cast<std::size_t>(index)];
  const auto is_it = [index](const auto& of) { return of.device == index; };
  // States that follow others follow what they are given too: it changes where a step ends.
  for (const Device& taker : all.all)
    for (int in = taker.in; taker.family->n_states > 0 && in < taker.in + taker.n_in; ++in)
      if (all.from[static_cast<std::size_t>(in)] >= 0) return false;
  return !d.acts && d.family->n_states == 0 && !d.family->impulse && std::ranges::none_of(all.holds, is_it) &&
         std::ranges::none_of(all.masses, is_it) && std::ranges::none_of(all.flows, is_it) &&
         std::ranges::none_of(all.timeouts, [&d](const CommandTimeout& t) { return t.input >= d.in && t.input < d.in + d.n_in; });
}

void Simulation::sample_delays(int clock) {
  observe();
  delays_.sample(model_->devices, clock, [this](const std::vector<int>& outs) {
    double sum = 0.0;
    for (const int out : outs) sum += devices_->output(out);
    return sum;
  });
}

/// After the ticks of an instant.
void Simulation::expire_commands() {
  ages_.expire(model_->devices, state_.t, [this](const CommandTimeout& timeout) {
    set_device_input(timeout.input, timeout.safe);
    if (recorder_) recorder_->note(Note::event, state_.t, {told_input(*model_, timeout.input), "timeout"});
  });
}

void Simulation::tick_device(int index, double period) {
  const Device& d = model_->devices.all[static_cast<std::size_t>(index)];
  const Observer& o = observe();
  for (std::size_t i = 0; i < d.mounts.size(); ++i) {
    cardan_mount_motion& to = devices_->motion_of_tick(d.mount + static_cast<int>(i));
    if (d.mounts[i].v >= 0) to.vdot = vdot_[static_cast<std::size_t>(d.mounts[i].v)];
    if (d.mounts[i].node < 0 || (d.mounts[i].use & CARDAN_USE_ACCELERATION) == 0) continue;
    const NodeState n = o.node(d.mounts[i].node);
    Eigen::Vector3d::Map(to.alpha) = n.acceleration.head<3>();
    Eigen::Vector3d::Map(to.specific_force) = n.specific_force;
  }
  if (noise_.size() < numbers_of_tick(d)) noise_.resize(numbers_of_tick(d));  // of a model that was adopted
  normal_noise(noise_key(options_.seed, d.name), static_cast<std::uint64_t>(tick_), d.family->n_noise, noise_.data());
  // Behind the noise: what it may change, as it was.
  double *const z = state_.z.data() + d.z, *const marks = state_.marks.data() + d.mark;
  double *const z_before = noise_.data() + d.family->n_noise, *const marks_before = std::copy_n(z, d.family->n_states, z_before);
  std::copy_n(marks, d.family->n_marks, marks_before);
  if (d.family->impulse) ask_for_impulse(index, CARDAN_CAUSE_TICK, 0);
  bool good = false;
  if (!unless_thrown([&] { good = devices_->tick(index, period, noise_.data(), state_.z.data(), state_.marks.data()); }) || !good)
    fail(explain({}));
  strike();
  const bool same_states = std::equal(z, z + d.family->n_states, z_before);
  if (same_states && std::equal(marks, marks + d.family->n_marks, marks_before)) return;
  if (d.acts || !same_states) return changed();
  devices_->set({state_.t, state_.z.data(), state_.marks.data(), tau_total_.data(), wrenches_.data()});
  if (!unless_thrown([&] { good = devices_->evaluate(); }) || !good) fail(explain({}));  // what it gives now; the motion is as it was
}

void Simulation::device_event(int device, std::uint32_t root, int direction) {
  if (!unless_thrown([&] { devices_->event(device, root, direction, state_.z.data(), state_.marks.data()); })) fail(explain({}));
}

void Simulation::start_device(int device) {
  device_event(device, model_->devices.all[static_cast<std::size_t>(device)].family->n_roots, 0);
}

/// At a trial state; behind what devices hold those of fields.
void Simulation::device_roots(double t, const double* x, double* g) {
  const Model& m = *model_;
  const double *q = with_given_motion(t, x), *v = q + m.nq;
  on_trial_->set({t, v + m.nv, state_.marks.data(), nullptr, nullptr});
  on_trial_->look_at(*devices_, beside_.get(), inputs(q, v));
  on_trial_->roots(g);
  if (m.devices.n_edges > 0) on_trial_->edges(g + m.devices.n_roots + m.devices.holds.size());
}

/// `but`: devices that have started before.
void Simulation::start_devices(std::span<const int> but) {
  if (!devices_) return;
  observe();
  for (std::size_t i = 0; i < model_->devices.all.size(); ++i)
    if (std::ranges::find(but, static_cast<int>(i)) == but.end()) start_device(static_cast<int>(i));
  changed();
  holds_.begin_anew = false;
  settle_holds();
}

/// What a device does where one of its roots crossed zero.
void Simulation::device_happens(int device, std::uint32_t root, int side) {
  if (model_->devices.all[static_cast<std::size_t>(device)].family->impulse) ask_for_impulse(device, root, side);
  device_event(device, root, side);
  changed();
  strike();
}

/// What devices do where one of their roots crossed zero; true if any did. What begins to hold comes last and is told of one state: where
/// it stops at a dead centre of closed loops, nothing can be evaluated until settle_holds() has let it go again.
bool Simulation::device_events(std::span<const int> crossed) {
  bool any = false;
  for (const bool holding : {false, true}) {
    bool told = false;
    for (std::size_t i = 0; devices_ && i < model_->devices.all.size(); ++i) {
      const Device& d = model_->devices.all[i];
      const auto hold = std::ranges::find(model_->devices.holds, static_cast<int>(i), &DeviceHold::device);
      if ((hold != model_->devices.holds.end()) != holding) continue;
      if (holding && is_thrown_on(*hold)) continue;
      for (std::uint32_t root = 0; root < d.family->n_roots; ++root) {
        const int side = crossed[static_cast<std::size_t>(d.root) + root];
        if (side == 0) continue;
        if (!told) observe();
        told = holding;
        device_happens(static_cast<int>(i), root, side);
        any = true;
      }
    }
    if (told) hold_what_rests_beside(crossed);
  }
  if (hold_events(crossed)) any = true;
  if (any) settle_holds();
  return any;
}

}  // namespace cardan
