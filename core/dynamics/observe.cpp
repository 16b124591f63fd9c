#include "core/dynamics/observe.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>

#include "core/dynamics/hinge_laws.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loops.hpp"
#include "core/dynamics/node_motion.hpp"
#include "core/soa/gravity_field.hpp"
#include "core/soa/kernels_axis.hpp"

namespace cardan {
Observer::Observer(const Model& model, Workspace& workspace) : model_(model), ws_(workspace) {
  ws_.require_world();
  poses_given_ = model.has(OpCode::world);
  prescribed_tau_.resize(static_cast<std::size_t>(model.nv));
  for (const SweepBody& b : model.bodies)
    for (int j = b.etadot; model.has_prescribed() && j < b.etadot + b.n_modes; ++j)
      if (model.prescribed[j] && !inverse_) {
        inverse_ = std::make_unique<Workspace>(model);
        all_tau_.resize(static_cast<std::size_t>(model.nv));
      }
  inertia_.resize(model.bodies.size());
  M_re_.resize(model.bodies.size());
  M_ee_.resize(model.bodies.size());
  for (std::size_t k = 1; k < model.bodies.size(); ++k) {
    const SweepBody& b = model.bodies[k];
    inertia_[k] = b.M;
    if (b.n_modes == 0) continue;
    M_re_[k] = model.flexible[b.flexible].M_re;
    M_ee_[k] = model.flexible[b.flexible].M_ee;
  }
  moment_.resize(model.bodies.size());
  weigh();
}

void Observer::weigh() {
  mass_.assign(model_.bodies.size(), 0.0);
  for (std::size_t k = model_.bodies.size() - 1; k > 0; --k) {
    const SweepBody& b = model_.bodies[k];
    mass_[k] += b.n_modes > 0 ? model_.flexible[b.flexible].data->integrals.I1 : b.M.m;
    mass_[b.parent] += mass_[k];
  }
}

// What closed loops push with is a load like others.
void Observer::look(const Inputs& in, const double* vdot) {
  in_ = in;
  vdot_ = vdot;
  if (model_.loops.empty()) return;
  if (vdot) settle_loops(model_, ws_, in);
  loads_.assign(in.wrenches.begin(), in.wrenches.end());
  for (const NodeWrench& w : loop_forces(ws_).wrenches) loads_.push_back(w);
  in_.wrenches = loads_;
}

void Observer::update(const Inputs& in, const double* vdot) {
  look(in, vdot);
  soa::sweeps<double>().world(model_, ws_, in);
  for (const int k : model_.rotors) complete_rotor(k);
  for (const VaryingBody& b : model_.devices.varying) inertia_[b.sweep] = model_.bodies[b.sweep].M;
  for (std::size_t k = 1; k < model_.bodies.size(); ++k) {
    const SweepBody& b = model_.bodies[k];
    if (b.n_modes == 0) continue;
    const FlexibleBody& f = model_.flexible[b.flexible];
    double M[10];
    f.family->mass(f.packed.data(), in.q + b.eta, M, f.M_re_constant ? nullptr : M_re_[k].data(),
                   f.M_ee_constant ? nullptr : M_ee_[k].data());
    inertia_[k] = {M[0], {M[1], M[2], M[3]}, {M[4], M[5], M[6], M[7], M[8], M[9]}};
  }
}

// What the sweeps do not form of a rotor: they fold it into its carrier.
void Observer::complete_rotor(int k) {
  soa::Core<double>& body = ws_.core(k);
  const BodyMotion<double> moves = motion_of_body(model_, ws_, in_, k, vdot_, After::forward);
  body.w = moves.w, body.gamma = moves.gamma, body.delta = moves.delta;
  body.P = articulated(model_.bodies[k].M);
  ws_.z(k) = bias_of_rotor(model_, ws_, in_, k, body.w, body.gamma);
}

Pose<double> Observer::body_pose(int i) const {
  const UserBody& u = model_.user[i];
  return ws_.pose_W(u.sweep) * u.pose;
}

NodeState Observer::node(int index) const {
  const NodeMotion<double> at = node_motion<double>(model_, ws_, in_, index, vdot_);
  return {to_eigen(at.R_WN), to_eigen(at.position), to_eigen(at.velocity), to_eigen(at.acceleration), to_eigen(at.specific_force)};
}

RigidInertia<double> Observer::inertia_for_gravity(int k) const {
  const SweepBody& b = model_.bodies[k];
  if (b.n_modes == 0) return b.M;
  return soa::gravity_inertia(model_.flexible[b.flexible], b.n_modes, ws_.modal_of(k)->M_rr, in_.q + b.eta);
}

Energy Observer::energy() const {
  Energy e;
  const auto add = [&](double& term, double value) {
    term += value;
    e.magnitude += std::abs(value);
  };
  for (int k = 1; k < static_cast<int>(model_.bodies.size()); ++k) {
    const SweepBody& b = model_.bodies[k];
    const RigidInertia<double>& M = inertia_[k];
    const Motion<double>& V = ws_.V(k);
    double T = 0.5 * dot(V, M * V);
    if (b.n_modes > 0) {
      const double* rate = in_.v + b.etadot;
      const auto n = b.n_modes;
      for (int j = 0; j < n; ++j) {
        T += rate[j] * dot(V, soa::force_column(M_re_[k].data(), j));
        for (int i = 0; i < n; ++i) T += 0.5 * rate[j] * rate[i] * M_ee_[k][n * j + i];
      }
      const FlexibleBody& f = model_.flexible[b.flexible];
      const double* eta = in_.q + b.eta;
      double U = 0.0;
      if (f.K_diagonal)
        for (int j = 0; j < n; ++j) U += 0.5 * f.K[j] * eta[j] * eta[j];
      else
        for (int j = 0; j < n; ++j)
          for (int i = 0; i < n; ++i) U += 0.5 * f.K[n * j + i] * eta[j] * eta[i];
      add(e.modal, U);
    }
    add(e.kinetic, T);
    if (!in_.gravity || M.m <= 0) continue;
    if (model_.gravity.kind == GravitySpec::Kind::uniform) {
      const Vec3<double> first = M.m * ws_.pose_W(k).p + ws_.pose_W(k).R * M.h;  // m x_com
      add(e.gravity, -model_.gravity.g.dot(to_eigen(first)));
    } else if (pulls_with_energy(model_.field)) {
      add(e.gravity, soa::potential(model_.field, inertia_for_gravity(k), ws_.pose_W(k), in_.moment));
    }
  }
  for (const HingeLoad& load : model_.loads) add(e.springs, hinge_laws::energy(load, in_.q[load.q]));
  return e;
}

Momentum Observer::momentum() const {
  Momentum m;
  for (int k = 1; k < static_cast<int>(model_.bodies.size()); ++k) {
    const SweepBody& b = model_.bodies[k];
    const RigidInertia<double>& M = inertia_[k];
    Force<double> h = M * ws_.V(k);
    for (int j = 0; j < b.n_modes; ++j) h += in_.v[b.etadot + j] * soa::force_column(M_re_[k].data(), j);
    const Force<double> in_W = to_inboard(ws_.pose_W(k), h);
    const Eigen::Vector3d linear = to_eigen(in_W.f), angular = to_eigen(in_W.n);
    m.linear += linear;
    m.angular += angular;
    m.linear_magnitude += linear.norm();
    m.angular_magnitude += angular.norm();
    m.angular_parts += to_eigen(ws_.pose_W(k).p).norm() * linear.norm() + to_eigen(h.n).norm();
    m.mass += M.m;
    m.com += to_eigen(M.m * ws_.pose_W(k).p + ws_.pose_W(k).R * M.h);
  }
  if (m.mass > 0) m.com /= m.mass;
  return m;
}

Eigen::Vector3d Observer::axis_in_world(int rotor) const {
  const Eigen::Vector3d axis = to_eigen(ws_.pose_W(rotor).R * soa::hinge_column(model_, ws_, rotor, 0).w);
  return axis.normalized();
}

Eigen::Matrix3d Observer::locked_inertia(const Eigen::Vector3d& about) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  const auto spread = [](const Eigen::Vector3d& r) -> Eigen::Matrix3d {
    return r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose();
  };
  for (int k = 1; k < static_cast<int>(model_.bodies.size()); ++k) {
    const RigidInertia<double>& M = inertia_[k];
    const Eigen::Matrix3d R = to_eigen(ws_.pose_W(k).R);
    Eigen::Matrix3d J = to_eigen(M.J);
    Eigen::Vector3d r = to_eigen(ws_.pose_W(k).p) - about;
    if (M.m > 0.0) {
      const Eigen::Vector3d c = to_eigen(M.h) / M.m;
      J -= M.m * spread(c);
      r += R * c;
    }
    sum += R * J * R.transpose() + M.m * spread(r);
    if (model_.bodies[k].kind != BodyKernel::rotor) continue;
    const Eigen::Vector3d u = axis_in_world(k);
    sum -= model_.axis_bodies[k].J_axial * u * u.transpose();
  }
  return sum;
}

// f = P delta + z; with modes f = P_rr (delta + C eta'') + P_re' eta'' + z (the parts caused by v'; 4.10). What hangs on a node
// of a body that is eliminated through its nodes tells by itself what it transmits: C phi + e, in the axes of that body.
Force<double> Observer::wrench_on_sweep_body(int k) const {
  const SweepBody& b = model_.bodies[k];
  const soa::Core<double>& core = ws_.core(k);
  const auto through_root = [](const soa::NodeRoot<double>& root) {
    double f[6];
    soa::sum_columns(root.C, root.phi, 6, f);
    return soa::force_column(root.e, 0) + soa::force_column(f, 0);
  };
  const soa::Modal<double>* modal = ws_.modal_of(k);
  if (modal && modal->root) {
    const Force<double> f = through_root(*modal->root);
    const Pose<double>& X = ws_.X(k);
    return {transpose_times(X.R, f.n - cross(X.p, f.f)), transpose_times(X.R, f.f)};
  }
  if (b.n_modes == 0) return ws_.z(k) + core.P * core.delta;
  const FlexibleBody& flexible = model_.flexible[b.flexible];
  const double *M_re = flexible.M_re.data(), *P_re = modal->P_re ? modal->P_re : M_re;
  double by_modes[6], moved[6] = {};
  soa::sum_columns(P_re, modal->accel, b.n_modes, by_modes);
  if (modal->C) soa::sum_columns(modal->C, modal->accel, b.n_modes, moved);
  Force<double> f = ws_.z(k) + soa::force_column(by_modes, 0) + core.P * (core.delta + soa::motion_column(moved, 0));
  if (modal->by_nodes)  // its P and z hold nothing of them but e
    for (const int c : flexible.attached) f += through_root(*ws_.modal_of(c)->root) - soa::force_column(ws_.modal_of(c)->root->e, 0);
  return f;
}

// The wrench that a body receives through its inboard hinge, referred to the sweep frame that carries it.
Force<double> Observer::wrench_in_host(int i) const {
  const UserBody& u = model_.user[i];
  if (!u.merged) return wrench_on_sweep_body(u.sweep);
  const soa::Core<double>& host = ws_.core(u.sweep);
  const Motion<double> gamma = host.gamma + host.delta;
  const RigidInertia<double> M = to_inboard(u.pose, u.M);
  Force<double> f = M * gamma + gyroscopic(M, host.w);
  if (in_.gravity && model_.field.pulls() && M.m > 0) {
    Vec3<double> c, r;
    const RigidInertia<double>& all = inertia_[u.sweep];
    if (model_.field.gradient || u.sweep == 0) {  // what is fixed to the world is not one of the bodies that are pulled
      f -= soa::attraction(model_.field, M, ws_.pose_W(u.sweep), c, r, in_.moment);
    } else {  // its share of the pull at the mass centre of all
      const Vec3<double> pull = (M.m / all.m) * soa::attraction(model_.field, all, ws_.pose_W(u.sweep), c, r, in_.moment).f;
      f -= Force<double>{cross((1.0 / M.m) * M.h, pull), pull};
    }
  }
  for (const NodeWrench& load : in_.wrenches) {
    const UserNode& node = model_.nodes[load.node];
    if (node.body != i) continue;
    f -= wrench_at_B(model_, ws_, load);
  }
  for (std::size_t c = 0; c < model_.user.size(); ++c) {
    const UserBody& child = model_.user[c];
    if (child.parent != i) continue;
    const Force<double> through = wrench_in_host(static_cast<int>(c));
    f += child.merged ? through : to_inboard(soa::pose_in_inboard(model_, ws_, child.sweep, in_.q), through);
  }
  return f;
}

Force<double> Observer::hinge_wrench(int i) const {
  const UserBody& u = model_.user[i];
  const Force<double> f = wrench_in_host(i);
  const SweepBody& b = model_.bodies[u.sweep];
  Pose<double> P = u.pose * u.pnode;
  if (!u.merged && b.pnode >= 0) {
    const NodeShapes& shapes = model_.shapes[b.pnode];
    P = shapes.pose;
    if (shapes.deforms()) {
      soa::DeformedNode<double> at{};
      soa::deform<double>(model_, ws_, u.sweep, shapes, in_.q, in_.v, at);
      P = {at.R, at.rho};
    }
  }
  return to_outboard(P, f);
}

void Observer::prescribed_forces(double* tau) const {
  for (int i = 0; i < model_.nv; ++i) tau[i] = 0.0;
  if (!model_.has_prescribed()) return;
  if (inverse_) {  // prescribed modes: their forces are the modal rows of inverse dynamics
    Inputs in = in_;
    in.vdot = vdot_;
    inverse_dynamics(model_, *inverse_, in, all_tau_.data());
    for (int i = 0; i < model_.nv; ++i)
      if (model_.prescribed[i]) tau[i] = all_tau_[i];
  } else {
    for (int k = 1; k < static_cast<int>(model_.bodies.size()); ++k) {
      const SweepBody& b = model_.bodies[k];
      if (!b.has_prescribed) continue;
      const Force<double> f = wrench_on_sweep_body(k);
      for (int j = 0; j < b.nv; ++j)
        if (model_.prescribed[b.v + j]) tau[b.v + j] = dot(soa::hinge_column(model_, ws_, k, j), f);
    }
  }
  const std::span<const double> pushed = loop_forces(ws_).tau;  // by couplings, beside what is applied
  for (std::size_t i = 0; i < pushed.size(); ++i)
    if (model_.prescribed[i]) tau[i] -= pushed[i] - (in_.tau ? in_.tau[i] : 0.0);
}

// Sum of m x over all bodies, world axes, gathered from the tips to the ground like a force. Rotors are in the inertias of their carriers.
Vec3<double> Observer::first_moment() {
  std::ranges::fill(moment_, Vec3<double>{});
  for (int k = static_cast<int>(model_.bodies.size()) - 1; k > 0; --k) {
    const AxisBody& a = model_.axis_bodies[k];
    Vec3<double> r = moment_[k];  // about B, of the mass outboard of the hinge
    if (is_axis(a.kind)) {
      if (a.kind == BodyKernel::rotor) continue;
      r += Vec3<double>{a.h[0], a.h[1], a.h[2]};
      soa::for_axis(a.kind, [&]<int I, soa::Tilt TILT>() {
        soa::turn<I>(r, ws_.cosines[a.angle], ws_.sines[a.angle]);
        soa::tilt<TILT, double>(a, r);
      });
      moment_[a.parent] += r + mass_[k] * Vec3<double>{a.p[0], a.p[1], a.p[2]};
    } else {
      const SweepBody& b = model_.bodies[k];
      r += b.n_modes > 0 ? ws_.modal_of(k)->M_rr.h : b.M_sweep.h;
      moment_[b.parent] += ws_.X(k).R * r + mass_[k] * ws_.X(k).p;
    }
  }
  return moment_[0];
}

// What the inward sweep gathers at the ground are the wrenches that it transmits through root hinges.
ExternalLoads Observer::external(const Inputs& in, const double* vdot) {
  look(in, vdot);
  const Force<double>& transmitted = ws_.z(0);
  ExternalLoads e{to_eigen(transmitted.f), to_eigen(transmitted.n), 0.0};
  const auto add = [&](const Force<double>& in_W) {
    e.force += to_eigen(in_W.f);
    e.moment += to_eigen(in_W.n);
  };
  if (in.gravity && model_.field.uniform) {
    if (!model_.devices.varying.empty()) weigh();
    e.force += mass_[0] * model_.gravity.g;
    e.moment += to_eigen(first_moment()).cross(model_.gravity.g);
  }
  if (!in_.wrenches.empty() && !poses_given_) soa::sweeps<double>().world(model_, ws_, in);
  const bool pulls = in.gravity && model_.field.pulls(), works = pulls && !pulls_with_energy(model_.field);
  for (int k = 1; pulls && k < static_cast<int>(model_.bodies.size()); ++k) {
    const Pose<double>& W = ws_.pose_W(k);
    const RigidInertia<double> M = inertia_for_gravity(k);
    if (M.m <= 0) continue;
    Vec3<double> c, r;
    const Force<double> pull = soa::attraction(model_.field, M, W, c, r, in.moment);
    add(to_inboard(W, pull));
    if (!works) continue;
    e.power += dot(ws_.V(k), pull);
    const SweepBody& b = model_.bodies[k];
    if (b.n_modes == 0) continue;
    const soa::FieldPull<double> at_centre = soa::pull_of_source(model_.field, in.moment, M, W);
    const FlexibleBody& f = model_.flexible[b.flexible];
    const auto n = static_cast<std::size_t>(b.n_modes);
    gravity_work_.resize(std::max(gravity_work_.size(), 16 + 9 * n + n * n));
    double* force = gravity_work_.data();
    soa::Modal<double> modal{};  // with M_re as it is before the inward sweep
    modal.accel = force + n, modal.b = modal.accel + n;
    if (!f.M_re_constant) {
      double* mass = modal.b + 6 + n;
      f.family->mass(f.packed.data(), in.q + b.eta, mass, mass + 10, mass + 10 + 6 * n);
      modal.P_re = mass + 10;
    }
    std::fill_n(force, n, 0.0);
    const auto on_modes = soa::pull_on_modes<double>((1.0 / M.m) * at_centre.force, (1.0 / M.m) * M.h, at_centre.gradient);
    soa::add_pull_on_modes(f, modal, b.n_modes, in.q + b.eta, on_modes, 1.0, force);
    e.power += std::inner_product(force, force + n, in.v + b.etadot, 0.0);
  }
  for (const NodeWrench& load : in_.wrenches) {
    const UserNode& node = model_.nodes[load.node];
    const int k = model_.user[node.body].sweep;
    if (k == 0) continue;
    const soa::DeformedNode<double> at = deformed(model_, ws_, node, in_);
    const Pose<double> N = ws_.pose_W(k) * Pose<double>{at.R, at.rho};
    const Force<double> f = load.world_axes ? load.f : Force<double>{N.R * load.f.n, N.R * load.f.f};  // world axes, at the node
    add({f.n + cross(N.p, f.f), f.f});
    const Motion<double> at_node = velocity_at(ws_.V(k), at);
    e.power += dot(Motion<double>{ws_.pose_W(k).R * at_node.w, ws_.pose_W(k).R * at_node.v}, f);
  }
  e.power += actuator_power();
  if (model_.loops.n_drives > 0) e.power += loop_power(model_, ws_, in_.drives, true);  // those of others are loads, above
  return e;
}

void Observer::prescribed_forces(const Inputs& in, const double* vdot, double* tau) {
  look(in, vdot);
  prescribed_forces(tau);
}

double Observer::internal_power(const Inputs& in, const double* vdot) {
  look(in, vdot);
  return actuator_power();
}

double Observer::actuator_power() const {
  double power = 0.0;
  if (in_.tau)
    for (int i = 0; i < model_.nv; ++i)
      if (!model_.has_prescribed() || !model_.prescribed[i]) power += in_.tau[i] * in_.v[i];
  for (std::size_t i = 0; i < model_.loads.size(); ++i) {  // tau holds their forces too; the stored part is in the energy
    const HingeLoad& load = model_.loads[i];
    power -= hinge_laws::force(load, loads_at_ ? loads_at_[i] : in_.q[load.q], 0.0) * in_.v[load.v];
  }
  if (model_.has_prescribed()) {
    std::vector<double>& tau = prescribed_tau_;
    prescribed_forces(tau.data());
    for (int i = 0; i < model_.nv; ++i) power += tau[i] * in_.v[i];
  }
  for (const SweepBody& b : model_.bodies) {  // modal dampers take energy out
    if (b.n_modes == 0) continue;
    const FlexibleBody& f = model_.flexible[b.flexible];
    const double* rate = in_.v + b.etadot;
    for (int j = 0; j < b.n_modes; ++j) {
      if (f.K_diagonal) {
        power -= f.C[j] * rate[j] * rate[j];
        continue;
      }
      for (int i = 0; i < b.n_modes; ++i) power -= f.C[b.n_modes * j + i] * rate[j] * rate[i];
    }
  }
  return power;
}

}  // namespace cardan
