#include "core/operators/operational_space.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <limits>

#include "core/dynamics/node_motion.hpp"
#include "core/linalg/dense.hpp"
#include "core/operators/mass_matrix.hpp"

namespace cardan::operators {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

int body_of(const TreeOperators& tree, int node) { return tree.index_of(tree.model().nodes[node].sweep); }

/// psi(p, i) W, p the inboard body of i.
void walk(const TreeOperators& tree, int i, MatrixXd& W) {
  W -= (tree.G(i) * (tree.Ht(i).transpose() * W)).eval();
  W = (tree.A(i).transpose() * W.topRows<6>()).eval();
}

void expect_size(const char* what, Eigen::Index want, Eigen::Index got) {
  if (got != want) refuse(Code::operator_shape, {what}, fmt::format("{} numbers", want), fmt::format("{}", got));
}

VectorXd free_part(const TreeOperators& tree, VectorXd x) {
  for (int j = 0; j < x.size(); ++j)
    if (!tree.is_free(j)) x[j] = 0.0;
  return x;
}

constexpr double kNoMotion = 1e-14;  // of a mobility: what rounding leaves where motions cancel

/// Of each row of a task: sum of |T B*| times `reach`, how far the numbers of the body space move. What is far below cancels.
VectorXd sizes(const TreeOperators& tree, const Task& task, const VectorXd& reach) {
  VectorXd of_nodes(6 * static_cast<Eigen::Index>(task.nodes.size()));
  for (std::size_t j = 0; j < task.nodes.size(); ++j) {
    const OperatorBody& b = tree.bodies()[body_of(tree, task.nodes[j])];
    of_nodes.segment<6>(6 * static_cast<Eigen::Index>(j)) = tree.Bt(task.nodes[j]).cwiseAbs() * reach.segment(b.at, 6 + b.m);
  }
  return task.T.size() > 0 ? VectorXd(task.T.cwiseAbs() * of_nodes) : of_nodes;
}

/// Roots of the mobilities of bodies, body space.
VectorXd reach_of_bodies(const TreeOperators& tree) {
  VectorXd reach(tree.size(Space::body));
  for (int i = 0; i < static_cast<int>(tree.bodies().size()); ++i)
    reach.segment(tree.bodies()[i].at, 6 + tree.bodies()[i].m) = tree.Y(i).diagonal().cwiseMax(0.0).cwiseSqrt();
  return reach;
}

MatrixXd task_compliance(const TreeOperators& tree, const Task& task) {
  const MatrixXd C = compliance(tree, task.nodes);
  return task.T.size() > 0 ? MatrixXd(task.T * C * task.T.transpose()) : C;
}

void require_task(const TreeOperators& tree, const Task& task) {
  tree.require_nodes(task.nodes);
  const auto all = 6 * static_cast<Eigen::Index>(task.nodes.size());
  if (task.T.size() > 0) expect_size("columns of the task's matrix", all, task.T.cols());
}

}  // namespace

// Every node carries W = psi(c, body) B(node) inboard; where it meets another, c is their nearest common ancestor.
MatrixXd compliance(const TreeOperators& tree, std::span<const int> nodes) {
  tree.require(Kind::Y);
  tree.require_nodes(nodes);
  const int s = static_cast<int>(nodes.size());
  MatrixXd C = MatrixXd::Zero(6 * s, 6 * s);
  std::vector<MatrixXd> W(s);
  std::vector<std::vector<int>> arrived(tree.bodies().size());
  const auto meet = [&](int body, int a) {  // a with those that are here, then a is here
    std::vector<int>& here = arrived[body];
    if (!here.empty()) {
      const MatrixXd YW = tree.Y(body) * W[a];
      for (const int b : here) C.block<6, 6>(6 * b, 6 * a).noalias() = W[b].transpose() * YW;
    }
  };
  for (int a = 0; a < s; ++a) {
    const int body = body_of(tree, nodes[a]);
    W[a] = tree.Bt(nodes[a]).transpose();
    meet(body, a);
    const MatrixXd own = W[a].transpose() * tree.Y(body) * W[a];
    C.block<6, 6>(6 * a, 6 * a) = 0.5 * (own + own.transpose());
    arrived[body].push_back(a);
  }
  for (int i = static_cast<int>(tree.bodies().size()) - 1; i >= 0; --i) {
    const int p = tree.bodies()[i].parent;
    if (p < 0 || arrived[i].empty()) continue;
    std::vector<int> here = std::move(arrived[i]);
    for (const int a : here) {
      walk(tree, i, W[a]);
      meet(p, a);
    }
    arrived[p].insert(arrived[p].end(), here.begin(), here.end());
  }
  for (int a = 0; a < s; ++a)
    for (int b = 0; b < a; ++b) {  // each pair met once, in either order
      const auto upper = C.block<6, 6>(6 * b, 6 * a), lower = C.block<6, 6>(6 * a, 6 * b);
      const Eigen::Matrix<double, 6, 6> block = upper + lower.transpose();
      C.block<6, 6>(6 * b, 6 * a) = block, C.block<6, 6>(6 * a, 6 * b) = block.transpose();
    }
  return C;
}

MatrixXd omega_block(const TreeOperators& tree, int a, int b) {
  tree.require(Kind::Y);
  const int n = static_cast<int>(tree.bodies().size());
  for (const int i : {a, b})
    if (i < 0 || i >= n) refuse(Code::unknown_body, {"block of Omega"}, fmt::format("an index below {}", n), fmt::format("{}", i));
  const auto size = [&](int i) { return 6 + tree.bodies()[i].m; };
  MatrixXd Wa = MatrixXd::Identity(size(a), size(a)), Wb = MatrixXd::Identity(size(b), size(b));
  for (int i = a, j = b;;) {
    if (i == j) return Wa.transpose() * tree.Y(i) * Wb;
    int& outer = i > j ? i : j;  // parents have lower indices
    const int parent = tree.bodies()[outer].parent;
    if (parent < 0) return MatrixXd::Zero(size(a), size(b));
    walk(tree, outer, i > j ? Wa : Wb);
    outer = parent;
  }
}

Task Task::of_rows(std::vector<int> nodes, std::span<const int> rows) {
  Task out{std::move(nodes), {}};
  const int all = out.rows();
  out.T = MatrixXd::Zero(static_cast<Eigen::Index>(rows.size()), all);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    if (rows[r] < 0 || rows[r] >= all)
      refuse(Code::out_of_range, {"rows of a task"}, fmt::format("0 ... {}", all - 1), fmt::format("{}", rows[r]));
    out.T(static_cast<Eigen::Index>(r), rows[r]) = 1.0;
  }
  return out;
}

VectorXd task_rates(const TreeOperators& tree, const Task& task, const VectorXd& v) {
  require_task(tree, task);
  const VectorXd V = body_velocities(tree, v);
  VectorXd rates(6 * static_cast<Eigen::Index>(task.nodes.size()));
  tree.apply_nodes(task.nodes, true, V.data(), rates.data());
  return task.T.size() > 0 ? VectorXd(task.T * rates) : rates;
}

VectorXd task_forces(const TreeOperators& tree, const Task& task, const VectorXd& F) {
  require_task(tree, task);
  expect_size("forces of a task", task.rows(), F.size());
  const VectorXd wrenches = task.T.size() > 0 ? VectorXd(task.T.transpose() * F) : F;
  VectorXd f(tree.size(Space::body));
  tree.apply_nodes(task.nodes, false, wrenches.data(), f.data());
  return hinge_forces(tree, std::move(f));
}

MatrixXd task_jacobian(const TreeOperators& tree, const Task& task) {
  MatrixXd J(task.rows(), tree.size(Space::hinge));
  for (int r = 0; r < task.rows(); ++r) J.row(r) = free_part(tree, task_forces(tree, task, VectorXd::Unit(task.rows(), r))).transpose();
  return J;
}

VectorXd task_bias(const TreeOperators& tree, const Task& task, Workspace& ws, const VectorXd& v) {
  require_task(tree, task);
  require_size(tree, "velocities", Space::hinge, v.size());
  const Model& model = tree.model();
  const VectorXd all = tree.to_model(v), none = VectorXd::Zero(model.nv);
  const Inputs in{.q = tree.q().data(), .v = all.data(), .vdot = none.data(), .gravity = false};
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  ws.require_world();
  outward(model, S, ws, in, {.vdot = true, .inertia = false}, tree.part());
  world(model, S, ws, in, tree.part());
  VectorXd a(6 * static_cast<Eigen::Index>(task.nodes.size()));
  for (std::size_t j = 0; j < task.nodes.size(); ++j)
    a.segment<6>(6 * static_cast<Eigen::Index>(j)) =
        to_eigen(node_motion<double>(model, ws, in, task.nodes[j], none.data(), After::inverse).acceleration);
  return task.T.size() > 0 ? VectorXd(task.T * a) : a;
}

OperationalSpace::OperationalSpace(const TreeOperators& tree, Task task, const TreeOperators* passive, double tolerance)
    : tree_(&tree), passive_(passive), task_(std::move(task)) {
  require_task(tree, task_);
  compliance_ = task_compliance(tree, task_);
  if (passive) {
    if (passive->model_pointer() != tree.model_pointer() || passive->size(Space::hinge) != tree.size(Space::hinge) ||
        passive->q() != tree.q())
      refuse(Code::operator_shape, {"operational space"}, "a second tree of the same bodies at the same q", "another");
    compliance_ -= task_compliance(*passive, task_);
  }
  invert(tolerance, kNoMotion * sizes(tree, task_, reach_of_bodies(tree)).cwiseAbs2());
}

OperationalSpace::OperationalSpace(const ClosedSystem& closed, Task task, double tolerance)
    : tree_(&closed.tree()), closed_(&closed), task_(std::move(task)) {
  require_task(*tree_, task_);
  MatrixXd JY(task_.rows(), closed.mobility());
  VectorXd reach = VectorXd::Zero(tree_->size(Space::body));
  for (int j = 0; j < closed.mobility(); ++j) {
    JY.col(j) = task_rates(*tree_, task_, closed.motions().col(j));
    reach += body_velocities(*tree_, closed.motions().col(j)).cwiseAbs();
  }
  compliance_ = JY * JY.transpose();
  const VectorXd by_hinges = (task_jacobian(*tree_, task_).cwiseAbs() * closed.motions().cwiseAbs()).rowwise().sum();
  invert(tolerance, (kNoMotion * (sizes(*tree_, task_, reach) + by_hinges)).cwiseAbs2());
}

// `rounding`: what it leaves in the diagonal of rows that cannot move.
void OperationalSpace::invert(double tolerance, const VectorXd& rounding) {
  const int r = rows();
  VectorXd unit(r);  // 1 / scale; rows that cannot move stay as they are
  for (int i = 0; i < r; ++i) unit[i] = compliance_(i, i) > rounding[i] ? 1.0 / std::sqrt(compliance_(i, i)) : 0.0;
  const DensePairs eigen = symmetric_pairs(unit.asDiagonal() * compliance_ * unit.asDiagonal());
  VectorXd weights = VectorXd::Zero(r);
  const double limit = r > 0 ? tolerance * std::max(eigen.values[r - 1], 0.0) : 0.0;
  for (int i = r - 1; i >= 0 && eigen.values[i] > limit; --i) {
    weights[i] = 1.0 / eigen.values[i];
    condition_ = eigen.values[r - 1] * weights[i];
    ++rank_;
  }
  inertia_ = unit.asDiagonal() * eigen.vectors * weights.asDiagonal() * eigen.vectors.transpose() * unit.asDiagonal();
}

void OperationalSpace::require_full_rank() const {
  if (rank_ == rows()) return;
  throw NumericsError({.code = Code::singular_task,
                       .what = fmt::format("rank {} of {} rows", rank_, rows()),
                       .hint = "fewer rows, or another posture; the generalised inverse is there all the same"});
}

VectorXd OperationalSpace::actuated(VectorXd x) const {
  require_size(*tree_, "a vector of the hinge space", Space::hinge, x.size());
  for (int j = 0; j < x.size(); ++j)
    if (!tree_->is_free(j) || (passive_ && passive_->is_free(j))) x[j] = 0.0;
  return x;
}

// J_g v = J (v_a - M_pp^-1 M_pa v_a) and its adjoint.
VectorXd OperationalSpace::rates(const VectorXd& v) const {
  const VectorXd own = actuated(v);
  if (!passive_) return task_rates(*tree_, task_, own);
  return task_rates(*tree_, task_, own - inverse_mass_times(*passive_, mass_times(*tree_, own)));
}

VectorXd OperationalSpace::forces(const VectorXd& F) const {
  const VectorXd tau = task_forces(*tree_, task_, F);
  return actuated(passive_ ? VectorXd(tau - mass_times(*tree_, inverse_mass_times(*passive_, tau))) : tau);
}

// M_g^-1 is the block of M^-1.
VectorXd OperationalSpace::respond(const VectorXd& tau) const {
  return closed_ ? closed_->respond(tau) : actuated(inverse_mass_times(*tree_, actuated(tau)));
}

VectorXd OperationalSpace::consistent_inverse(const VectorXd& x) const {
  expect_size("rates of a task", rows(), x.size());
  return respond(forces(inertia_ * x));
}

VectorXd OperationalSpace::force_for(const VectorXd& wanted, const VectorXd& drift) const {
  expect_size("wanted accelerations of a task", rows(), wanted.size());
  expect_size("drift of a task", rows(), drift.size());
  return inertia_ * (wanted - drift);
}

VectorXd OperationalSpace::task_part(const VectorXd& tau) const { return inertia_ * rates(respond(tau)); }

VectorXd OperationalSpace::null_motion(const VectorXd& v) const { return actuated(v - consistent_inverse(rates(v))); }

VectorXd OperationalSpace::null_forces(const VectorXd& tau) const { return actuated(tau - forces(task_part(tau))); }

double effective_inertia(const TreeOperators& tree, int node, const Eigen::Matrix<double, 6, 1>& u) {
  const MatrixXd C = compliance(tree, std::span(&node, 1));
  const double mobility = u.dot(C * u), most = u.cwiseAbs().dot(sizes(tree, {{node}, {}}, reach_of_bodies(tree)));
  return mobility > kNoMotion * most * most ? 1.0 / mobility : std::numeric_limits<double>::infinity();
}

Manipulability manipulability(const TreeOperators& tree, const Task& task) {
  const MatrixXd J = task_jacobian(tree, task);
  Manipulability out{};
  if (J.size() > 0) out.singular_values = singular_values(J);
  out.kinematic = J.rows() <= J.cols() ? out.singular_values.prod() : 0.0;
  out.dynamic = J.rows() <= J.cols() ? std::sqrt(std::max(determinant(task_compliance(tree, task)), 0.0)) : 0.0;
  return out;
}

Participation participation(const TreeOperators& tree, int node, const Eigen::Matrix<double, 6, 1>& u) {
  const Task task{{node}, {}};
  Participation out;
  out.shape = free_part(tree, task_forces(tree, task, u));
  out.response = inverse_mass_times(tree, out.shape);
  out.share = out.shape.cwiseProduct(out.response);
  const double mobility = out.share.sum();
  if (!(mobility > 1e-14 * out.share.cwiseAbs().sum()))
    throw NumericsError({.code = Code::singular_task,
                         .body = tree.model().nodes[node].name,
                         .what = "u* Lambda^-1 u = 0",
                         .hint = "the node cannot move along u"});
  out.share /= mobility;
  return out;
}

}  // namespace cardan::operators
