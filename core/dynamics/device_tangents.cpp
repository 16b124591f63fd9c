#include "core/dynamics/device_tangents.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace cardan {
namespace {

using namespace device_mounts;
using soa::Tangent;

auto rates_into(std::vector<cardan_mount_motion>& motions) {
  return [to = motions.data()](int mount, int i, const Tangent& x) { numbers(to[mount])[i] = x.d; };
}
/// Rates of ports first ... first + n - 1.
void scale_altered(const std::vector<AlteredPort>& all, int first, int n, std::vector<double>& rates) {
  const auto is_of_it = [first, n](const AlteredPort& a) { return a.index >= first && a.index < first + n; };
  for (const AlteredPort& a : all)
    if (is_of_it(a)) a.x = rates[a.index + a.of];
  for (const AlteredPort& a : all)
    if (is_of_it(a)) rates[a.index] = a.scale * a.x;
}

/// [m, rad, m/s, rad/s] What a law of poses and of their rates bends over at least, or this part of how far they are from zero: places in
/// orbit are near each other.
constexpr double kBeside = 1.0, kFar = 1e-7;
/// Of a number of cardan_mount_motion.
double size_of_motion(std::size_t number, double x) {
  const bool is_pose_or_rate = number < offsetof(cardan_mount_motion, alpha) / sizeof(double);
  return std::max(kBeside, is_pose_or_rate ? kFar * std::abs(x) : std::abs(x));
}
constexpr std::size_t kVelocity = offsetof(cardan_mount_motion, velocity) / sizeof(double);
bool is_velocity(std::size_t number) { return number >= kVelocity && number < kVelocity + 3; }

/// Of a velocity, over its size, as world axes have it: 7500 m/s turn in the axes of a node that turns, and of what is told of both nothing
/// changes but the product of the two ways, which is kept a hundredth of what a law bends over.
double rate_of_velocity(const cardan_mount_motion& at, const cardan_mount_motion& along) {
  double rate = 0.0, turn = 0.0, turned = 0.0;
  for (int i = 0; i < 3; ++i) {
    double of_axes = 0.0, own = 0.0;
    for (int j = 0; j < 3; ++j) {
      const int k = 3 * i + j;
      of_axes += along.R_WN[k] * at.velocity[j], own += at.R_WN[k] * along.velocity[j];
      turn = std::max(turn, std::abs(along.R_WN[k]));
    }
    rate = std::max(rate, std::abs(of_axes + own) / size_of_motion(kVelocity, at.velocity[i]));
    turned = std::max(turned, std::abs(of_axes));
  }
  return std::max(rate, 0.1 * std::sqrt(turn * turned / kBeside));
}

}  // namespace

DeviceTangents::DeviceTangents(const Model& model, const DeviceForces& base) : model_(model), base_(base), fields_(model) {
  const auto at = [](int n) { return static_cast<std::size_t>(n); };
  motions_.resize(base.motions_.size()), loads_.resize(base.motions_.size());
  commands.resize(base.in_.size()), in_.resize(base.in_.size()), out_.resize(at(model.devices.n_out));
  zdot_.resize(at(model.devices.n_z)), dz_.resize(at(model.devices.n_z));
  followed_motions_.resize(base.followed_motions_.size()), unused_.resize(base.following_.empty() ? 0 : at(model.devices.n_z));
}

void DeviceTangents::take_inputs(const Device& d) {
  for (int i = d.in; i < d.in + d.n_in; ++i) in_[i] = model_.devices.from[i] < 0 ? commands[i] : out_[model_.devices.from[i]];
  for (const AddedOutput& a : model_.devices.added)
    if (a.in >= d.in && a.in < d.in + d.n_in) in_[a.in] += out_[a.out];
  for (const std::vector<AlteredPort>* all : {&base_.altered_commands_, &base_.altered_in_}) scale_altered(*all, d.in, d.n_in, in_);
}

/// With the rates of its mounts, inputs and states as they are.
bool DeviceTangents::differentiate(int index) {
  const Device& d = model_.devices.all[index];
  std::fill_n(loads_.begin() + d.mount, d.mounts.size(), cardan_mount_load{});
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
    const double size = i < n_mounts * kMotion          ? size_of_motion(i % kMotion, x[i])
                        : i < n_mounts * kMotion + n_in ? std::max(1.0, std::abs(x[i]))
                                                        : model_.devices.nominal[d.z + (i - n_mounts * kMotion - n_in)];
    if (i >= n_mounts * kMotion || !is_velocity(i % kMotion)) rate = std::max(rate, std::abs(dx[i]) / size);
  }
  for (std::size_t i = 0; i < n_mounts; ++i) rate = std::max(rate, rate_of_velocity(at.mount[i], along.mount[i]));
  std::fill_n(out, n, 0.0);
  if (rate < 1e-280) return;  // nothing moves, or by what no step shows
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
  for (const Mounts::OnNode& m : base_.pushed_.nodes) {
    const double *x = numbers(base_.loads_[m.mount]), *dx = numbers(loads_[m.mount]);
    const auto both = [&](int j) { return Tangent(x[j], dx[j]); };
    state_.wrenches[m.load].f = {{both(0), both(1), both(2)}, {both(3), both(4), both(5)}};
  }
  for (const Mounts::OnHinge& m : base_.pushed_.hinges) state_.tau[m.v].d += loads_[m.mount].tau;  // its value is in the base's tau
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

/// What flows pushes with; and of the bodies whose mass varies what their motion needs, as a load against it.
void DeviceTangents::add_flows(const soa::Inputs<Tangent>& in) {
  const Devices& devices = model_.devices;
  std::vector<Force<Tangent>> sum(static_cast<std::size_t>(devices.n_loads), cast<Tangent>(Force<double>{}));
  add_flow_forces(devices, {base_.motions_.data(), base_.out_, base_.z_.data(), base_.zdot_},
                  {motions_.data(), out_.data(), dz_.data(), zdot_.data()}, base_.marks_.data(), sum.data());
  const auto moved = [](const Vec3<double>& d) { return Vec3<Tangent>{{0.0, d.x}, {0.0, d.y}, {0.0, d.z}}; };
  for (const DeviceMass& own : devices.masses) {
    const UserBody& u = model_.user[own.user];
    if (u.sweep == 0) continue;
    const Device& d = devices.all[own.device];
    const cardan_mass m = mass_of(d, base_.z_.data(), base_.marks_.data());
    const cardan_mass change = mass_rate(devices, d, base_.z_.data(), base_.marks_.data(), dz_.data());
    const auto which = std::ranges::find(devices.varying, u.sweep, &VaryingBody::sweep) - devices.varying.begin();
    const RigidInertia<double> dM = to_inboard(u.pose, cardan::inertia_rate(m, change));
    const Force<double> f =
        to_outboard(u.pose, force_of_inertia(model_, u.sweep, dM, base_.varying_[static_cast<std::size_t>(which)], in.gravity, in.moment));
    sum[d.mounts[own.mount].load] -= Force<Tangent>{moved(f.n), moved(f.f)};
  }
  for (std::size_t i = 0; i < sum.size(); ++i) state_.wrenches[i].f += sum[i];
}

void DeviceTangents::add_at_hinges(double* stiffness, double* damping) {
  std::ranges::fill(motions_, cardan_mount_motion{});
  std::ranges::fill(in_, 0.0);
  for (std::size_t k = 0; k < model_.devices.all.size(); ++k) {
    const Device& d = model_.devices.all[k];
    if (!d.family->tangent || d.family->n_states > 0) continue;
    for (std::size_t i = 0; i < d.mounts.size(); ++i) {
      const DeviceMount& m = d.mounts[i];
      if (m.node >= 0 || m.v < 0 || m.still || (m.use & CARDAN_USE_LOAD) == 0) continue;
      cardan_mount_motion& moves = motions_[d.mount + i];
      const auto response = [&](double& with) {
        with = 1.0;
        const bool known = differentiate(static_cast<int>(k));
        with = 0.0;
        return known ? -loads_[d.mount + i].tau : 0.0;
      };
      if (m.q >= 0) stiffness[m.v] += response(moves.q);
      damping[m.v] += response(moves.v);
    }
  }
  fault_of_ = -1;
}

void DeviceTangents::state_matrix(int index, double* J) {
  const Device& d = model_.devices.all[index];
  const auto n = d.family->n_states;
  std::fill_n(motions_.begin() + d.mount, d.mounts.size(), cardan_mount_motion{});
  if (d.family->follow) std::fill_n(followed_motions_.begin() + d.mount, d.mounts.size(), cardan_mount_motion{});
  std::fill_n(in_.begin() + d.in, d.n_in, 0.0);
  for (std::uint32_t j = 0; j < n; ++j) {
    std::fill_n(dz_.begin() + d.z, n, 0.0);
    dz_[d.z + j] = 1.0;
    d.family->follow ? follow_along(index) : differentiate(index);
    std::copy_n(zdot_.begin() + d.z, n, J + j * n);
  }
}

}  // namespace cardan
