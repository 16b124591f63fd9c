// Devices in a run: their ticks on the schedule, inputs that come later, commands that grow old, and what they do at their roots.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/abi/port_vectors.hpp"
#include "core/base/noise.hpp"
#include "core/model/device_units.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

namespace {

/// Its noise, and what it may change.
std::size_t numbers_of_tick(const Device& d) { return std::size_t{d.family->n_noise} + d.family->n_states + d.family->n_marks; }

/// [s] when a command that was set at t is too old: later than a tick that comes after just `timeout`, whatever rounding did to both.
double due(double t, double timeout) { return (t + timeout) * (1.0 + 4.0 * std::numeric_limits<double>::epsilon()); }

}  // namespace

/// Puts devices with a sampled part on the schedule, who gives before who takes: sensors at once, others after the controllers.
void Simulation::sample_devices(bool late) {
  if (!devices_) return;
  if (late && std::exchange(actuators_tick_, true)) return;
  for (const int i : model_->devices.order) {
    const Device& d = model_->devices.all[static_cast<std::size_t>(i)];
    if (!d.family->tick || ticks_late(d) != late) continue;
    Rational offset;
    const Rational period = period_of(d, &offset);
    const double seconds = static_cast<double>(period.numerator) / static_cast<double>(period.denominator);
    noise_.resize(std::max(noise_.size(), numbers_of_tick(d)));
    const auto id = static_cast<std::size_t>(id_of(now_.device, i));
    add_task(
        period, offset,
        [this, id, seconds] {
          const int device = now_.device[id];
          shift_delays(device), draw_faults(device, true), tick_device(device, seconds), draw_faults(device, false);
        },
        false, static_cast<int>(id));
  }
  if (!late) return;
  // After all ticks of an instant: what is taken later is what outputs are now.
  for (std::size_t i = 0; i < model_->devices.all.size(); ++i)
    if (std::ranges::any_of(model_->devices.delays, [&](const DelayLine& line) { return line.clock == static_cast<int>(i); })) {
      Rational offset;
      const Rational period = period_of(model_->devices.all[i], &offset);
      const int id = id_of(now_.device, static_cast<int>(i));
      add_task(
          period, offset, [this, id] { sample_delays(now_.device[static_cast<std::size_t>(id)]); }, false, id);
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

Rational Simulation::period_of(const Device& d, Rational* offset) const {
  const DeviceSpec& spec = model_->spec->devices[static_cast<std::size_t>(d.spec)];
  const std::string path = "devices." + d.name;
  if (offset && spec.offset != 0.0) {
    const auto at = model_->spec->locate(path + ".offset");
    const auto exact = to_rational(spec.offset);
    if (!(spec.offset > 0.0) || !exact || exact->numerator > Rational::kLargest)
      refuse(Code::out_of_range, at, "a time >= 0 that is a ratio of whole numbers", fmt::format("{:g} s", spec.offset));
    *offset = *exact;
  }
  return spec.rate > 0.0 ? period_from_hertz(spec.rate, model_->spec->locate(path + ".rate"))
                         : period_from_seconds(spec.period, model_->spec->locate(path + ".period"));
}

namespace {

/// time / period, a whole number up to kMostTicks; 0: it is none.
int whole_ticks(double time, const Rational& period) {
  const auto ratio = to_rational(time);
  // time / period = (a d) / (b n)
  const std::int64_t above = ratio ? ratio->numerator * period.denominator : 1, below = ratio ? ratio->denominator * period.numerator : 0;
  return below == 0 || above % below != 0 || above / below > kMostTicks ? 0 : static_cast<int>(above / below);
}

double seconds(const Rational& period) { return static_cast<double>(period.numerator) / static_cast<double>(period.denominator); }

}  // namespace

double Simulation::period_seconds(const Device& d) const { return seconds(period_of(d, nullptr)); }
int Simulation::ticks_of_delay(const Device& d, double delay) const { return whole_ticks(delay, period_of(d, nullptr)); }

/// A latency in ticks; the memory of all lines.
void Simulation::resolve_delays() {
  lines_.clear(), delayed_.clear();
  for (const DelayLine& line : model_->devices.delays) {
    const Device& clock = model_->devices.all[static_cast<std::size_t>(line.clock)];
    int ticks = line.ticks;
    if (ticks == 0) {
      const double tick = period_seconds(clock);
      ticks = ticks_of_delay(clock, line.latency);
      if (ticks == 0) {
        const double nearest = std::max(1.0, std::round(line.latency / tick));
        refuse(Code::bad_connection, model_->spec->locate(told_input(line.input) + ".latency"),
               fmt::format("a whole number of ticks of {}, {:g} s each, at most {}", clock.name, tick, kMostTicks),
               fmt::format("{:g} s", line.latency), fmt::format("{:g} s, or another rate of {}", nearest * tick, clock.name));
      }
    }
    lines_.push_back({ticks, static_cast<int>(delayed_.size())});
    delayed_.insert(delayed_.end(), static_cast<std::size_t>(ticks), line.fallback);
  }
}

/// "devices.wheel.inputs.torque".
std::string Simulation::told_input(int input) const {
  for (const Device& d : model_->devices.all)
    if (input >= d.in && input < d.in + d.n_in)
      return fmt::format("devices.{}.inputs.{}", d.name, port_at(*d.family, CARDAN_PORT_IN, input - d.in).name);
  return "devices";
}

/// At a tick of its clock a line gives its oldest number, until the next.
void Simulation::shift_delays(int clock) {
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const DelayLine& line = model_->devices.delays[i];
    if (line.clock != clock) continue;
    double* first = delayed_.data() + lines_[i].first;
    set_device_input(line.input, *first);
    std::copy(first + 1, first + lines_[i].ticks, first);
  }
}

void Simulation::sample_delays(int clock) {
  for (std::size_t i = 0; i < lines_.size(); ++i) {
    const DelayLine& line = model_->devices.delays[i];
    if (line.clock != clock) continue;
    observe();
    double sum = 0.0;
    for (const int out : line.outs) sum += devices_->output(out);
    delayed_[static_cast<std::size_t>(lines_[i].first + lines_[i].ticks - 1)] = sum;
  }
}

/// After the ticks of an instant.
void Simulation::expire_commands() {
  for (std::size_t k = 0; k < last_set_.size(); ++k) {
    const CommandTimeout& timeout = model_->devices.timeouts[k];
    if (state_.t < due(last_set_[k], timeout.timeout)) continue;
    set_device_input(timeout.input, timeout.safe);
    last_set_[k] = std::numeric_limits<double>::infinity();
    if (recorder_) recorder_->note(Note::event, state_.t, {told_input(timeout.input), "timeout"});
  }
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
    if (std::ranges::find(but, static_cast<int>(i)) == but.end())
      device_event(static_cast<int>(i), model_->devices.all[i].family->n_roots, 0);
  changed();
  holds_begin_anew_ = false;
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
  }
  if (hold_events(crossed)) any = true;
  if (any) settle_holds();
  return any;
}

double Simulation::next_timeout() const {
  double t = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < last_set_.size(); ++k) t = std::min(t, due(last_set_[k], model_->devices.timeouts[k].timeout));
  return t;
}

}  // namespace cardan
