#include "core/operators/hybrid.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "core/dynamics/inverse.hpp"
#include "core/dynamics/node_motion.hpp"
#include "core/operators/mass_matrix.hpp"
#include "core/operators/system_properties.hpp"

namespace cardan::operators {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

bool is_free(Drive drive) { return drive == Drive::forced || drive == Drive::passive; }
/// What the hinge of a rotor transmits, at its origin: the sweeps know of its carrier only. After inverse dynamics.
Force<double> force_on_rotor(const Model& model, const Workspace& ws, const Inputs& in, int k) {
  const BodyMotion<double> moves = motion_of_body(model, ws, in, k, in.vdot, After::inverse);
  return bias_of_rotor(model, ws, in, k, moves.w, moves.gamma + moves.delta);
}

}  // namespace

std::vector<std::uint8_t> free_mask(std::span<const Drive> drives) {
  std::vector<std::uint8_t> mask(drives.size());
  std::transform(drives.begin(), drives.end(), mask.begin(), [](Drive d) { return static_cast<std::uint8_t>(is_free(d)); });
  return mask;
}

// The sweeps of forward dynamics (4.6) by blocks: gamma of the given components in place of gamma_b, forces of hinges by P+ delta+ + z+.
Hybrid hybrid_dynamics(const TreeOperators& tree, const VectorXd& bias, const VectorXd& tau, const VectorXd& vdot) {
  tree.require(Kind::D);
  require_size(tree, "bias", Space::hinge, bias.size());
  require_size(tree, "forces", Space::hinge, tau.size());
  require_size(tree, "accelerations", Space::hinge, vdot.size());
  const std::vector<OperatorBody>& bodies = tree.bodies();
  const int n = static_cast<int>(bodies.size());
  Hybrid out{vdot, tau};
  for (int j = 0; j < tau.size(); ++j)
    if (tree.is_free(j)) out.vdot[j] = 0.0;
  const VectorXd gamma = body_velocities(tree, out.vdot);  // that of the given components alone
  VectorXd z(gamma.size()), eps = tau - bias, nu(tau.size()), delta(gamma.size());
  tree.apply(Kind::M, false, gamma.data(), z.data());
  for (int i = n - 1; i >= 0; --i) {
    const OperatorBody& b = bodies[i];
    auto own = z.segment(b.at, 6 + b.m);
    auto innovation = eps.segment(b.v, b.nh + b.m);
    innovation.noalias() -= tree.Ht(i).transpose() * own;
    own.noalias() += tree.G(i) * innovation;  // z+
    if (b.parent < 0) continue;
    const OperatorBody& p = bodies[b.parent];
    z.segment(p.at, 6 + p.m).noalias() += tree.A(i).transpose() * z.segment<6>(b.at);
  }
  tree.apply_inverse(Kind::D, eps.data(), nu.data());
  VectorXd arriving, f;
  for (int i = 0; i < n; ++i) {
    const OperatorBody& b = bodies[i];
    arriving.setZero(6 + b.m);  // delta+
    if (b.parent >= 0) {
      const OperatorBody& p = bodies[b.parent];
      arriving.head<6>().noalias() = tree.A(i) * delta.segment(p.at, 6 + p.m);
    }
    const VectorXd solved = nu.segment(b.v, b.nh + b.m) - tree.G(i).transpose() * arriving;
    f.noalias() = tree.Ht_all(i).transpose() * (tree.P_plus(i) * arriving + z.segment(b.at, 6 + b.m));
    for (int j = 0; j < b.nh + b.m; ++j)
      if (tree.is_free(b.v + j))
        out.vdot[b.v + j] = solved[j];
      else
        out.tau[b.v + j] = f[j] + bias[b.v + j];
    delta.segment(b.at, 6 + b.m).noalias() = arriving + tree.Ht(i) * solved;
  }
  return out;
}

VectorXd inverse_dynamics(const TreeOperators& tree, Workspace& ws, const Inputs& in) {
  tree.require(Kind::H);
  const Model& model = tree.model();
  const auto taking_part = [&](const double* x) {
    return x ? tree.to_model(tree.from_model(Eigen::Map<const VectorXd>(x, model.nv))) : VectorXd(VectorXd::Zero(model.nv));
  };
  const VectorXd v = taking_part(in.v), vdot = taking_part(in.vdot);
  VectorXd tau(model.nv);
  Inputs use = in;
  use.q = tree.q().data(), use.v = v.data(), use.vdot = in.vdot ? vdot.data() : nullptr, use.tau = nullptr;
  cardan::inverse_dynamics(model, ws, use, tau.data(), {}, tree.part());
  return tree.from_model(tau);
}

VectorXd bias(const TreeOperators& tree, Workspace& ws, const Inputs& in) {
  Inputs use = in;
  use.vdot = nullptr;
  return inverse_dynamics(tree, ws, use);
}

VectorXd interbody_forces(const TreeOperators& tree, Workspace& ws, const Inputs& in) {
  const Model& model = tree.model();
  const VectorXd still = VectorXd::Zero(model.nv);
  Inputs use = in;
  use.q = tree.q().data();
  if (!in.v) use.v = still.data();
  if (!in.vdot) use.vdot = still.data();
  inverse_dynamics(tree, ws, use);
  VectorXd out(tree.size(Space::body));
  for (const OperatorBody& b : tree.bodies()) {
    const SweepBody& body = model.bodies[b.sweep];
    const Force<double> f = body.kind == BodyKernel::rotor ? force_on_rotor(model, ws, use, b.sweep) : ws.z(b.sweep);
    out.segment<6>(b.at) = to_eigen(to_outboard(model.user[b.user].pose, f));
    for (int j = 0; j < b.m; ++j) out[b.at + 6 + j] = ws.modal_of(b.sweep)->z[j];
  }
  return out;
}

Hybrid hybrid_dynamics(const TreeOperators& tree, std::span<const Drive> drives, Workspace& ws, const Inputs& in, const VectorXd& tau,
                       const VectorXd& vdot) {
  require_size(tree, "drives", Space::hinge, static_cast<Eigen::Index>(drives.size()));
  require_size(tree, "forces", Space::hinge, tau.size());
  require_size(tree, "accelerations", Space::hinge, vdot.size());
  VectorXd known_tau = tau, known_vdot = vdot;
  for (int j = 0; j < tree.model().nv; ++j) {
    const int place = tree.place_of_velocity(j);
    if (place < 0) continue;
    const Drive drive = drives[place];
    const auto name = [&] { return tree.labels(Space::hinge, Sort::motion).names[place]; };
    if (is_free(drive) != tree.is_free(place))
      refuse(Code::operator_shape, {"drive of " + name()}, "the mask that the tree was articulated with",
             is_free(drive) ? "free" : "not free", "articulate({.free = free_mask(drives)}) first");
    if (drive == Drive::passive) known_tau[place] = 0.0;
    if (drive == Drive::locked) known_vdot[place] = 0.0;
    if (drive == Drive::locked && in.v && in.v[j] != 0.0)
      refuse(Code::out_of_range, {"velocity of " + name()}, "0: it is locked", fmt::format("{:g}", in.v[j]));
  }
  return hybrid_dynamics(tree, bias(tree, ws, in), known_tau, known_vdot);
}

Unactuated::Unactuated(const TreeOperators& tree) : tree_(&tree) { tree.require(Kind::D); }

VectorXd Unactuated::of_actuated(const VectorXd& x) const {
  require_size(*tree_, "a vector of the hinge space", Space::hinge, x.size());
  VectorXd out = x;
  for (int j = 0; j < out.size(); ++j)
    if (tree_->is_free(j)) out[j] = 0.0;
  return out;
}

VectorXd Unactuated::velocities(const VectorXd& v, const VectorXd& momenta) const {
  const VectorXd own = of_actuated(v);
  VectorXd residual = -mass_times(*tree_, own);
  if (momenta.size() > 0) {
    require_size(*tree_, "momenta", Space::hinge, momenta.size());
    residual += momenta;
  }
  return own + inverse_mass_times(*tree_, residual);
}

VectorXd Unactuated::reduced_forces(const VectorXd& tau) const {
  require_size(*tree_, "forces", Space::hinge, tau.size());
  return of_actuated(tau - mass_times(*tree_, inverse_mass_times(*tree_, tau)));
}

VectorXd Unactuated::task_rates(const Task& task, const VectorXd& v, const VectorXd& momenta) const {
  return operators::task_rates(*tree_, task, velocities(v, momenta));
}

MatrixXd Unactuated::generalised_jacobian(const Task& task) const {
  MatrixXd J(task.rows(), tree_->size(Space::hinge));
  for (int r = 0; r < task.rows(); ++r) J.row(r) = reduced_forces(task_forces(*tree_, task, VectorXd::Unit(task.rows(), r))).transpose();
  return J;
}

VectorXd Unactuated::reduced_mass_times(const VectorXd& v) const { return of_actuated(mass_times(*tree_, velocities(v))); }

MatrixXd Unactuated::coupling() const {
  const int n = tree_->size(Space::hinge);
  MatrixXd out = MatrixXd::Zero(n, n);
  for (int j = 0; j < n; ++j)
    if (!tree_->is_free(j)) out.col(j) = -inverse_mass_times(*tree_, mass_times(*tree_, VectorXd::Unit(n, j)));
  return out;
}

std::vector<std::uint8_t> base_mask(const TreeOperators& tree) {
  std::vector<std::uint8_t> mask((tree.size(Space::hinge)), 0);
  for (const OperatorBody& b : tree.bodies())
    if (b.parent < 0) std::fill_n(mask.begin() + b.v, b.nh, std::uint8_t{1});
  return mask;
}

VectorXd base_momenta(const TreeOperators& tree, const Eigen::Matrix<double, 6, 1>& momentum) {
  tree.require(Kind::H);
  const auto roots = std::count_if(tree.bodies().begin(), tree.bodies().end(), [](const OperatorBody& b) { return b.parent < 0; });
  if (!tree.whole() || roots != 1 || tree.bodies()[0].nh != 6)
    refuse(Code::unsupported, {"momenta of the base"}, "one root on a hinge of six degrees", fmt::format("{} roots", roots));
  const OperatorBody& b = tree.bodies()[0];
  const Placement body = Placements(tree).reference;  // that of the root
  Eigen::Matrix<double, 6, 1> f;                      // at the base, its axes
  f << body.R.transpose() * (momentum.head<3>() - body.p.cross(Eigen::Vector3d(momentum.tail<3>()))),
      body.R.transpose() * momentum.tail<3>();
  VectorXd out = VectorXd::Zero(tree.size(Space::hinge));
  out.segment(b.v, 6).noalias() = tree.Ht_all(0).topLeftCorner(6, 6).transpose() * f;
  return out;
}

}  // namespace cardan::operators
