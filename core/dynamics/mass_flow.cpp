#include "core/dynamics/mass_flow.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/soa/gravity_field.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {
namespace {

using soa::Tangent;

constexpr int kMass = sizeof(cardan_mass) / sizeof(double);
constexpr double kEmpty = 1e-6;  // of the nominal state: what fills, or is emptied, there changes as it would with so much

cardan_device_args args(const Device& d, const double* z, const double* marks) {
  return {sizeof(cardan_device_args), 0.0, d.packed.data(), nullptr, nullptr, z, marks + d.mark};
}
Vec3<double> vec(const double* x) { return {x[0], x[1], x[2]}; }
Mat3<double> mat(const double* R) { return {R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]}; }
Vec3<double> rate(const Vec3<Tangent>& a) { return {a.x.d, a.y.d, a.z.d}; }

RigidInertia<Tangent> along(const RigidInertia<double>& M, const RigidInertia<double>& d) {
  return {{M.m, d.m},
          {{M.h.x, d.h.x}, {M.h.y, d.h.y}, {M.h.z, d.h.z}},
          {{M.J.xx, d.J.xx}, {M.J.yy, d.J.yy}, {M.J.zz, d.J.zz}, {M.J.xy, d.J.xy}, {M.J.xz, d.J.xz}, {M.J.yz, d.J.yz}}};
}

}  // namespace

cardan_mass mass_of(const Device& d, const double* z, const double* marks) {
  const cardan_device_args at = args(d, z + d.z, marks);
  cardan_mass m{};
  d.family->mass(&at, &m);
  return m;
}

cardan_mass mass_rate(const Devices& devices, const Device& d, const double* z, const double* marks, const double* dz) {
  cardan_mass out{};
  if (d.family->mass_tangent) {
    const cardan_device_args at = args(d, z + d.z, marks);
    d.family->mass_tangent(&at, dz + d.z, &out);
    return out;
  }
  const std::size_t n = d.family->n_states;
  // A step of a hundredth, or of a fortieth of what is in the tank: laws of the mass end where it is empty, many with an upright tangent.
  const auto at = [&](std::size_t i) {
    return std::abs(z[d.z + i]) < kEmpty * devices.nominal[d.z + i] ? kEmpty * devices.nominal[d.z + i] : z[d.z + i];
  };
  double largest = 0.0;
  for (std::size_t i = 0; i < n; ++i)
    largest = std::max(largest, std::abs(dz[d.z + i]) / std::min(devices.nominal[d.z + i], 2.5 * std::abs(at(i))));
  if (!(largest > 0.0)) return out;
  std::array<double, 32> few;
  std::vector<double> many(n > few.size() ? n : 0);
  double* moved = many.empty() ? few.data() : many.data();
  const auto beside = [&](double s, double* to) {
    for (std::size_t i = 0; i < n; ++i) moved[i] = at(i) + s * dz[d.z + i];
    const cardan_device_args there = args(d, moved, marks);
    d.family->mass(&there, reinterpret_cast<cardan_mass*>(to));
  };
  double work[kMass];
  soa::derivative(beside, 1e-2 / largest, kMass, &out.mass, work);
  return out;
}

RigidInertia<double> inertia_rate(const cardan_mass& m, const cardan_mass& d) {
  const auto both = [&](int i) { return Tangent((&m.mass)[i], (&d.mass)[i]); };
  const RigidInertia<Tangent> M =
      about_origin(both(0), Vec3<Tangent>{both(1), both(2), both(3)}, Sym3<Tangent>{both(4), both(5), both(6), both(7), both(8), both(9)});
  return {M.m.d, rate(M.h), {M.J.xx.d, M.J.yy.d, M.J.zz.d, M.J.xy.d, M.J.xz.d, M.J.yz.d}};
}

// What moves in its body at the rate u, as the body turns with w, takes 2 w x u of its acceleration from it. Inside, where the mass that
// stays moves with its centre c and what is drawn comes to c: -2 m w x c' at c and the moment -J' w. On a straight way from c to the outlet
// e, mass mu per second that moves with the line between two moving points: -2 mu (v_e - v_c) in all, spread evenly: half of it at each
// end.
void add_flow_forces(const Devices& devices, const cardan_mount_motion* motions, const double* outputs, const double* z, const double* zdot,
                     const double* marks, Force<double>* loads) {
  for (std::size_t i = 0; i < devices.masses.size(); ++i) {
    const DeviceMass& own = devices.masses[i];
    const Device& d = devices.all[own.device];
    const cardan_mount_motion& body = motions[d.mount + own.mount];
    const cardan_mass m = mass_of(d, z, marks), change = mass_rate(devices, d, z, marks, zdot);
    const Vec3<double> w = vec(body.omega), c = vec(m.centre);
    const double* J = change.inertia;
    Vec3<double> force = -2.0 * m.mass * cross(w, vec(change.centre));
    const Vec3<double> spin = Sym3<double>{J[0], J[1], J[2], J[3], J[4], J[5]} * w;
    const Mat3<double> R = mat(body.R_WN);
    const Vec3<double> v_c = R * (vec(body.velocity) + cross(w, c));
    for (const MassFlow& flow : devices.flows) {
      if (flow.from != static_cast<int>(i)) continue;
      const Device& thruster = devices.all[flow.device];
      const cardan_mount_motion& outlet = motions[thruster.mount + flow.mount];
      const Mat3<double> R_e = mat(outlet.R_WN);
      const Vec3<double> half = -outputs[flow.output] * (R_e * vec(outlet.velocity) - v_c);
      loads[thruster.mounts[flow.mount].load].f += transpose_times(R_e, half);
      force += transpose_times(R, half);
    }
    loads[d.mounts[own.mount].load] += Force<double>{cross(c, force) - spin, force};
  }
}

LeavingMass leaving_mass(const Model& model, const cardan_mount_motion* motions, const double* z, const double* zdot, const double* marks,
                         const FieldMoment* at) {
  LeavingMass sum;
  for (const DeviceMass& own : model.devices.masses) {
    const UserBody& u = model.user[own.user];
    if (u.sweep == 0) continue;  // on the ground: its energy is in no sum
    const Device& d = model.devices.all[own.device];
    const cardan_mount_motion& body = motions[d.mount + own.mount];
    const cardan_mass m = mass_of(d, z, marks), change = mass_rate(model.devices, d, z, marks, zdot);
    const RigidInertia<double> dM = inertia_rate(m, change);
    const Motion<double> V{vec(body.omega), vec(body.velocity)};
    const Pose<double> W{mat(body.R_WN), vec(body.position)};
    const Force<double> h = dM * V;
    sum.momentum += to_inboard(W, h);
    sum.power += 0.5 * dot(V, h);
    const GravityField& g = model.field;
    if (g.uniform) sum.power -= dot(g.g, dM.m * W.p + W.R * dM.h);
    if (!pulls_with_energy(g)) continue;
    const RigidInertia<Tangent> both = along(model.bodies[u.sweep].M, to_inboard(u.pose, dM));
    sum.power += soa::potential(g, both, cast<Tangent>(W * inverse(u.pose)), at).d;
  }
  return sum;
}

Force<double> force_of_inertia(const Model& model, int k, const RigidInertia<double>& dM, const VaryingMotion& at, bool gravity,
                               const FieldMoment* when) {
  Force<double> f = dM * (at.moves.gamma + at.moves.delta) + gyroscopic(dM, at.moves.w);
  const RigidInertia<double>& M = model.bodies[k].M;
  if (!gravity || !model.field.pulls() || !(M.m > 0.0)) return f;
  const RigidInertia<Tangent> both = along(M, dM);
  Vec3<Tangent> c, r;
  const Force<Tangent> pull = soa::attraction(model.field, both, cast<Tangent>(at.W), c, r, when);
  return f - Force<double>{rate(pull.n), rate(pull.f)};
}

}  // namespace cardan
