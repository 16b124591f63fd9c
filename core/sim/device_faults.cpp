// Faults of ports in a run.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/abi/port_vectors.hpp"
#include "core/base/noise.hpp"
#include "core/model/device_units.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

namespace {

std::uint32_t kind_of(const PortFault& f) { return f.input ? CARDAN_PORT_IN : CARDAN_PORT_OUT; }
bool same_port(const PortFault& a, const PortFault& b) { return a.device == b.device && a.input == b.input && a.place == b.place; }
/// The two faults of one exchange.
bool are_swapped(const PortFault& a, const PortFault& b) {
  return a.device == b.device && a.input == b.input && a.swap >= 0 && a.swap == b.place && b.swap == a.place;
}

/// The device of a fault as it is now; null: it is gone.
const Device* device_of(const Simulation& sim, const PortFault& f) {
  const int i = sim.now().device[static_cast<std::size_t>(f.device)];
  return i < 0 ? nullptr : &sim.model().devices.all[static_cast<std::size_t>(i)];
}
int index_of(const Device& d, const PortFault& f) { return (f.input ? d.in : d.out) + f.place; }

/// Mass goes through it.
bool carries_mass(const Devices& all, const Device& d, const PortFault& f) {
  const auto flows = [&all](int output) { return std::ranges::find(all.flows, output, &MassFlow::output) != all.flows.end(); };
  if (!f.input) return flows(index_of(d, f));
  bool any = false;
  all.each_source(index_of(d, f), [&](int output) { any = any || flows(output); });
  return any;
}

}  // namespace

std::string Simulation::told_port(const PortFault& f) const {
  const Device* d = device_of(*this, f);
  return d ? fmt::format("{}.{}", d->name, port_at(*d->family, kind_of(f), f.place).name) : "a port of a device that is gone";
}

/// Of a device that was there once, and of its ports where it still is.
bool Simulation::is_of_a_port(const PortFault& f) const {
  if (f.device < 0 || f.device >= static_cast<int>(now_.device.size())) return false;
  const Device* d = device_of(*this, f);
  const int n = !d ? 0 : f.input ? d->n_in : d->n_out;
  return !d || (f.place >= 0 && f.place < n && f.swap >= -1 && f.swap < n);
}

std::string Simulation::told_fault(const PortFault& f) const {
  const Device* d = device_of(*this, f);
  const std::string port = d ? unit_where(turns(*model_, *d), port_at(*d->family, kind_of(f), f.place).unit) : "1";
  const std::string unit = port == "1" ? "" : " " + port;
  if (f.stuck) return f.value ? fmt::format("stuck at {:g}{}", *f.value, unit) : "stuck";
  if (f.swap >= 0) return "swapped with " + (d ? port_at(*d->family, kind_of(f), f.swap).name : std::string("a port that is gone"));
  std::string all;
  const auto add = [&all](const char* what, double x, double none, const std::string& in) {
    if (x != none) all += fmt::format("{}{} {:g}{}", all.empty() ? "" : ", ", what, x, in);
  };
  add("scale", f.scale, 1.0, ""), add("bias", f.bias, 0.0, unit), add("drift", f.drift, 0.0, port == "1" ? " 1/s" : unit + "/s");
  add("noise", f.noise, 0.0, unit), add("drop", f.drop, 0.0, ""), add("delay", f.delay, 0.0, " s");
  return all;
}

void Simulation::fault(PortFault f, const SourceMark& told) {
  if (within_.looks) refuse_inside();
  if (f.from == -std::numeric_limits<double>::infinity()) f.from = state_.t;
  require_index("device", f.device, static_cast<Eigen::Index>(now_.device.size()));
  const Device* d = device_of(*this, f);
  if (!d) refuse(Code::unknown_name, {"fault", told}, "a device of the vehicle as it is", "one that is gone");
  require_index(f.input ? "input" : "output", f.place, f.input ? d->n_in : d->n_out);
  const Located at{"fault of " + told_port(f), told};
  f.expect_good(at);
  if (f.from < state_.t)
    refuse(Code::out_of_range, {at.key_path + ".from", told}, fmt::format("a time [s] from now on, {:g} s", state_.t),
           fmt::format("{:g} s", f.from));
  f.from = std::max(state_.t, on_ticks(f.from)), f.until = on_ticks(f.until);
  if ((f.noise != 0.0 || f.drop != 0.0) && !d->family->tick)
    refuse(Code::out_of_range, {at.key_path + (f.noise != 0.0 ? ".noise" : ".drop"), told},
           "a device that samples: they are drawn at its ticks", fmt::format("{}, a {}, which does not", d->name, d->family->type));
  if (f.delay != 0.0 && (!d->family->tick || ticks_of_delay(*model_, *d, f.delay) == 0)) {
    const std::string ticks = d->family->tick ? fmt::format("a whole number of ticks of {}, {:g} s each, at most {}", d->name,
                                                            period_of(*model_, *d).value(), kMostTicks)
                                              : "a device that samples: values are kept at its ticks";
    refuse(Code::out_of_range, {at.key_path + ".delay", told}, ticks,
           d->family->tick ? fmt::format("{:g} s", f.delay) : fmt::format("{}, a {}, which does not", d->name, d->family->type));
  }
  PortFault other = f;
  if (f.swap >= 0) {
    require_index(f.input ? "input" : "output", f.swap, f.input ? d->n_in : d->n_out);
    std::swap(other.place, other.swap);
    const auto refuse_pair = [&](const char* expected, std::string got) {
      refuse(Code::out_of_range, {at.key_path + ".swap", told}, expected, std::move(got));
    };
    const auto unit = [&](int place) { return unit_where(turns(*model_, *d), port_at(*d->family, kind_of(f), place).unit); };
    const auto commanded = [&](const PortFault& of) { return model_->devices.is_commanded(index_of(*d, of)); };
    if (f.swap == f.place) refuse_pair("another port", "the same");
    if (unit(f.place) != unit(f.swap)) refuse_pair("a port of the same unit", fmt::format("{} and {}", unit(f.place), unit(f.swap)));
    if (f.input && commanded(f) != commanded(other)) refuse_pair("two inputs that are commanded, or two that are connected", "one of each");
  }
  for (const PortFault& of : {f, other})
    if (carries_mass(model_->devices, *d, of))
      refuse(Code::out_of_range, at, "a port that tells something", "one through which mass flows",
             "the mass would be lost on the way: the fault of the command of the thruster, or its `supply`, says what it may burn");
  if (!f.any()) return;
  faults_.push_back({f});
  if (f.swap >= 0) faults_.push_back({other});
  change_faults();
}

void Simulation::mend(int device, bool input, int place) {
  if (within_.looks) refuse_inside();
  const auto there = std::ranges::find_if(
      faults_, [&](const RunningFault& f) { return f.begun && same_port(f, {.device = device, .input = input, .place = place}); });
  if (there != faults_.end()) end_fault(there - faults_.begin());
}

void Simulation::end_fault(std::ptrdiff_t i) {
  const RunningFault ended = faults_[static_cast<std::size_t>(i)];
  std::erase_if(faults_, [&ended](const RunningFault& f) { return f.begun && (same_port(f, ended) || are_swapped(f, ended)); });
  alter_ports();
  renew(ended);
  if (recorder_ && begun_) recorder_->note(Note::event, state_.t, {told_port(ended), "mended"});
}

/// Those that are there give way to one that begins; of two ports that are swapped both.
void Simulation::make_way(const RunningFault& begun) {
  const auto before =
      std::ranges::find_if(faults_, [&begun](const RunningFault& f) { return f.begun && same_port(f, begun) && !are_swapped(f, begun); });
  if (before == faults_.end()) return;
  const RunningFault gone = *before;
  std::erase_if(faults_, [&gone](const RunningFault& f) { return f.begun && (same_port(f, gone) || are_swapped(f, gone)); });
}

/// Between steps: faults that begin or end now. One that begins takes the place of what is there.
void Simulation::change_faults() {
  const auto over = [this](const RunningFault& f) { return f.begun && f.until <= state_.t; };
  for (auto f = std::ranges::find_if(faults_, over); f != faults_.end(); f = std::ranges::find_if(faults_, over))
    end_fault(f - faults_.begin());
  const auto begins = [this](const RunningFault& f) { return !f.begun && f.from <= state_.t; };
  for (auto f = std::ranges::find_if(faults_, begins); f != faults_.end(); f = std::ranges::find_if(faults_, begins)) {
    double kept = f->value.value_or(0.0);
    if (const Device* d = device_of(*this, *f); d && !f->value)
      observe(), kept = f->input ? devices_->input(index_of(*d, *f)) : devices_->output(index_of(*d, *f));
    RunningFault begun = *f;
    begun.begun = true, begun.kept = kept;
    faults_.erase(f);
    make_way(begun);
    faults_.push_back(begun);
    alter_ports();
    if (const Device* d = device_of(*this, begun); d && begun.delay > 0.0) {  // until the first comes through, what it is now
      RunningFault& late = faults_.back();
      late.late = unaltered(index_of(*d, begun), begun.input);
      late.line.assign(static_cast<std::size_t>(ticks_of_delay(*model_, *d, begun.delay)), late.late);
      alter_ports();
    }
    renew(begun);
    if (recorder_ && begun_) recorder_->note(Note::event, state_.t, {told_port(begun), "fault: " + told_fault(begun)});
  }
}

void Simulation::begin_faults_anew() {
  for (RunningFault& f : faults_) f.begun = false;
  alter_ports();
}

double Simulation::next_fault() const {
  double t = std::numeric_limits<double>::infinity();
  for (const RunningFault& f : faults_) t = std::min(t, f.begun ? f.until : f.from);
  return t;
}

void Simulation::alter_ports() {
  if (!devices_) return;
  std::vector<AlteredPort> inputs, outputs;
  for (RunningFault& f : faults_)
    if (const Device* d = device_of(*this, f); d && f.begun) {
      f.key = noise_key(options_.seed, "fault of " + told_port(f));
      (f.input ? inputs : outputs).push_back(f.altered(index_of(*d, f)));
    }
  devices_->alter(std::move(inputs), std::move(outputs));
}

/// What a port gives is another number now.
void Simulation::renew(const PortFault& f) {
  const Device* d = device_of(*this, f);
  if (d && d->acts) return changed();
  observed_ = ledger_known_ = false;  // read anew; the motion goes on as it was
}

/// What a port gives without its own fault.
double Simulation::unaltered(int port, bool input) {
  devices_->alter(input, {port});
  observed_ = ledger_known_ = false;
  observe();
  return input ? devices_->input(port) : devices_->output(port);
}

/// Noise and losses of the ports of a device at its tick: of inputs before it, of outputs after it.
void Simulation::draw_faults(int index, bool inputs) {
  for (RunningFault& f : faults_) {
    const Device* d = device_of(*this, f);
    if (!d || !f.begun || (f.noise == 0.0 && f.drop == 0.0 && f.line.empty()) || d != &model_->devices.all[static_cast<std::size_t>(index)])
      continue;
    const int port = index_of(*d, f);
    if (f.input != inputs) {  // an output before the tick: what is lost leaves that
      if (inputs) observe(), f.kept = devices_->output(port);
      continue;
    }
    if (!f.line.empty()) f.pass(unaltered(port, f.input));
    double drawn[2];
    normal_noise(f.key, static_cast<std::uint64_t>(tick_), 2, drawn);
    f.drawn = f.noise * drawn[0];
    f.lost = std::erfc(-drawn[1] / std::numbers::sqrt2) < 2.0 * f.drop;
    devices_->alter(f.input, f.altered(port));
    renew(f);
    if (inputs && !f.lost) observe(), f.kept = devices_->input(port);
  }
}

}  // namespace cardan
