// Faults of ports in a run.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/abi/port_vectors.hpp"
#include "core/base/noise.hpp"
#include "core/sim/simulation.hpp"

namespace cardan {

namespace {

std::uint32_t kind_of(const PortFault& f) { return f.input ? CARDAN_PORT_IN : CARDAN_PORT_OUT; }
bool same_port(const PortFault& a, const PortFault& b) { return a.device == b.device && a.input == b.input && a.place == b.place; }

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

std::string Simulation::told_fault(const PortFault& f) const {
  const Device* d = device_of(*this, f);
  const std::string port = d ? port_at(*d->family, kind_of(f), f.place).unit : "1", unit = port == "1" ? "" : " " + port;
  if (f.stuck) return f.value ? fmt::format("stuck at {:g}{}", *f.value, unit) : "stuck";
  std::string all;
  const auto add = [&all](const char* what, double x, double none, const std::string& in) {
    if (x != none) all += fmt::format("{}{} {:g}{}", all.empty() ? "" : ", ", what, x, in);
  };
  add("scale", f.scale, 1.0, ""), add("bias", f.bias, 0.0, unit), add("drift", f.drift, 0.0, port == "1" ? " 1/s" : unit + "/s");
  add("noise", f.noise, 0.0, unit), add("drop", f.drop, 0.0, "");
  return all;
}

void Simulation::fault(PortFault f, const SourceMark& told) {
  if (inside_) refuse_inside();
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
  if ((f.noise != 0.0 || f.drop != 0.0) && !d->family->tick)
    refuse(Code::out_of_range, {at.key_path + (f.noise != 0.0 ? ".noise" : ".drop"), told},
           "a device that samples: they are drawn at its ticks", fmt::format("{}, a {}, which does not", d->name, d->family->type));
  if (carries_mass(model_->devices, *d, f))
    refuse(Code::out_of_range, at, "a port that tells something", "one through which mass flows",
           "the mass would be lost on the way: the fault of the command of the thruster, or its `supply`, says what it may burn");
  if (!f.any()) return;
  faults_.push_back({f});
  change_faults();
}

void Simulation::mend(int device, bool input, int place) {
  if (inside_) refuse_inside();
  const auto there = std::ranges::find_if(
      faults_, [&](const RunningFault& f) { return f.begun && same_port(f, {.device = device, .input = input, .place = place}); });
  if (there != faults_.end()) end_fault(there - faults_.begin());
}

void Simulation::end_fault(std::ptrdiff_t i) {
  const RunningFault ended = faults_[static_cast<std::size_t>(i)];
  faults_.erase(faults_.begin() + i);
  alter_ports();
  renew(ended);
  if (recorder_ && begun_) recorder_->note(Note::event, state_.t, {told_port(ended), "mended"});
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
    std::erase_if(faults_, [&begun](const RunningFault& other) { return other.begun && same_port(other, begun); });
    faults_.push_back(begun);
    alter_ports();
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

/// Noise and losses of the ports of a device at its tick: of inputs before it, of outputs after it.
void Simulation::draw_faults(int index, bool inputs) {
  for (RunningFault& f : faults_) {
    const Device* d = device_of(*this, f);
    if (!d || !f.begun || (f.noise == 0.0 && f.drop == 0.0) || d != &model_->devices.all[static_cast<std::size_t>(index)]) continue;
    const int port = index_of(*d, f);
    if (f.input != inputs) {  // an output before the tick: what is lost leaves that
      if (inputs) observe(), f.kept = devices_->output(port);
      continue;
    }
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
