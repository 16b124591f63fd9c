#include "core/dynamics/devices.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/base/finite.hpp"
#include "core/dynamics/node_motion.hpp"
#include "core/soa/program.hpp"

namespace cardan {
namespace {

using soa::Tangent;

constexpr int kMotion = sizeof(cardan_mount_motion) / sizeof(double), kLoad = sizeof(cardan_mount_load) / sizeof(double);
double* numbers(cardan_mount_motion& m) { return reinterpret_cast<double*>(&m); }
const double* numbers(const cardan_mount_motion& m) { return reinterpret_cast<const double*>(&m); }
double* numbers(cardan_mount_load& l) { return reinterpret_cast<double*>(&l); }
const double* numbers(const cardan_mount_load& l) { return reinterpret_cast<const double*>(&l); }

/// put(number of cardan_mount_motion, value): as a mount moves.
template <class T, class Put>
void motion_of(const Model& model, const soa::Workspace<T>& ws, const soa::Inputs<T>& in, const DeviceMount& m, const Put& put) {
  if (m.node < 0) {
    put(18, m.q >= 0 ? in.q[m.q] : T(0.0));
    put(19, in.v[m.v]);
    return;
  }
  if ((m.use & (CARDAN_USE_POSE | CARDAN_USE_VELOCITY)) == 0) return;
  const NodeMotion<T> n = node_motion<T>(model, ws, in, m.node, nullptr);
  const Mat3<T>& R = n.R_WN;
  const T all[18] = {R.xx,           R.xy,           R.xz,           R.yx,           R.yy,           R.yz,
                     R.zx,           R.zy,           R.zz,           n.position.x,   n.position.y,   n.position.z,
                     n.velocity.w.x, n.velocity.w.y, n.velocity.w.z, n.velocity.v.x, n.velocity.v.y, n.velocity.v.z};
  for (int i = 0; i < 18; ++i) put(i, all[i]);
}

}  // namespace

DeviceForces::DeviceForces(const Model& model) : commands(model.devices.in0), model_(model) {
  const Devices& all = model.devices;
  const auto at = [](int n) { return static_cast<std::size_t>(n); };
  motions_.resize(at(all.n_mounts)), loads_.resize(at(all.n_mounts));
  in_ = commands, out_.resize(at(all.n_out)), zdot_.resize(at(all.n_z)), z_.resize(at(all.n_z)), marks_.resize(at(all.n_marks));
  delivered_.resize(all.all.size()), lost_.resize(all.all.size());
  for (const int i : all.first) (all.all[i].acts ? first_ : others_).push_back(i);
  for (const int i : all.order) (all.all[i].acts ? acting_ : others_).push_back(i);
}

void DeviceForces::look(Workspace& ws, const Inputs& in, bool acting) {
  for (const Device& d : model_.devices.all)
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      const bool in_steps = d.acts && (d.mounts[i].use & CARDAN_USE_ACCELERATION) == 0;
      if (in_steps != acting) continue;
      double* to = numbers(motions_[d.mount + i]);
      motion_of<double>(model_, ws, in, d.mounts[i], [&](int at, double x) { to[at] = x; });
    }
}

void DeviceForces::set(const DeviceState<double>& state) {
  state_ = state;
  std::copy_n(state.z, z_.size(), z_.begin());
  std::copy_n(state.marks, marks_.size(), marks_.begin());
}

void DeviceForces::look_at(const DeviceForces& known, Workspace* ws, const Inputs& in) {
  in_ = known.in_;
  if (ws) {
    const soa::Sweeps<double>& S = soa::sweeps<double>();
    ws->articulated = false;
    S.ground(model_, *ws, in);
    for (const Op& op : model_.program) {
      if (op.code == OpCode::devices) break;
      if (op.code != OpCode::elastic && op.code != OpCode::central_gravity) soa::run_op<double>(model_, op, S, *ws, in, nullptr);
    }
    return look(*ws, in, true);
  }
  for (const Device& d : model_.devices.all)
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      const DeviceMount& m = d.mounts[i];
      if (m.node < 0) motions_[d.mount + i].q = m.q >= 0 ? in.q[m.q] : 0.0, motions_[d.mount + i].v = in.v[m.v];
    }
}

void DeviceForces::take_inputs(const Device& d) {
  for (int i = d.in; i < d.in + d.n_in; ++i) in_[i] = model_.devices.from[i] < 0 ? commands[i] : out_[model_.devices.from[i]];
}

cardan_device_args DeviceForces::args(const Device& d) const {
  return {sizeof(cardan_device_args), state_.t,        d.packed.data(),       in_.data() + d.in,
          motions_.data() + d.mount,  z_.data() + d.z, marks_.data() + d.mark};
}

bool DeviceForces::evaluate(int index) {
  const Device& d = model_.devices.all[index];
  take_inputs(d);
  for (std::size_t i = 0; i < d.mounts.size(); ++i) loads_[d.mount + i] = {};
  for (std::uint32_t i = 0; i < d.family->n_states; ++i) zdot_[d.z + i] = 0.0;
  for (int i = 0; i < d.n_out; ++i) out_[d.out + i] = 0.0;
  const cardan_device_args at = args(d);
  cardan_device_out out{zdot_.data() + d.z, out_.data() + d.out, loads_.data() + d.mount, 0.0, 0.0};
  if (const int code = d.family->evaluate(&at, &out); code != 0) {
    fault_ = {index, fmt::format("evaluate returned {}", code)};
    return false;
  }
  delivered_[index] = out.delivered, lost_[index] = out.lost;
  return expect_finite(index);
}

bool DeviceForces::expect_finite(int index) {
  const Device& d = model_.devices.all[index];
  const auto n_loads = static_cast<int>(d.mounts.size()) * kLoad;
  const auto n_z = static_cast<int>(d.family->n_states);
  const double* loads = d.mounts.empty() ? nullptr : numbers(loads_[d.mount]);
  if (all_finite(zdot_.data() + d.z, n_z) && all_finite(out_.data() + d.out, d.n_out) && all_finite(loads, n_loads) &&
      std::isfinite(delivered_[index]) && std::isfinite(lost_[index]))
    return true;
  fault_ = {index, "its power is not finite"};
  const auto tell = [&](const double* x, int n, const auto& name) {
    if (all_finite(x, n)) return false;
    const int i = first_not_finite(x, n);
    fault_.what = fmt::format("{} = {}", name(i), x[i]);
    return true;
  };
  const auto port = [&](int i) {
    for (std::uint32_t k = 0;; ++k)
      if (d.family->ports[k].kind == CARDAN_PORT_OUT && i-- == 0) return fmt::format("output {}", d.family->ports[k].name);
  };
  const auto load = [&](int i) {
    return fmt::format("{} at {}",
                       i % kLoad < 3   ? "moment"
                       : i % kLoad < 6 ? "force"
                                       : "force of the hinge",
                       d.family->mounts[i / kLoad].name);
  };
  if (!tell(loads, n_loads, load) && !tell(out_.data() + d.out, d.n_out, port))
    tell(zdot_.data() + d.z, n_z, [&](int i) { return fmt::format("rate of {}", d.family->states[i].name); });
  return false;
}

bool DeviceForces::evaluate() {
  fault_.device = -1;
  const auto good = [this](int i) { return evaluate(i); };
  return std::ranges::all_of(first_, good) && std::ranges::all_of(acting_, good) && std::ranges::all_of(others_, good);
}

bool DeviceForces::complete(Workspace& ws, const Inputs& in) {
  look(ws, in, false);
  return std::ranges::all_of(others_, [this](int i) { return evaluate(i); });
}

bool DeviceForces::act(Workspace& ws, const Inputs& in) {
  look(ws, in, true);
  fault_.device = -1;
  const auto good = [this](int i) { return evaluate(i); };
  if (!std::ranges::all_of(first_, good) || !std::ranges::all_of(acting_, good)) return false;
  for (const Device& d : model_.devices.all)
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      const DeviceMount& m = d.mounts[i];
      const cardan_mount_load& l = loads_[d.mount + i];
      if ((m.use & CARDAN_USE_LOAD) == 0) continue;
      if (m.node >= 0)
        state_.wrenches[m.load].f = {{l.moment[0], l.moment[1], l.moment[2]}, {l.force[0], l.force[1], l.force[2]}};
      else
        state_.tau[m.v] += l.tau;
    }
  return true;
}

void DeviceForces::add_hinge_forces(double* tau) const {
  for (const Device& d : model_.devices.all)
    for (std::size_t i = 0; i < d.mounts.size(); ++i)
      if (d.mounts[i].node < 0 && (d.mounts[i].use & CARDAN_USE_LOAD) != 0) tau[d.mounts[i].v] += loads_[d.mount + i].tau;
}

double DeviceForces::energy() const {
  double sum = 0.0;
  for (const Device& d : model_.devices.all) {
    if ((d.family->facts & CARDAN_FACT_ENERGY) == 0) continue;
    const cardan_device_args at = args(d);
    sum += d.family->energy(&at);
  }
  return sum;
}

double DeviceForces::unseen_power() const {
  double sum = 0.0;
  for (std::size_t k = 0; k < model_.devices.all.size(); ++k) {
    const Device& d = model_.devices.all[k];
    if ((d.family->facts & CARDAN_FACT_ENERGY) == 0) continue;
    sum += delivered_[k] - lost_[k];
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
  for (const Device& d : model_.devices.all) {
    if (d.family->n_roots == 0) continue;
    const cardan_device_args at = args(d);
    d.family->roots(&at, g + d.root);
  }
}

void DeviceForces::event(int device, std::uint32_t root, int direction, double* z, double* marks) const {
  const Device& d = model_.devices.all[device];
  if (!d.family->event) return;
  const cardan_device_args at = args(d);
  d.family->event(&at, root, direction, z + d.z, marks + d.mark);
}

bool DeviceForces::tick(int index, double period, const double* noise, double* z, double* marks) {
  const Device& d = model_.devices.all[index];
  const cardan_device_args at = args(d);
  const int code = d.family->tick(&at, period, noise, z + d.z, marks + d.mark);
  for (std::size_t i = 0; i < d.mounts.size(); ++i) {
    cardan_mount_motion& m = motions_[d.mount + i];
    std::fill_n(m.alpha, 3, 0.0), std::fill_n(m.specific_force, 3, 0.0);
  }
  const auto n_z = static_cast<int>(d.family->n_states), n_marks = static_cast<int>(d.family->n_marks);
  if (code != 0)
    fault_ = {index, fmt::format("tick returned {}", code)};
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

std::size_t DeviceForces::bytes() const {
  return sizeof *this + motions_.size() * sizeof motions_[0] + loads_.size() * sizeof loads_[0] +
         (commands.size() + in_.size() + out_.size() + zdot_.size() + delivered_.size() + lost_.size()) * sizeof(double);
}

DeviceTangents::DeviceTangents(const Model& model, const DeviceForces& base) : model_(model), base_(base) {
  motions_.resize(base.motions_.size()), loads_.resize(base.loads_.size());
  commands.resize(base.in_.size()), in_.resize(base.in_.size()), out_.resize(base.out_.size()), zdot_.resize(base.zdot_.size()),
      dz_.resize(base.zdot_.size());
}

void DeviceTangents::take_inputs(const Device& d) {
  for (int i = d.in; i < d.in + d.n_in; ++i) in_[i] = model_.devices.from[i] < 0 ? commands[i] : out_[model_.devices.from[i]];
}

/// With the rates of its mounts, inputs and states as they are.
bool DeviceTangents::differentiate(const Device& d) {
  std::memset(loads_.data() + d.mount, 0, d.mounts.size() * sizeof(cardan_mount_load));
  std::fill_n(zdot_.begin() + d.z, d.family->n_states, 0.0);
  std::fill_n(out_.begin() + d.out, d.n_out, 0.0);
  const cardan_device_args at = base_.args(d);
  cardan_device_args along = at;
  along.in = in_.data() + d.in, along.mount = motions_.data() + d.mount, along.z = dz_.data() + d.z;
  cardan_device_out out{zdot_.data() + d.z, out_.data() + d.out, loads_.data() + d.mount, 0.0, 0.0};
  return d.family->tangent ? d.family->tangent(&at, &along, &out) == 0 : by_differences(d, at, along, out);
}

/// Of eighth order, along the direction as a whole: what it reads moves by a hundredth of its own size, a state by that of its nominal.
bool DeviceTangents::by_differences(const Device& d, const cardan_device_args& at, const cardan_device_args& along,
                                    cardan_device_out& out) {
  const auto n_mounts = d.mounts.size();
  const auto n_in = static_cast<std::size_t>(d.n_in), n_z = static_cast<std::size_t>(d.family->n_states);
  const std::size_t n_read = n_mounts * kMotion + n_in + n_z, n_out = n_mounts * kLoad + static_cast<std::size_t>(d.n_out) + n_z;
  scratch_.assign(3 * n_read + 2 * n_out, 0.0);
  double *x = scratch_.data(), *dx = x + n_read, *moved = dx + n_read, *sum = moved + n_read, *work = sum + n_out;
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
  if (rate == 0.0) return true;
  bool good = true;
  const auto evaluate = [&](double s, double* to) {
    for (std::size_t i = 0; i < n_read; ++i) moved[i] = x[i] + s * dx[i];
    std::fill_n(to, n_out, 0.0);
    cardan_device_args beside = at;
    beside.mount = reinterpret_cast<const cardan_mount_motion*>(moved);
    beside.in = moved + n_mounts * kMotion, beside.z = beside.in + n_in;
    cardan_device_out there{to + n_mounts * kLoad + d.n_out, to + n_mounts * kLoad, reinterpret_cast<cardan_mount_load*>(to), 0.0, 0.0};
    good = good && d.family->evaluate(&beside, &there) == 0;
  };
  soa::derivative(evaluate, 1e-2 / rate, static_cast<int>(n_out), sum, work);
  if (n_mounts > 0) std::copy_n(sum, n_mounts * kLoad, numbers(*out.load));
  std::copy_n(sum + n_mounts * kLoad, d.n_out, out.out);
  std::copy_n(sum + n_mounts * kLoad + d.n_out, n_z, out.zdot);
  return good;
}

void DeviceTangents::look(const soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in, bool acting) {
  for (const Device& d : model_.devices.all)
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      const bool in_steps = d.acts && (d.mounts[i].use & CARDAN_USE_ACCELERATION) == 0;
      if (in_steps != acting) continue;
      double* to = numbers(motions_[d.mount + i]);
      motion_of<Tangent>(model_, ws, in, d.mounts[i], [&](int at, const Tangent& x) { to[at] = x.d; });
    }
}

bool DeviceTangents::complete(soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in) {
  look(ws, in, false);
  return std::ranges::all_of(base_.others_, [this](int i) {
    take_inputs(model_.devices.all[i]);
    return differentiate(model_.devices.all[i]);
  });
}

bool DeviceTangents::act(soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in) {
  look(ws, in, true);
  for (int i = 0; i < model_.devices.n_z; ++i) dz_[i] = state_.z[i].d;
  const auto good = [this](int i) {
    take_inputs(model_.devices.all[i]);
    return differentiate(model_.devices.all[i]);
  };
  if (!std::ranges::all_of(base_.first_, good) || !std::ranges::all_of(base_.acting_, good)) return false;
  for (const Device& d : model_.devices.all)
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      const DeviceMount& m = d.mounts[i];
      if ((m.use & CARDAN_USE_LOAD) == 0) continue;
      const double *x = numbers(base_.loads_[d.mount + i]), *dx = numbers(loads_[d.mount + i]);
      const auto both = [&](int j) { return Tangent(x[j], dx[j]); };
      if (m.node >= 0)
        state_.wrenches[m.load].f = {{both(0), both(1), both(2)}, {both(3), both(4), both(5)}};
      else
        state_.tau[m.v].d += dx[6];  // its value is in the base's tau
    }
  return true;
}

void DeviceTangents::state_matrix(int index, double* J) {
  const Device& d = model_.devices.all[index];
  const auto n = d.family->n_states;
  std::memset(motions_.data() + d.mount, 0, d.mounts.size() * sizeof(cardan_mount_motion));
  std::fill_n(in_.begin() + d.in, d.n_in, 0.0);
  for (std::uint32_t j = 0; j < n; ++j) {
    std::fill_n(dz_.begin() + d.z, n, 0.0);
    dz_[d.z + j] = 1.0;
    differentiate(d);
    std::copy_n(zdot_.begin() + d.z, n, J + j * n);
  }
}

}  // namespace cardan
