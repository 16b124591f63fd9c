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
constexpr double kEnd = 1e-6;  // of the nominal state: what is nearer to empty or full changes as it would with so much, or so much room

cardan_device_args args(const Device& d, const double* z, const double* marks) {
  return {sizeof(cardan_device_args), 0.0, d.packed.data(), nullptr, nullptr, z, marks + d.mark};
}

/// d f(args, m) / ds, f a law of the mass that a device carries, z its states, along dz: by differences of eighth order. A step is a
/// hundredth of the nominal state, or a fortieth of what is in the tank or of the room left there: laws of the mass end where it is empty
/// or full, many with an upright tangent.
template <class F>
cardan_mass differences(const Devices& devices, const Device& d, const double* z, const double* marks, const double* dz, const F& f) {
  const double* nominal = devices.nominal.data() + d.z;
  const std::size_t n = d.family->n_states;
  std::array<double, 64> few;
  std::vector<double> many(2 * n > few.size() ? 2 * n : 0);
  double *at = many.empty() ? few.data() : many.data(), *moved = at + n;
  double largest = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    at[i] = std::abs(z[i]) < kEnd * nominal[i] ? kEnd * nominal[i] : z[i];
    largest = std::max(largest, std::abs(dz[i]) / std::min(nominal[i], 2.5 * std::abs(at[i])));
  }
  cardan_mass out{}, work{};
  if (!(largest > 0.0)) return out;
  const auto there = [&](double s) {
    for (std::size_t i = 0; i < n; ++i) moved[i] = at[i] + s * dz[i];
    return args(d, moved, marks);
  };
  const auto can_carry = [&](double s) {
    const cardan_device_args beside = there(s);
    return d.family->mass(&beside, &work) == 0;
  };
  const double end = kEnd / largest;
  for (const double side : {end, -end})
    if (!can_carry(side)) std::copy_n(there(-3.0 * side).z, n, at);
  double h = 1e-2 / largest;
  while (40.0 * h > end && !(can_carry(40.0 * h) && can_carry(-40.0 * h))) h *= 0.5;
  soa::derivative([&](double s, double* to) { f(there(s), reinterpret_cast<cardan_mass*>(to)); }, h, kMass, &out.mass, &work.mass);
  return out;
}
/// Of a device with the states z.
cardan_mass rate_of_mass(const Devices& devices, const Device& d, const double* z, const double* marks, const double* dz) {
  if (!d.family->mass_tangent)
    return differences(devices, d, z, marks, dz, [&](const cardan_device_args& there, cardan_mass* m) { d.family->mass(&there, m); });
  cardan_mass out{};
  const cardan_device_args at = args(d, z, marks);
  d.family->mass_tangent(&at, dz, &out);
  return out;
}

double number(const double* x, const double*, std::size_t i, double) { return x[i]; }
Tangent number(const double* x, const double* dx, std::size_t i, Tangent) { return {x[i], dx[i]}; }
/// Three numbers of x, with their derivatives dx where T is a Tangent.
template <class T>
Vec3<T> vec(const double* x, const double* dx) {
  return {number(x, dx, 0, T()), number(x, dx, 1, T()), number(x, dx, 2, T())};
}
template <class T>
Mat3<T> mat(const double* x, const double* dx) {
  const auto e = [&](std::size_t i) { return number(x, dx, i, T()); };
  return {e(0), e(1), e(2), e(3), e(4), e(5), e(6), e(7), e(8)};
}
Vec3<double> vec(const double* x) { return {x[0], x[1], x[2]}; }
Mat3<double> mat(const double* R) { return {R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]}; }
Vec3<double> rate(const Vec3<Tangent>& a) { return {a.x.d, a.y.d, a.z.d}; }

RigidInertia<Tangent> along(const RigidInertia<double>& M, const RigidInertia<double>& d) {
  return {{M.m, d.m},
          {{M.h.x, d.h.x}, {M.h.y, d.h.y}, {M.h.z, d.h.z}},
          {{M.J.xx, d.J.xx}, {M.J.yy, d.J.yy}, {M.J.zz, d.J.zz}, {M.J.xy, d.J.xy}, {M.J.xz, d.J.xz}, {M.J.yz, d.J.yz}}};
}

/// m and m' of a device, z' their rate; with the derivatives of both along the states of `along` where T is a Tangent.
template <class T>
void masses(const Devices& devices, const Device& d, const EvaluatedDevices& at, const EvaluatedDevices& along, const double* marks,
            cardan_mass (&m)[2], cardan_mass (&change)[2]) {
  const double* z = at.z + d.z;
  m[0] = mass_of(d, at.z, marks), change[0] = rate_of_mass(devices, d, z, marks, at.zdot + d.z);
  if constexpr (std::is_same_v<T, Tangent>) {
    m[1] = rate_of_mass(devices, d, z, marks, along.z + d.z), change[1] = rate_of_mass(devices, d, z, marks, along.zdot + d.z);
    const cardan_mass more = differences(devices, d, z, marks, along.z + d.z, [&](const cardan_device_args& there, cardan_mass* to) {
      *to = rate_of_mass(devices, d, there.z, marks, at.zdot + d.z);
    });
    for (int i = 0; i < kMass; ++i) (&change[1].mass)[i] += (&more.mass)[i];
  }
}

// What moves in its body at the rate u, as the body turns with w, takes 2 w x u of its acceleration from it. Inside, where the mass that
// stays moves with its centre c and what is drawn comes to c: -2 m w x c' at c and the moment -J' w. On a straight way from c to the outlet
// e, mass mu per second that moves with the line between two moving points: -2 mu (v_e - v_c) in all, spread evenly: half of it at each
// end.
template <class T>
void add_flow_forces_of(const Devices& devices, const EvaluatedDevices& at, const EvaluatedDevices& along, const double* marks,
                        Force<T>* loads) {
  for (std::size_t i = 0; i < devices.masses.size(); ++i) {
    const DeviceMass& own = devices.masses[i];
    const Device& d = devices.all[own.device];
    const int n = d.mount + own.mount;
    const cardan_mount_motion &body = at.motions[n], &moved = along.motions[n];
    cardan_mass m[2], change[2];
    masses<T>(devices, d, at, along, marks, m, change);
    const Vec3<T> w = vec<T>(body.omega, moved.omega), c = vec<T>(m[0].centre, m[1].centre);
    const auto J = [&](std::size_t j) { return number(change[0].inertia, change[1].inertia, j, T()); };
    Vec3<T> force = (T(-2.0) * number(&m[0].mass, &m[1].mass, 0, T())) * cross(w, vec<T>(change[0].centre, change[1].centre));
    const Vec3<T> spin = Sym3<T>{J(0), J(1), J(2), J(3), J(4), J(5)} * w;
    const Mat3<T> R = mat<T>(body.R_WN, moved.R_WN);
    const Vec3<T> v_c = R * (vec<T>(body.velocity, moved.velocity) + cross(w, c));
    for (const MassFlow& flow : devices.flows) {
      if (flow.from != static_cast<int>(i)) continue;
      const Device& thruster = devices.all[flow.device];
      const int e = thruster.mount + flow.mount;
      const Mat3<T> R_e = mat<T>(at.motions[e].R_WN, along.motions[e].R_WN);
      const Vec3<T> v_e = R_e * vec<T>(at.motions[e].velocity, along.motions[e].velocity);
      const Vec3<T> half = -number(at.outputs, along.outputs, static_cast<std::size_t>(flow.output), T()) * (v_e - v_c);
      loads[thruster.mounts[flow.mount].load].f += transpose_times(R_e, half);
      force += transpose_times(R, half);
    }
    loads[d.mounts[own.mount].load] += Force<T>{cross(c, force) - spin, force};
  }
}

}  // namespace

cardan_mass mass_of(const Device& d, const double* z, const double* marks) {
  const cardan_device_args at = args(d, z + d.z, marks);
  cardan_mass m{};
  d.family->mass(&at, &m);
  return m;
}

cardan_mass mass_rate(const Devices& devices, const Device& d, const double* z, const double* marks, const double* dz) {
  return rate_of_mass(devices, d, z + d.z, marks, dz + d.z);
}

RigidInertia<double> inertia_rate(const cardan_mass& m, const cardan_mass& d) {
  const auto both = [&](int i) { return Tangent((&m.mass)[i], (&d.mass)[i]); };
  const RigidInertia<Tangent> M =
      about_origin(both(0), Vec3<Tangent>{both(1), both(2), both(3)}, Sym3<Tangent>{both(4), both(5), both(6), both(7), both(8), both(9)});
  return {M.m.d, rate(M.h), {M.J.xx.d, M.J.yy.d, M.J.zz.d, M.J.xy.d, M.J.xz.d, M.J.yz.d}};
}

void add_flow_forces(const Devices& devices, const EvaluatedDevices& at, const double* marks, Force<double>* loads) {
  add_flow_forces_of<double>(devices, at, at, marks, loads);
}
void add_flow_forces(const Devices& devices, const EvaluatedDevices& at, const EvaluatedDevices& along, const double* marks,
                     Force<Tangent>* loads) {
  add_flow_forces_of<Tangent>(devices, at, along, marks, loads);
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
