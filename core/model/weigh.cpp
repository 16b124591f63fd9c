// Masses that devices give to bodies: into the numbers that sweeps, operators and balances read.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/model/model.hpp"

namespace cardan {
namespace {

/// "it cannot carry propellant = 30 kg".
std::string more_than_it_carries(const Device& d, const double* z) {
  std::string text = "it cannot carry";
  for (std::uint32_t i = 0; i < d.family->n_states; ++i)
    text += fmt::format("{} {} = {:g} {}", i > 0 ? "," : "", d.family->states[i].name, z[i], d.family->states[i].unit);
  return text;
}

}  // namespace

Model Model::weighed(const double* z, const double* marks) const {
  Model out = *this;
  int device = 0;
  if (out.changes()) out.weigh(z, marks, device);
  return out;
}

std::string Model::weigh(const double* z, const double* marks, int& device) {
  for (const DeviceHold& h : devices.holds) prescribed[h.v] = marks[devices.all[h.device].mark] != 0.0;
  for (const VaryingBody& b : devices.varying) {
    SweepBody& to = bodies[b.sweep];
    to.M = b.M, to.M_sweep = b.M_sweep, to.J_P = b.J_P;
  }
  for (const DeviceMass& m : devices.masses) user[m.user].M = m.own, user[m.user].mass = m.own_mass;
  std::string fault;
  for (const DeviceMass& m : devices.masses) {
    const Device& d = devices.all[m.device];
    const cardan_device_args at{sizeof(cardan_device_args), 0.0, d.packed.data(), nullptr, nullptr, z + d.z, marks + d.mark};
    cardan_mass given{};
    const int code = d.family->mass(&at, &given);
    const double* numbers = &given.mass;
    bool finite = true;
    for (std::size_t i = 0; i < sizeof given / sizeof(double); ++i) finite = finite && std::isfinite(numbers[i]);
    if (code != 0 || !finite) {
      if (fault.empty()) device = m.device, fault = code != 0 ? more_than_it_carries(d, at.z) : "its mass is not finite";
      continue;
    }
    const RigidInertia<double> M = inertia_of(given);
    UserBody& u = user[m.user];
    u.M = u.M + M, u.mass += M.m;
    if (u.sweep == 0) continue;
    SweepBody& to = bodies[u.sweep];
    const RigidInertia<double> there = to_inboard(u.pose, M);
    to.M = to.M + there, to.M_sweep = to.M_sweep + there, to.J_P += there.J;
  }
  return fault;
}

bool Model::has_given_motion(int v) const {
  return has_prescribed() && prescribed[v] && std::ranges::find(devices.holds, v, &DeviceHold::v) == devices.holds.end();
}

RigidInertia<double> inertia_of(const cardan_mass& m) {
  const double* J = m.inertia;
  return about_origin(m.mass, Vec3<double>{m.centre[0], m.centre[1], m.centre[2]}, Sym3<double>{J[0], J[1], J[2], J[3], J[4], J[5]});
}

}  // namespace cardan
