#include "core/dynamics/devices.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/abi/law_tools.hpp"
#include "core/abi/port_vectors.hpp"
#include "core/base/finite.hpp"
#include "core/soa/program.hpp"

namespace cardan {
namespace {

using namespace device_mounts;

/// What a function of a device says that returned a code.
std::string answer(const Device& d, const char* function, int code) {
  const char* why = d.family->explain ? d.family->explain(d.packed.data(), code) : nullptr;
  return why ? fmt::format("{}: {}", function, why) : fmt::format("{} returned {}", function, code);
}
auto into(std::vector<cardan_mount_motion>& motions) {
  return [to = motions.data()](int mount, int i, double x) { numbers(to[mount])[i] = x; };
}
}  // namespace

DeviceForces::DeviceForces(const Model& model, Model* own) : commands(model.devices.in0), model_(model), own_(own), fields_(model) {
  const Devices& all = model.devices;
  const auto at = [](int n) { return static_cast<std::size_t>(n); };
  motions_.resize(at(all.n_mounts)), in_ = commands, z_.resize(at(all.n_z)), marks_.resize(at(all.n_marks));
  effects_.resize(at(all.n_mounts * kLoad + all.n_z + all.n_out));
  loads_ = reinterpret_cast<cardan_mount_load*>(effects_.data());
  zdot_ = effects_.data() + all.n_mounts * kLoad, out_ = zdot_ + all.n_z;
  if (!all.masses.empty()) flow_loads_.resize(at(all.n_loads)), varying_.resize(all.varying.size());
  std::vector<int> begins, begin_added;  // of the connected inputs of a device
  for (const Device& d : all.all) {
    args_.push_back({sizeof(cardan_device_args), 0.0, d.packed.data(), in_.data() + d.in, motions_.data() + d.mount, z_.data() + d.z,
                     marks_.data() + d.mark});
    outs_.push_back({zdot_ + d.z, out_ + d.out, loads_ + d.mount, 0.0, 0.0});
    begins.push_back(static_cast<int>(given_.size())), begin_added.push_back(static_cast<int>(added_.size()));
    for (const AddedOutput& a : all.added)
      if (a.in >= d.in && a.in < d.in + d.n_in) added_.push_back(a);
    for (int i = d.in; i < d.in + d.n_in; ++i)
      if (all.from[i] >= 0)
        given_.push_back({i, all.from[i]});
      else if (!commanded_.empty() && commanded_.back().end == i)
        ++commanded_.back().end;
      else
        commanded_.push_back({i, i + 1});
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      const DeviceMount& m = d.mounts[i];
      const int mount = d.mount + static_cast<int>(i);
      Mounts& read = d.acts && (m.use & CARDAN_USE_ACCELERATION) == 0 ? in_steps_ : between_;
      const bool pushes = (m.use & CARDAN_USE_LOAD) != 0;
      if (m.v < 0 && m.node < 0) {  // a field, the ground, or a hinge that is held or gone
        if (d.family->mounts[i].kind == CARDAN_MOUNT_NODE)
          put_pose_and_velocity<double>({m.ground.R, m.ground.p, {}, {}, {}}, mount, into(motions_));
        if (m.still) motions_[mount].q = m.still->q;
        continue;
      }
      if (m.node < 0) read.hinges.push_back({mount, m.q, m.v});
      if (m.node < 0 && pushes) pushed_.hinges.push_back({mount, m.q, m.v});
      if (m.node >= 0 && (m.use & (CARDAN_USE_POSE | CARDAN_USE_VELOCITY)) != 0) read.nodes.push_back({mount, m.node, m.load, &m});
      if (m.node >= 0 && pushes) pushed_.nodes.push_back({mount, m.node, m.load, &m});
      if (d.family->follow && m.node < 0) followed_.hinges.push_back({mount, m.q, m.v});
      if (d.family->follow && m.node >= 0) followed_.nodes.push_back({mount, m.node, m.load, &m});
    }
    if (!d.family->follow) continue;
    following_.push_back(static_cast<int>(&d - all.all.data()));
    felt_.resize(std::max(felt_.size(), 2 * std::size_t{d.family->n_states}));
  }
  if (!following_.empty()) followed_motions_ = motions_;
  begins.push_back(static_cast<int>(given_.size())), begin_added.push_back(static_cast<int>(added_.size()));
  const auto call = [&](int i) {
    const Range given{begins[i], begins[i + 1]}, added{begin_added[i], begin_added[i + 1]};
    const bool connected = given.begin < given.end || added.begin < added.end;
    return Call{all.all[i].family->evaluate, &args_[at(i)], &outs_[at(i)], i, connected, given, added};
  };
  for (const int i : all.first) (all.all[i].acts ? first_ : others_).push_back(call(i));
  for (const int i : all.order) (all.all[i].acts ? acting_ : others_).push_back(call(i));
  // In effects_ the loads of all come first, then their z', then their outputs.
  const auto add = [this](bool acts, int begin, int n) {
    std::vector<Range>& to = acts ? acting_numbers_ : other_numbers_;
    if (!to.empty() && to.back().end == begin)
      to.back().end += n;
    else if (n > 0)
      to.push_back({begin, begin + n});
  };
  for (const Device& d : all.all) add(d.acts, d.mount * kLoad, static_cast<int>(d.mounts.size()) * kLoad);
  for (const Device& d : all.all)
    if (!d.family->follow) add(d.acts, all.n_mounts * kLoad + d.z, static_cast<int>(d.family->n_states));
  for (const Device& d : all.all) add(d.acts, all.n_mounts * kLoad + all.n_z + d.out, d.n_out);
}

DeviceForces::DeviceForces(const DeviceForces& other) : DeviceForces(other.model_) {
  take_commands(other);
  motions_ = other.motions_, in_ = other.in_, z_ = other.z_, marks_ = other.marks_, effects_ = other.effects_;
  flow_loads_ = other.flow_loads_, varying_ = other.varying_, followed_motions_ = other.followed_motions_;
  for (std::size_t k = 0; k < args_.size(); ++k) {
    args_[k].t = other.args_[k].t;
    outs_[k].delivered = other.outs_[k].delivered, outs_[k].lost = other.outs_[k].lost;
  }
}

void DeviceForces::alter(std::vector<AlteredPort> inputs, std::vector<AlteredPort> outputs) {
  std::ranges::sort(inputs, {}, &AlteredPort::index), std::ranges::sort(outputs, {}, &AlteredPort::index);
  const auto commanded = [this](const AlteredPort& a) { return model_.devices.from[a.index] < 0; };
  altered_commands_.clear(), altered_in_.clear();
  std::ranges::partition_copy(inputs, std::back_inserter(altered_commands_), std::back_inserter(altered_in_), commanded);
  altered_out_ = std::move(outputs);
  const auto of = [](const std::vector<AlteredPort>& all, int first, int n) {
    const auto at = [&](int index) {
      return static_cast<int>(std::ranges::lower_bound(all, index, {}, &AlteredPort::index) - all.begin());
    };
    return Range{at(first), at(first + n)};
  };
  for (std::vector<Call>* calls : {&first_, &acting_, &others_})
    for (Call& c : *calls) {
      const Device& d = model_.devices.all[c.device];
      c.altered_in = of(altered_in_, d.in, d.n_in), c.altered_out = of(altered_out_, d.out, d.n_out);
    }
}

void DeviceForces::alter(bool input, const AlteredPort& port) {
  auto& all = !input ? altered_out_ : model_.devices.from[port.index] < 0 ? altered_commands_ : altered_in_;
  *std::ranges::find(all, port.index, &AlteredPort::index) = port;
}

void DeviceForces::take_commands(const DeviceForces& other) {
  commands = other.commands;
  if (altered_commands_.empty() && altered_in_.empty() && altered_out_.empty() && other.altered_commands_.empty() &&
      other.altered_in_.empty() && other.altered_out_.empty())
    return;
  std::vector<AlteredPort> inputs = other.altered_commands_;
  inputs.insert(inputs.end(), other.altered_in_.begin(), other.altered_in_.end());
  alter(std::move(inputs), other.altered_out_);
}

bool DeviceForces::look_at_fields(bool in_steps) {
  if (fields_.empty()) return true;
  FieldFault fault;
  if (fields_.look(time(), in_steps, motions_, fault)) return true;
  fault_ = {fault.device, std::move(fault.what)};
  return false;
}

void DeviceForces::set(const DeviceState<double>& state) {
  state_ = state;
  std::copy_n(state.z, z_.size(), z_.begin());
  std::copy_n(state.marks, marks_.size(), marks_.begin());
  for (cardan_device_args& a : args_) a.t = state.t;
  weigh_again();
}

void DeviceForces::weigh_again() {
  if (own_) mass_fault_ = own_->weigh(z_.data(), marks_.data(), mass_fault_of_);
}

void DeviceForces::look_at(const DeviceForces& known, Workspace* ws, const Inputs& in) {
  std::ranges::copy(known.in_, in_.begin());
  if (!ws) {
    hinge_motion_of(in, in_steps_, into(motions_));
    look_at_fields(true);
    return;
  }
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  ws->articulated = false;
  S.ground(model_, *ws, in);
  soa::run_kinematics<double>(model_, S, *ws, in);
  motion_of(model_, *ws, in, in_steps_, into(motions_));
  look_at_fields(true);  // where it cannot, the step tells
}

void DeviceForces::zero(const std::vector<Range>& numbers) {
  for (const Range& r : numbers) std::fill(effects_.begin() + r.begin, effects_.begin() + r.end, 0.0);
}

void DeviceForces::zero(int index) {
  const Device& d = model_.devices.all[index];
  std::fill_n(loads_ + d.mount, d.mounts.size(), cardan_mount_load{});
  if (!d.family->follow) std::fill_n(zdot_ + d.z, d.family->n_states, 0.0);
  std::fill_n(out_ + d.out, d.n_out, 0.0);
}

void DeviceForces::take_connected(const Call& call) {
  for (int k = call.given.begin; k < call.given.end; ++k) in_[given_[k].first] = out_[given_[k].second];
  for (int k = call.added.begin; k < call.added.end; ++k) in_[added_[k].in] += out_[added_[k].out];
  alter_ports(part(altered_in_, call.altered_in), in_.data(), time());
}

/// In this order; what they fill is zero.
bool DeviceForces::evaluate(const std::vector<Call>& calls, const std::vector<Range>& numbers) {
  for (const Range& r : commanded_) std::copy(commands.begin() + r.begin, commands.begin() + r.end, in_.begin() + r.begin);
  alter_ports(altered_commands_, in_.data(), time());
  std::uint64_t power = 0;
  const bool filled = !first_.empty();  // what a device gave before all others is there until now
  const Call* at = calls.data();
  try {
    for (const Call* const end = at + calls.size(); at != end; ++at) {
      if (at->connected) take_connected(*at);
      if (filled) zero(at->device);
      cardan_device_out& out = *at->out;
      out.delivered = out.lost = 0.0;
      if (const int code = at->evaluate(at->args, &out); code != 0) {
        for (const Call* before = calls.data(); before != at; ++before)
          if (!expect_finite(before->device)) return false;  // what the one that refuses may have been given
        fault_ = {at->device, answer(model_.devices.all[at->device], "evaluate", code)};
        return false;
      }
      power |= not_finite_bit(out.delivered) | not_finite_bit(out.lost);
      alter_ports(part(altered_out_, at->altered_out), out_, time());
    }
  } catch (...) {
    called_ = {at->device, "evaluate"};
    throw;
  }
  const auto finite = [this](const Range& r) { return all_finite(effects_.data() + r.begin, r.end - r.begin); };
  if (power >> 63 == 0 && std::ranges::all_of(numbers, finite)) return true;
  return std::ranges::all_of(calls, [this](const Call& c) { return expect_finite(c.device); });
}

bool DeviceForces::evaluate_acting() {
  fault_.device = -1;
  zero(acting_numbers_);
  return evaluate(first_, {}) && evaluate(acting_, acting_numbers_);
}

bool DeviceForces::evaluate_others() {
  zero(other_numbers_);
  return evaluate(others_, other_numbers_);
}

bool DeviceForces::evaluate() { return evaluate_acting() && evaluate_others(); }

bool DeviceForces::complete(Workspace& ws, const Inputs& in) {
  motion_of(model_, ws, in, between_, into(motions_));
  const auto passed = [this] {
    const FieldFault* limit = fields_.passed_limit();
    if (limit) fault_ = {limit->device, limit->what};
    return limit != nullptr;
  };
  return !passed() && look_at_fields(false) && !passed() && evaluate_others();
}

bool DeviceForces::act(Workspace& ws, const Inputs& in) {
  motion_of(model_, ws, in, in_steps_, into(motions_));
  if (!mass_fault_.empty()) {
    fault_ = {mass_fault_of_, mass_fault_};
    return false;
  }
  if (!look_at_fields(true) || !evaluate_acting()) return false;
  for (const Mounts::OnNode& m : pushed_.nodes) {
    const cardan_mount_load& l = loads_[m.mount];
    state_.wrenches[m.load].f = {{l.moment[0], l.moment[1], l.moment[2]}, {l.force[0], l.force[1], l.force[2]}};
  }
  add_hinge_forces(state_.tau);
  if (flow_loads_.empty()) return true;
  std::ranges::fill(flow_loads_, Force<double>{});
  add_flow_forces(model_.devices, {motions_.data(), out_, z_.data(), zdot_}, marks_.data(), flow_loads_.data());
  for (std::size_t i = 0; i < flow_loads_.size(); ++i) state_.wrenches[i].f += flow_loads_[i];
  return true;
}

cardan_device_args DeviceForces::followed(int device) const {
  cardan_device_args a = args_[device];
  a.in = a.d = nullptr;
  a.mount = followed_motions_.data() + model_.devices.all[device].mount;
  return a;
}

bool DeviceForces::follow(const Workspace& ws, const Inputs& in, const double* vdot, After after) {
  for (std::size_t i = 0; i < varying_.size(); ++i) {
    const int k = model_.devices.varying[i].sweep;
    varying_[i] = {motion_of_body<double>(model_, ws, in, k, nullptr, after), ws.pose_W(k)};
  }
  if (following_.empty() || !all_finite(vdot, model_.nv)) return true;  // that is told of v' itself
  accelerated_motion_of(model_, ws, in, followed_, vdot, after, into(followed_motions_));
  for (const int i : following_) {
    const Device& d = model_.devices.all[i];
    const cardan_device_args at = followed(i);
    called_ = {i, "follow"};
    if (const int code = d.family->follow(&at, zdot_ + d.z); code != 0) {
      fault_ = {i, answer(d, "follow", code)};
      return false;
    }
    if (!expect_finite(i)) return false;
  }
  called_.device = -1;
  return true;
}

Vec3<double> DeviceForces::stored_momentum() const {
  Vec3<double> sum{};
  for (std::size_t k = 0; k < args_.size(); ++k) {
    const Device& d = model_.devices.all[k];
    if (!d.family->momentum) continue;
    stored_.assign(d.mounts.size(), {});
    called_ = {static_cast<int>(k), "momentum"};
    d.family->momentum(&args_[k], reinterpret_cast<double(*)[3]>(stored_.data()));
    for (std::size_t i = 0; i < stored_.size(); ++i) {
      const double* R = motions_[d.mount + i].R_WN;
      if (d.mounts[i].node >= 0) sum += Mat3<double>{R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]} * stored_[i];
    }
  }
  called_.device = -1;
  return sum;
}

Force<double> DeviceForces::storing_loads() const {
  Force<double> sum{};
  for (const Device& d : model_.devices.all)
    for (std::size_t i = 0; d.family->momentum && i < d.mounts.size(); ++i) {
      if (d.mounts[i].node < 0 || (d.mounts[i].use & CARDAN_USE_LOAD) == 0) continue;
      const cardan_mount_motion& m = motions_[d.mount + i];
      const cardan_mount_load& l = loads_[d.mount + i];
      const double* R = m.R_WN;
      const Pose<double> N{{R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]}, {m.position[0], m.position[1], m.position[2]}};
      sum += to_inboard(N, Force<double>{{l.moment[0], l.moment[1], l.moment[2]}, {l.force[0], l.force[1], l.force[2]}});
    }
  return sum;
}

void DeviceForces::add_hinge_forces(double* tau) const {
  for (const Mounts::OnHinge& m : pushed_.hinges) tau[m.v] += loads_[m.mount].tau;
}

namespace {
/// Of number i of all loads of a device.
std::string load_name(const Device& d, int i) {
  return fmt::format("{} at {}",
                     i % kLoad < 3   ? "moment"
                     : i % kLoad < 6 ? "force"
                                     : "force of the hinge",
                     d.family->mounts[i / kLoad].name);
}
}  // namespace

bool DeviceForces::expect_finite(int index) {
  const Device& d = model_.devices.all[index];
  const auto n_loads = static_cast<int>(d.mounts.size()) * kLoad;
  const auto n_z = static_cast<int>(d.family->n_states);
  const double* loads = d.mounts.empty() ? nullptr : numbers(loads_[d.mount]);
  if (all_finite(zdot_ + d.z, n_z) && all_finite(out_ + d.out, d.n_out) && all_finite(loads, n_loads) &&
      std::isfinite(outs_[index].delivered) && std::isfinite(outs_[index].lost))
    return true;
  const char* call = !is_of_plugin(d.origin) ? "" : d.family->follow && !all_finite(zdot_ + d.z, n_z) ? "follow: " : "evaluate: ";
  fault_ = {index, fmt::format("{}its power is not finite", call)};
  const auto tell = [&](const double* x, int n, const auto& name) {
    if (all_finite(x, n)) return false;
    const int i = first_not_finite(x, n);
    fault_.what = fmt::format("{}{} = {}", call, name(i), x[i]);
    return true;
  };
  const auto port = [&](int i) { return fmt::format("output {}", port_at(*d.family, CARDAN_PORT_OUT, i).name); };
  if (!tell(loads, n_loads, [&](int i) { return load_name(d, i); }) && !tell(out_ + d.out, d.n_out, port))
    tell(zdot_ + d.z, n_z, [&](int i) { return fmt::format("rate of {}", d.family->states[i].name); });
  return false;
}

double DeviceForces::energy() const {
  double sum = 0.0;
  for (std::size_t k = 0; k < args_.size(); ++k) {
    const cardan_device_family& family = *model_.devices.all[k].family;
    if ((family.facts & CARDAN_FACT_ENERGY) == 0) continue;
    called_ = {static_cast<int>(k), "energy"};
    sum += family.energy(&args_[k]);
  }
  called_.device = -1;
  return sum;
}

double DeviceForces::unseen_power() const {
  double sum = 0.0;
  for (std::size_t k = 0; k < model_.devices.all.size(); ++k) {
    const Device& d = model_.devices.all[k];
    if ((d.family->facts & CARDAN_FACT_ENERGY) == 0) continue;
    sum += outs_[k].delivered - outs_[k].lost;
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      if ((d.mounts[i].use & CARDAN_USE_LOAD) == 0) continue;
      const cardan_mount_motion& m = motions_[d.mount + i];
      const cardan_mount_load& l = loads_[d.mount + i];
      if (d.mounts[i].node < 0) sum -= l.tau * m.v;
      for (int j = 0; d.mounts[i].node >= 0 && j < 3; ++j) sum -= l.moment[j] * m.omega[j] + l.force[j] * m.velocity[j];
    }
  }
  return sum;
}

void DeviceForces::roots(double* g) const {
  for (std::size_t k = 0; k < args_.size(); ++k) {
    const Device& d = model_.devices.all[k];
    if (d.family->n_roots == 0) continue;
    called_ = {static_cast<int>(k), "roots"};
    d.family->roots(&args_[k], g + d.root);
  }
  called_.device = -1;
}

void DeviceForces::event(int device, std::uint32_t root, int direction, double* z, double* marks) const {
  const Device& d = model_.devices.all[device];
  if (!d.family->event) return;
  called_ = {device, "event"};
  d.family->event(&args_[device], root, direction, z + d.z, marks + d.mark);
  called_.device = -1;
}

bool DeviceForces::feel(int index, std::span<cardan_mount_motion> mounts, double* z) {
  const Device& d = model_.devices.all[index];
  const int n = static_cast<int>(d.family->n_states);
  double *const with = felt_.data(), *const without = with + n;
  cardan_device_args args = args_[index];
  args.in = args.d = nullptr, args.mount = mounts.data(), args.z = z + d.z;
  called_ = {index, "follow"};
  int code = d.family->follow(&args, with);
  for (cardan_mount_motion& m : mounts) std::fill_n(m.alpha, 3, 0.0), std::fill_n(m.specific_force, 3, 0.0), m.vdot = 0.0;
  if (code == 0) code = d.family->follow(&args, without);
  called_.device = -1;
  if (code != 0) {
    fault_ = {index, answer(d, "follow", code)};
    return false;
  }
  for (int i = 0; i < n; ++i) z[d.z + i] += with[i] - without[i];
  if (all_finite(z + d.z, n)) return true;
  fault_ = {index, fmt::format("follow: a jump makes {} = {}", d.family->states[first_not_finite(z + d.z, n)].name,
                               z[d.z + first_not_finite(z + d.z, n)])};
  return false;
}

bool DeviceForces::tick(int index, double period, const double* noise, double* z, double* marks) {
  const Device& d = model_.devices.all[index];
  called_ = {index, "tick"};
  const int code = d.family->tick(&args_[index], period, noise, z + d.z, marks + d.mark);
  called_.device = -1;
  for (std::size_t i = 0; i < d.mounts.size(); ++i) {
    cardan_mount_motion& m = motions_[d.mount + i];
    std::fill_n(m.alpha, 3, 0.0), std::fill_n(m.specific_force, 3, 0.0), m.vdot = 0.0;
  }
  const auto n_z = static_cast<int>(d.family->n_states), n_marks = static_cast<int>(d.family->n_marks);
  if (code != 0)
    fault_ = {index, answer(d, "tick", code)};
  else if (!all_finite(z + d.z, n_z))
    fault_ = {index, fmt::format("tick sets {} = {}", d.family->states[first_not_finite(z + d.z, n_z)].name,
                                 z[d.z + first_not_finite(z + d.z, n_z)])};
  else if (!all_finite(marks + d.mark, n_marks))
    fault_ = {index, fmt::format("tick sets {} = {}", d.family->marks[first_not_finite(marks + d.mark, n_marks)].name,
                                 marks[d.mark + first_not_finite(marks + d.mark, n_marks)])};
  else
    return true;
  return false;
}

bool DeviceForces::impulse(int index, std::uint32_t cause, int direction, std::vector<cardan_mount_load>& loads) {
  const Device& d = model_.devices.all[index];
  loads.assign(d.mounts.size(), {});
  called_ = {index, "impulse"};
  const int code = d.family->impulse(&args_[index], cause, direction, loads.data());
  called_.device = -1;
  if (code != 0) {
    fault_ = {index, answer(d, "impulse", code)};
    return false;
  }
  const int n = static_cast<int>(loads.size()) * kLoad;
  if (all_finite(numbers(*loads.data()), n)) return true;
  const int i = first_not_finite(numbers(*loads.data()), n);
  fault_ = {index, fmt::format("impulse: {} = {}", load_name(d, i), numbers(*loads.data())[i])};
  return false;
}

std::string DeviceForces::ask_again(int index) const {
  const Device& d = model_.devices.all[index];
  const cardan_device_family& f = *d.family;
  Handed loads(d.mounts.size() * kLoad), out(d.n_out), zdot(f.n_states);
  const auto clear = [](Handed& a, std::size_t n) { std::fill_n(a.data(), n, 0.0); };
  clear(loads, d.mounts.size() * kLoad), clear(out, d.n_out), clear(zdot, f.n_states);
  cardan_device_out o{zdot.data(), out.data(), reinterpret_cast<cardan_mount_load*>(loads.data()), 0.0, 0.0};
  called_ = {index, "evaluate"};
  const int code = f.evaluate(&args_[index], &o);
  called_.device = -1;
  if (!loads.intact() || !out.intact() || !zdot.intact()) return "evaluate writes beyond its arrays";
  const auto same = [](const Handed& a, const double* b, std::size_t n) { return n == 0 || std::memcmp(a.data(), b, n * sizeof *b) == 0; };
  const double* before = d.mounts.empty() ? nullptr : numbers(loads_[d.mount]);
  std::vector<AlteredPort> altered;
  for (AlteredPort a : altered_out_) {
    if (a.index < d.out || a.index >= d.out + d.n_out) continue;
    a.index -= d.out;
    altered.push_back(a);
  }
  alter_ports(altered, out.data(), time());
  if (code == 0 && same(loads, before, d.mounts.size() * kLoad) && same(out, out_ + d.out, d.n_out) &&
      (f.follow || same(zdot, zdot_ + d.z, f.n_states)) && o.delivered == outs_[index].delivered && o.lost == outs_[index].lost)
    return {};
  return "evaluate gives other numbers when it is asked the same again: it keeps something between calls";
}

std::size_t DeviceForces::bytes() const {
  return sizeof *this + fields_.bytes() + motions_.size() * sizeof motions_[0] + args_.size() * (sizeof args_[0] + sizeof outs_[0]) +
         (commands.size() + in_.size() + z_.size() + marks_.size() + effects_.size()) * sizeof(double);
}

}  // namespace cardan
