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

using soa::Tangent;

constexpr int kMotion = sizeof(cardan_mount_motion) / sizeof(double), kLoad = sizeof(cardan_mount_load) / sizeof(double);
double* numbers(cardan_mount_motion& m) { return reinterpret_cast<double*>(&m); }
const double* numbers(const cardan_mount_motion& m) { return reinterpret_cast<const double*>(&m); }
double* numbers(cardan_mount_load& l) { return reinterpret_cast<double*>(&l); }

/// put(mount, number of cardan_mount_motion, value): as these mounts move.
template <class T, class Mounts, class Put>
void hinge_motion_of(const soa::Inputs<T>& in, const Mounts& mounts, const Put& put) {
  for (const auto& m : mounts.hinges) put(m.mount, 18, m.q >= 0 ? in.q[m.q] : T(0.0)), put(m.mount, 19, in.v[m.v]);
}
/// What a function of a device says that returned a code.
std::string answer(const Device& d, const char* function, int code) {
  const char* why = d.family->explain ? d.family->explain(d.packed.data(), code) : nullptr;
  return why ? fmt::format("{}: {}", function, why) : fmt::format("{} returned {}", function, code);
}
template <class T, class Put>
void put_pose_and_velocity(const NodeMotion<T>& n, int mount, const Put& put) {
  const Mat3<T>& R = n.R_WN;
  const T all[18] = {R.xx,           R.xy,           R.xz,           R.yx,           R.yy,           R.yz,
                     R.zx,           R.zy,           R.zz,           n.position.x,   n.position.y,   n.position.z,
                     n.velocity.w.x, n.velocity.w.y, n.velocity.w.z, n.velocity.v.x, n.velocity.v.y, n.velocity.v.z};
  for (int i = 0; i < 18; ++i) put(mount, i, all[i]);
}
template <class T, class Mounts, class Put>
void motion_of(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, const Mounts& mounts, const Put& put) {
  hinge_motion_of(in, mounts, put);
  for (const auto& m : mounts.nodes) {
    const UserNode& node = model.nodes[m.node];
    put_pose_and_velocity(pose_and_velocity(ws, model.user[node.body].sweep, deformed(model, ws, node, in)), m.mount, put);
  }
}
/// With accelerations.
template <class T, class Mounts, class Put>
void accelerated_motion_of(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, const Mounts& mounts, const T* vdot,
                           After after, const Put& put) {
  hinge_motion_of(in, mounts, put);
  for (const auto& m : mounts.hinges) put(m.mount, 26, vdot[m.v]);
  for (const auto& m : mounts.nodes) {
    const NodeMotion<T> n = node_motion<T>(model, ws, in, m.node, vdot, after);
    put_pose_and_velocity(n, m.mount, put);
    const Vec3<T>&alpha = n.acceleration.w, &f = n.specific_force;
    const T more[6] = {alpha.x, alpha.y, alpha.z, f.x, f.y, f.z};
    for (int i = 0; i < 6; ++i) put(m.mount, 20 + i, more[i]);
  }
}

auto into(std::vector<cardan_mount_motion>& motions) {
  return [to = motions.data()](int mount, int i, double x) { numbers(to[mount])[i] = x; };
}
auto rates_into(std::vector<cardan_mount_motion>& motions) {
  return [to = motions.data()](int mount, int i, const Tangent& x) { numbers(to[mount])[i] = x.d; };
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
        double* R = motions_[mount].R_WN;
        if (d.family->mounts[i].kind == CARDAN_MOUNT_NODE) R[0] = R[4] = R[8] = 1.0;
        if (m.still) motions_[mount].q = m.still->q;
        continue;
      }
      if (m.node < 0) read.hinges.push_back({mount, m.q, m.v});
      if (m.node < 0 && pushes) pushed_.hinges.push_back({mount, m.q, m.v});
      if (m.node >= 0 && (m.use & (CARDAN_USE_POSE | CARDAN_USE_VELOCITY)) != 0) read.nodes.push_back({mount, m.node, m.load});
      if (m.node >= 0 && pushes) pushed_.nodes.push_back({mount, m.node, m.load});
      if (d.family->follow && m.node < 0) followed_.hinges.push_back({mount, m.q, m.v});
      if (d.family->follow && m.node >= 0) followed_.nodes.push_back({mount, m.node, m.load});
    }
    if (d.family->follow) following_.push_back(static_cast<int>(&d - all.all.data()));
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
  for (int k = call.altered_in.begin; k < call.altered_in.end; ++k) {
    double& x = in_[altered_in_[k].index];
    x = altered_in_[k](x, time());
  }
}

/// `out`: of all devices.
void DeviceForces::alter_outputs(const Call& call, double* out) const {
  for (int k = call.altered_out.begin; k < call.altered_out.end; ++k) {
    double& x = out[altered_out_[k].index];
    x = altered_out_[k](x, time());
  }
}

/// In this order; what they fill is zero.
bool DeviceForces::evaluate(const std::vector<Call>& calls, const std::vector<Range>& numbers) {
  for (const Range& r : commanded_) std::copy(commands.begin() + r.begin, commands.begin() + r.end, in_.begin() + r.begin);
  for (const AlteredPort& a : altered_commands_) in_[a.index] = a(in_[a.index], time());
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
      alter_outputs(*at, out_);
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
  for (const NodeMount& m : pushed_.nodes) {
    const cardan_mount_load& l = loads_[m.mount];
    state_.wrenches[m.load].f = {{l.moment[0], l.moment[1], l.moment[2]}, {l.force[0], l.force[1], l.force[2]}};
  }
  add_hinge_forces(state_.tau);
  if (flow_loads_.empty()) return true;
  std::ranges::fill(flow_loads_, Force<double>{});
  add_flow_forces(model_.devices, motions_.data(), out_, z_.data(), zdot_, marks_.data(), flow_loads_.data());
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
  for (const HingeMount& m : pushed_.hinges) tau[m.v] += loads_[m.mount].tau;
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
  for (const AlteredPort& a : altered_out_)
    if (a.index >= d.out && a.index < d.out + d.n_out) out.data()[a.index - d.out] = a(out.data()[a.index - d.out], time());
  if (code == 0 && same(loads, before, d.mounts.size() * kLoad) && same(out, out_ + d.out, d.n_out) &&
      (f.follow || same(zdot, zdot_ + d.z, f.n_states)) && o.delivered == outs_[index].delivered && o.lost == outs_[index].lost)
    return {};
  return "evaluate gives other numbers when it is asked the same again: it keeps something between calls";
}

std::size_t DeviceForces::bytes() const {
  return sizeof *this + fields_.bytes() + motions_.size() * sizeof motions_[0] + args_.size() * (sizeof args_[0] + sizeof outs_[0]) +
         (commands.size() + in_.size() + z_.size() + marks_.size() + effects_.size()) * sizeof(double);
}

DeviceTangents::DeviceTangents(const Model& model, const DeviceForces& base) : model_(model), base_(base), fields_(model) {
  const auto at = [](int n) { return static_cast<std::size_t>(n); };
  motions_.resize(base.motions_.size()), loads_.resize(base.motions_.size());
  commands.resize(base.in_.size()), in_.resize(base.in_.size()), out_.resize(at(model.devices.n_out));
  zdot_.resize(at(model.devices.n_z)), dz_.resize(at(model.devices.n_z));
  followed_motions_.resize(base.followed_motions_.size()), unused_.resize(base.following_.empty() ? 0 : at(model.devices.n_z));
}

namespace {
/// Rates of ports first ... first + n - 1.
void scale_altered(const std::vector<AlteredPort>& all, int first, int n, std::vector<double>& rates) {
  for (const AlteredPort& a : all)
    if (a.index >= first && a.index < first + n) rates[a.index] *= a.scale;
}
}  // namespace

void DeviceTangents::take_inputs(const Device& d) {
  for (int i = d.in; i < d.in + d.n_in; ++i) in_[i] = model_.devices.from[i] < 0 ? commands[i] : out_[model_.devices.from[i]];
  for (const AddedOutput& a : model_.devices.added)
    if (a.in >= d.in && a.in < d.in + d.n_in) in_[a.in] += out_[a.out];
  for (const std::vector<AlteredPort>* all : {&base_.altered_commands_, &base_.altered_in_}) scale_altered(*all, d.in, d.n_in, in_);
}

/// With the rates of its mounts, inputs and states as they are.
bool DeviceTangents::differentiate(int index) {
  const Device& d = model_.devices.all[index];
  std::memset(loads_.data() + d.mount, 0, d.mounts.size() * sizeof(cardan_mount_load));
  double* zdot = (d.family->follow ? unused_ : zdot_).data() + d.z;
  std::fill_n(zdot, d.family->n_states, 0.0);
  std::fill_n(out_.begin() + d.out, d.n_out, 0.0);
  const cardan_device_args at = base_.args_[index];
  cardan_device_args along = at;
  along.in = in_.data() + d.in, along.mount = motions_.data() + d.mount, along.z = dz_.data() + d.z;
  cardan_device_out out{zdot, out_.data() + d.out, loads_.data() + d.mount, 0.0, 0.0};
  const bool good = d.family->tangent ? d.family->tangent(&at, &along, &out) == 0 : by_differences(d, at, along, out);
  if (!good) fault_of_ = index;
  scale_altered(base_.altered_out_, d.out, d.n_out, out_);
  return good;
}

NumericsError DeviceTangents::fault() const {
  return NumericsError({.code = Code::device_failed,
                        .t = base_.time(),
                        .what = fmt::format("device {} has no derivative here", model_.devices.all[fault_of_].name),
                        .hint = "a point inside of its domain"});
}

/// d f(args) / ds, n numbers, of eighth order along the direction as a whole: what the device reads moves by a hundredth of its own size, a
/// state by that of its nominal. Nothing moves: 0.
template <class F>
void DeviceTangents::differences(const Device& d, const cardan_device_args& at, const cardan_device_args& along, std::size_t n, double* out,
                                 const F& f) {
  const auto n_mounts = d.mounts.size();
  const auto n_in = static_cast<std::size_t>(d.n_in), n_z = static_cast<std::size_t>(d.family->n_states);
  const std::size_t n_read = n_mounts * kMotion + n_in + n_z;
  scratch_.assign(3 * n_read + n, 0.0);
  double *x = scratch_.data(), *dx = x + n_read, *moved = dx + n_read, *work = moved + n_read;
  const auto gather = [&](const cardan_device_args& from, double* to) {
    if (n_mounts > 0) std::copy_n(numbers(*from.mount), n_mounts * kMotion, to);
    std::copy_n(from.in, n_in, to + n_mounts * kMotion);
    std::copy_n(from.z, n_z, to + n_mounts * kMotion + n_in);
  };
  gather(at, x), gather(along, dx);
  double rate = 0.0;  // largest rate over the size of what moves
  for (std::size_t i = 0; i < n_read; ++i) {
    const double size =
        i < n_mounts * kMotion + n_in ? std::max(1.0, std::abs(x[i])) : model_.devices.nominal[d.z + (i - n_mounts * kMotion - n_in)];
    rate = std::max(rate, std::abs(dx[i]) / size);
  }
  std::fill_n(out, n, 0.0);
  if (rate == 0.0) return;
  const auto there = [&](double s, double* to) {
    for (std::size_t i = 0; i < n_read; ++i) moved[i] = x[i] + s * dx[i];
    std::fill_n(to, n, 0.0);
    cardan_device_args beside = at;
    beside.mount = reinterpret_cast<const cardan_mount_motion*>(moved);
    beside.in = moved + n_mounts * kMotion, beside.z = beside.in + n_in;
    f(beside, to);
  };
  soa::derivative(there, 1e-2 / rate, static_cast<int>(n), out, work);
}

bool DeviceTangents::by_differences(const Device& d, const cardan_device_args& at, const cardan_device_args& along,
                                    cardan_device_out& out) {
  const std::size_t n_loads = d.mounts.size() * kLoad, n_out = static_cast<std::size_t>(d.n_out), n_z = d.family->n_states;
  rates_.resize(n_loads + n_out + n_z);
  bool good = true;
  differences(d, at, along, rates_.size(), rates_.data(), [&](const cardan_device_args& beside, double* to) {
    cardan_device_out there{to + n_loads + n_out, to + n_loads, reinterpret_cast<cardan_mount_load*>(to), 0.0, 0.0};
    good = good && d.family->evaluate(&beside, &there) == 0;
  });
  if (n_loads > 0) std::copy_n(rates_.data(), n_loads, numbers(*out.load));
  std::copy_n(rates_.data() + n_loads, n_out, out.out);
  std::copy_n(rates_.data() + n_loads + n_out, n_z, out.zdot);
  return good;
}

/// With the rates of its mounts and states as they are.
bool DeviceTangents::follow_along(int index) {
  const Device& d = model_.devices.all[index];
  cardan_device_args at = base_.followed(index), along = at;
  along.mount = followed_motions_.data() + d.mount, along.z = dz_.data() + d.z;
  bool good = true;
  if (d.family->follow_tangent) {
    good = d.family->follow_tangent(&at, &along, zdot_.data() + d.z) == 0;
    if (!good) fault_of_ = index;
    return good;
  }
  const std::vector<double> none(static_cast<std::size_t>(d.n_in));
  at.in = along.in = none.data();
  differences(d, at, along, d.family->n_states, zdot_.data() + d.z, [&](cardan_device_args beside, double* to) {
    beside.in = nullptr;
    good = good && d.family->follow(&beside, to) == 0;
  });
  if (!good) fault_of_ = index;
  return good;
}

bool DeviceTangents::follow(const soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in, const Tangent* vdot, After after) {
  accelerated_motion_of(model_, ws, in, base_.followed_, vdot, after, rates_into(followed_motions_));
  return std::ranges::all_of(base_.following_, [this](int device) { return follow_along(device); });
}

Vec3<Tangent> DeviceTangents::stored_momentum() {
  Vec3<Tangent> sum{Tangent(0.0), Tangent(0.0), Tangent(0.0)};
  for (std::size_t k = 0; k < model_.devices.all.size(); ++k) {
    const Device& d = model_.devices.all[k];
    if (!d.family->momentum) continue;
    const cardan_device_args at = base_.args_[k];
    cardan_device_args along = at;
    along.in = in_.data() + d.in, along.mount = motions_.data() + d.mount, along.z = dz_.data() + d.z;
    const std::size_t n = 3 * d.mounts.size();
    std::vector<double> h(n), dh(n);
    const auto tell = [&](const cardan_device_args& a, double* to) { d.family->momentum(&a, reinterpret_cast<double(*)[3]>(to)); };
    tell(at, h.data());
    differences(d, at, along, n, dh.data(), tell);
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      if (d.mounts[i].node < 0) continue;
      const double *R = base_.motions_[d.mount + i].R_WN, *dR = motions_[d.mount + i].R_WN;
      const auto entry = [&](int e) { return Tangent(R[e], dR[e]); };
      const auto part = [&](std::size_t e) { return Tangent(h[3 * i + e], dh[3 * i + e]); };
      sum += Mat3<Tangent>{entry(0), entry(1), entry(2), entry(3), entry(4), entry(5), entry(6), entry(7), entry(8)} *
             Vec3<Tangent>{part(0), part(1), part(2)};
    }
  }
  return sum;
}

bool DeviceTangents::complete(soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in) {
  motion_of(model_, ws, in, base_.between_, rates_into(motions_));
  fields_.look_along(base_.time(), false, base_.motions_, motions_);
  return std::ranges::all_of(base_.others_, [this](const DeviceForces::Call& c) {
    take_inputs(model_.devices.all[c.device]);
    return differentiate(c.device);
  });
}

bool DeviceTangents::act(soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in) {
  motion_of(model_, ws, in, base_.in_steps_, rates_into(motions_));
  for (int i = 0; only_ >= 0 && i < static_cast<int>(motions_.size()); ++i)
    if (i != only_) motions_[i] = {};
  fields_.look_along(base_.time(), true, base_.motions_, motions_);
  for (int i = 0; i < model_.devices.n_z; ++i) dz_[i] = state_.z[i].d;
  const auto good = [this](const DeviceForces::Call& c) {
    take_inputs(model_.devices.all[c.device]);
    return differentiate(c.device);
  };
  if (!std::ranges::all_of(base_.first_, good) || !std::ranges::all_of(base_.acting_, good)) return false;
  for (const DeviceForces::NodeMount& m : base_.pushed_.nodes) {
    const double *x = numbers(base_.loads_[m.mount]), *dx = numbers(loads_[m.mount]);
    const auto both = [&](int j) { return Tangent(x[j], dx[j]); };
    state_.wrenches[m.load].f = {{both(0), both(1), both(2)}, {both(3), both(4), both(5)}};
  }
  for (const DeviceForces::HingeMount& m : base_.pushed_.hinges)
    state_.tau[m.v].d += loads_[m.mount].tau;  // its value is in the base's tau
  if (!base_.flow_loads_.empty()) add_flows(in);
  return true;
}

RigidInertia<double> DeviceTangents::inertia_rate(int k) const {
  RigidInertia<double> sum{};
  const Devices& devices = model_.devices;
  for (const DeviceMass& own : devices.masses) {
    const UserBody& u = model_.user[own.user];
    if (u.sweep != k) continue;
    const Device& d = devices.all[own.device];
    const cardan_mass m = mass_of(d, base_.z_.data(), base_.marks_.data());
    const cardan_mass change = mass_rate(devices, d, base_.z_.data(), base_.marks_.data(), dz_.data());
    sum = sum + to_inboard(u.pose, cardan::inertia_rate(m, change));
  }
  return sum;
}

/// What flows pushes with, by differences of eighth order along the direction as a whole; and of the bodies whose mass varies what their
/// motion needs, as a load against it.
void DeviceTangents::add_flows(const soa::Inputs<Tangent>& in) {
  const Devices& devices = model_.devices;
  const auto n_loads = static_cast<std::size_t>(devices.n_loads);
  struct Pushed {
    const double *x, *dx;
    std::size_t n;
  };
  const auto count = [](const auto& all) { return all.size(); };
  const Pushed parts[] = {{numbers(base_.motions_[0]), numbers(motions_[0]), count(motions_) * kMotion},
                          {base_.out_, out_.data(), count(out_)},
                          {base_.z_.data(), dz_.data(), count(dz_)},
                          {base_.zdot_, zdot_.data(), count(zdot_)}};
  std::vector<double> moved, size;
  for (const Pushed& p : parts)
    for (std::size_t i = 0; i < p.n; ++i) size.push_back(p.x == base_.z_.data() ? devices.nominal[i] : std::max(1.0, std::abs(p.x[i])));
  moved.resize(size.size());
  double largest = 0.0;
  std::size_t at = 0;
  for (const Pushed& p : parts)
    for (std::size_t i = 0; i < p.n; ++i) largest = std::max(largest, std::abs(p.dx[i]) / size[at++]);
  std::vector<Force<double>> sum(n_loads), work(n_loads);
  if (largest > 0.0)
    soa::derivative(
        [&](double s, double* to) {
          std::size_t k = 0;
          const double* begin[4];
          for (std::size_t p = 0; p < 4; ++p) {
            begin[p] = moved.data() + k;
            for (std::size_t i = 0; i < parts[p].n; ++i) moved[k++] = parts[p].x[i] + s * parts[p].dx[i];
          }
          auto* loads = reinterpret_cast<Force<double>*>(to);
          std::fill_n(loads, n_loads, Force<double>{});
          add_flow_forces(devices, reinterpret_cast<const cardan_mount_motion*>(begin[0]), begin[1], begin[2], begin[3],
                          base_.marks_.data(), loads);
        },
        1e-2 / largest, static_cast<int>(6 * n_loads), &sum[0].n.x, &work[0].n.x);
  for (std::size_t i = 0; i < devices.masses.size(); ++i) {
    const DeviceMass& own = devices.masses[i];
    const UserBody& u = model_.user[own.user];
    if (u.sweep == 0) continue;
    const Device& d = devices.all[own.device];
    const cardan_mass m = mass_of(d, base_.z_.data(), base_.marks_.data());
    const cardan_mass change = mass_rate(devices, d, base_.z_.data(), base_.marks_.data(), dz_.data());
    const auto which = std::ranges::find(devices.varying, u.sweep, &VaryingBody::sweep) - devices.varying.begin();
    const RigidInertia<double> dM = to_inboard(u.pose, cardan::inertia_rate(m, change));
    const Force<double> f = force_of_inertia(model_, u.sweep, dM, base_.varying_[static_cast<std::size_t>(which)], in.gravity, in.moment);
    sum[d.mounts[own.mount].load] -= to_outboard(u.pose, f);
  }
  for (std::size_t i = 0; i < n_loads; ++i) {
    const double *x = &base_.flow_loads_[i].n.x, *dx = &sum[i].n.x;
    Tangent* to = &state_.wrenches[i].f.n.x;
    for (int j = 0; j < 6; ++j) to[j] = to[j] + Tangent(x[j], dx[j]);
  }
}

void DeviceTangents::state_matrix(int index, double* J) {
  const Device& d = model_.devices.all[index];
  const auto n = d.family->n_states;
  std::memset(motions_.data() + d.mount, 0, d.mounts.size() * sizeof(cardan_mount_motion));
  if (d.family->follow) std::memset(followed_motions_.data() + d.mount, 0, d.mounts.size() * sizeof(cardan_mount_motion));
  std::fill_n(in_.begin() + d.in, d.n_in, 0.0);
  for (std::uint32_t j = 0; j < n; ++j) {
    std::fill_n(dz_.begin() + d.z, n, 0.0);
    dz_[d.z + j] = 1.0;
    d.family->follow ? follow_along(index) : differentiate(index);
    std::copy_n(zdot_.begin() + d.z, n, J + j * n);
  }
}

}  // namespace cardan
