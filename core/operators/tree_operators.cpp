#include "core/operators/tree_operators.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "core/base/diagnostic.hpp"
#include "core/base/units.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan::operators {
namespace {

using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using soa::Tangent;
using ConstVector = Map<const VectorXd>;
using Vector = Map<VectorXd>;

/// The upper triangle of a symmetric matrix from the lower one.
void copy_upper_below(MatrixXd& a) {
  for (Eigen::Index j = 1; j < a.cols(); ++j)
    for (Eigen::Index i = 0; i < j; ++i) a(i, j) = a(j, i);
}

/// What is read of a number: itself, or its derivative.
double part(double x) { return x; }
double part(const Tangent& x) { return x.d; }

template <class T>
void store(const Motion<T>& V, double* out) {
  out[0] = part(V.w.x), out[1] = part(V.w.y), out[2] = part(V.w.z), out[3] = part(V.v.x), out[4] = part(V.v.y), out[5] = part(V.v.z);
}

/// Inertia of each rigid group in the user's frame of the body that owns it, which is that of the blocks: of a single body as it was given,
/// to the last bit.
std::vector<RigidInertia<double>> rigid_inertias(const Model& model) {
  std::vector<RigidInertia<double>> out(model.bodies.size());
  for (const UserBody& u : model.user) {
    if (u.sweep == 0 || u.n_modes > 0) continue;
    RigidInertia<double>& sum = out[u.sweep];
    sum = u.merged ? sum + to_inboard(inverse(model.user[model.owner[u.sweep]].pose) * u.pose, u.M) : sum + u.M;
  }
  return out;
}

/// H* of one rotation about an axis of P, user's frame. From the axis as it was given, not from the frame that the sweeps chose: where the
/// inertia about it is small, a last bit of its direction counts.
template <class T>
Motion<T> axis_column(const UserBody& u) {
  double axis[3], pitch;
  u.hinge->axis(u.hinge_packed.data(), axis, &pitch);
  return cast<T>(to_inboard(u.pnode, Motion<double>{{axis[0], axis[1], axis[2]}, {0.0, 0.0, 0.0}}));
}

/// The blocks of all bodies, or their derivatives, from a workspace that pose() has filled.
template <class T>
void read_blocks(const Model& model, const soa::Workspace<T>& ws, const T* q, PositionBlocks& out) {
  const std::size_t n = model.bodies.size();
  out.A.resize(n), out.Ht.resize(n), out.M.resize(n);
  const std::vector<RigidInertia<double>> rigid_bodies = rigid_inertias(model);
  const auto frame = [&](int k) { return k == 0 ? Pose<double>{} : model.user[model.owner[k]].pose; };
  for (int k = 1; k < static_cast<int>(n); ++k) {
    const SweepBody& b = model.bodies[k];
    const int m = b.n_modes, mp = b.parent > 0 ? model.bodies[b.parent].n_modes : 0;
    const Pose<T> to_user = cast<T>(frame(k)), from_parent = inverse(cast<T>(frame(b.parent)));
    const Pose<T> X_sweep = pose_in_inboard(model, ws, k, q), X = from_parent * X_sweep * to_user;
    Matrix6X& A = out.A[k];
    A.setZero(6, 6 + mp);
    for (int j = 0; j < 6; ++j) {
      Motion<T> unit{};
      (j == 0 ? unit.w.x : j == 1 ? unit.w.y : j == 2 ? unit.w.z : j == 3 ? unit.v.x : j == 4 ? unit.v.y : unit.v.z) = T(1);
      store(to_outboard(X, unit), A.col(j).data());
    }
    const soa::Modal<T>* modal = ws.modal_of(k);
    if (b.onode >= 0)
      soa::with_columns(model.shapes[b.onode], *modal->node, [&](const auto* s) {
        for (int j = 0; j < mp; ++j, s += 6) {
          const Vec3<T> turn = modal->node->Jl * Vec3<T>{T(s[0]), T(s[1]), T(s[2])};
          const Motion<T> in_A{turn, Vec3<T>{T(s[3]), T(s[4]), T(s[5])} - cross(turn, modal->node->rho)};
          store(to_outboard(to_user, to_outboard(X_sweep, in_A)), A.col(6 + j).data());
        }
      });
    MatrixXd& Ht = out.Ht[k];
    Ht.setZero(6 + m, b.nv + m);
    if (is_axis(b.kind))
      store(axis_column<T>(model.user[model.owner[k]]), Ht.col(0).data());
    else
      for (int j = 0; j < b.nv; ++j) store(to_outboard(to_user, hinge_column(model, ws, k, j)), Ht.col(j).data());
    for (int j = 0; j < m; ++j) {
      if (modal->C) store(-T(1) * to_outboard(to_user, soa::motion_column(modal->C, j)), Ht.col(b.nv + j).data());
      Ht(6 + j, b.nv + j) = part(T(1));
    }
    MatrixXd& M = out.M[k];
    M.setZero(6 + m, 6 + m);
    if (m == 0) {
      if constexpr (std::is_same_v<T, double>) M = to_eigen(articulated(rigid_bodies[k]));
      continue;
    }
    const RigidInertia<T>& rigid = modal->M_rr;
    const T mass[] = {rigid.m, rigid.h.x, rigid.h.y, rigid.h.z, rigid.J.xx, rigid.J.yy, rigid.J.zz, rigid.J.xy, rigid.J.xz, rigid.J.yz};
    double r[10];
    for (int i = 0; i < 10; ++i) r[i] = part(mass[i]);
    M.topLeftCorner<6, 6>() = to_eigen(articulated(RigidInertia<double>{r[0], {r[1], r[2], r[3]}, {r[4], r[5], r[6], r[7], r[8], r[9]}}));
    for (int j = 0; j < m; ++j) {
      const FlexibleBody& f = model.flexible[b.flexible];  // its frame is the user's
      for (int i = 0; i < 6; ++i) M(i, 6 + j) = M(6 + j, i) = part(modal->P_re ? modal->P_re[6 * j + i] : T(f.M_re[6 * j + i]));
      for (int i = 0; i < m; ++i) M(6 + i, 6 + j) = part(modal->P_ee ? modal->P_ee[m * j + i] : T(f.M_ee[m * j + i]));
    }
  }
}

/// B* of a node: [X_j, Gamma_j] in node axes (mathematics 3.1).
Matrix6X node_block(const Model& model, const UserNode& node, const Pose<double>& body_frame, const double* q) {
  const SweepBody& b = model.bodies[node.sweep];
  Matrix6X Bt = Matrix6X::Zero(6, 6 + b.n_modes);
  Pose<double> N = node.shapes.pose;
  if (node.shapes.deforms()) {
    double x[6];
    std::vector<double> curved;
    const double* S = node.shapes.columns.data();
    if (node.shapes.is_curved()) {
      curved.resize(static_cast<std::size_t>(6 * b.n_modes));
      soa::family_node(model.flexible[b.flexible], b.n_modes, node.shapes.curved, q + b.eta, nullptr, nullptr, x, curved.data(), nullptr);
      S = curved.data();
    } else {
      soa::sum_columns(S, q + b.eta, node.shapes.n_modes, x);
    }
    const Vec3<double> theta{x[0], x[1], x[2]};
    const auto c = cardan::rotation_coefficients<double>(dot(theta, theta));
    N = {rotation_of_vector(c, theta) * node.shapes.pose.R, node.shapes.pose.p + Vec3<double>{x[3], x[4], x[5]}};
    for (int j = 0; j < b.n_modes; ++j) {
      const double* s = S + 6 * j;
      const Vec3<double> turn = left_jacobian(c, theta, {s[0], s[1], s[2]});
      Bt.col(6 + j) = to_eigen(Motion<double>{transpose_times(N.R, turn), transpose_times(N.R, Vec3<double>{s[3], s[4], s[5]})});
    }
  }
  const Pose<double> in_user = inverse(body_frame) * N;
  for (int j = 0; j < 6; ++j) {
    double unit[6] = {};
    unit[j] = 1.0;
    Bt.col(j) = to_eigen(to_outboard(in_user, motion(unit)));
  }
  return Bt;
}

}  // namespace

struct TreeOperators::Sweeping {
  explicit Sweeping(const Model& model) : position(model), zeros(model.nv, 0.0) {}
  Workspace position;                  // of the blocks and the mass matrix
  std::unique_ptr<Workspace> inertia;  // of the inverse, once it was asked for: P, D, G stay there
  std::vector<double> zeros;
  bool articulated = false;
};

TreeOperators::TreeOperators(std::shared_ptr<const Model> model) {
  model_ = std::move(model);
  if (!model_) refuse(Code::empty_system, {"operators"}, "a compiled model", "none");
  require_open_tree(*model_, "spatial operators and what is made of them, as task space, hybrid dynamics and modes of the whole,");
  std::vector<int> all;
  for (int k = 1; k < static_cast<int>(model_->bodies.size()); ++k) all.push_back(k);
  number(all);
  sweeping_ = std::make_unique<Sweeping>(*model_);
}
TreeOperators::~TreeOperators() = default;
TreeOperators::TreeOperators(TreeOperators&&) noexcept = default;

void TreeOperators::number(const std::vector<int>& sweep_bodies) {
  index_.assign(model_->bodies.size(), -1);
  place_.assign(model_->nv, -1);
  bodies_.clear();
  for (const int k : sweep_bodies) {  // ascending: inboard before outboard
    const SweepBody& b = model_->bodies[k];
    index_[k] = static_cast<int>(bodies_.size());
    bodies_.push_back({.sweep = k, .user = model_->owner[k], .parent = b.parent > 0 ? index_[b.parent] : -1, .nh = b.nv, .m = b.n_modes});
  }
  n_hinge_ = n_body_ = 0;
  for (std::size_t u = 0; u < model_->user.size(); ++u) {  // places: the user's order
    const UserBody& user = model_->user[u];
    if (user.merged || user.sweep == 0 || index_of(user.sweep) < 0) continue;
    OperatorBody& b = bodies_[index_of(user.sweep)];
    b.at = n_body_, n_body_ += 6 + b.m;
    b.v = n_hinge_, b.etadot = n_hinge_ + b.nh, n_hinge_ += b.nh + b.m;
    for (int j = 0; j < b.nh; ++j) place_[user.v + j] = b.v + j;
    for (int j = 0; j < b.m; ++j) place_[user.etadot + j] = b.etadot + j;
  }
  n_rate_ = n_hinge_;
  nodes_.clear();
  for (std::size_t j = 0; j < model_->nodes.size(); ++j)
    if (const int k = model_->nodes[j].sweep; k > 0 && index_of(k) >= 0) nodes_.push_back(static_cast<int>(j));
  int widest = 6;
  for (const OperatorBody& b : bodies_) widest = std::max(widest, 6 + b.nh + b.m);
  work_.resize(3 * widest);
}

TreeOperators TreeOperators::subgraph(std::vector<int> sweep_bodies) const {
  std::sort(sweep_bodies.begin(), sweep_bodies.end());
  sweep_bodies.erase(std::unique(sweep_bodies.begin(), sweep_bodies.end()), sweep_bodies.end());
  for (const int k : sweep_bodies)
    if (k < 1 || k >= static_cast<int>(index_.size()) || index_of(k) < 0)
      refuse(Code::unknown_body, {"subgraph"}, "bodies of the tree", fmt::format("sweep index {}", k));
  TreeOperators sub;
  sub.model_ = model_;
  sub.q_ = q_;
  sub.position_ = position_;
  sub.has_position_ = has_position_;
  sub.whole_ = false;
  sub.part_ = std::make_shared<const Part>(part_of(*model_, sweep_bodies));
  sub.number(sweep_bodies);
  return sub;
}

VectorXd TreeOperators::to_model(const VectorXd& x) const {
  VectorXd out = VectorXd::Zero(model_->nv);
  for (int v = 0; v < model_->nv; ++v)
    if (place_of_velocity(v) >= 0) out[v] = x[place_of_velocity(v)];
  return out;
}
VectorXd TreeOperators::from_model(const VectorXd& x) const {
  VectorXd out(n_hinge_);
  for (int v = 0; v < model_->nv; ++v)
    if (place_of_velocity(v) >= 0) out[place_of_velocity(v)] = x[v];
  return out;
}
std::vector<int> TreeOperators::sweep_bodies() const {
  std::vector<int> out;
  for (const OperatorBody& b : bodies_) out.push_back(b.sweep);
  return out;
}

std::vector<int> TreeOperators::subtree(int sweep_body) const {
  require_body(sweep_body);
  std::vector<int> out{sweep_body};
  for (int k = sweep_body + 1; k < static_cast<int>(model_->bodies.size()); ++k)
    if (std::binary_search(out.begin(), out.end(), model_->bodies[k].parent)) out.push_back(k);
  return out;
}

void TreeOperators::require_body(int sweep_body) const {
  if (sweep_body < 0 || sweep_body >= static_cast<int>(model_->bodies.size()))
    refuse(Code::unknown_body, {"operators"}, fmt::format("a sweep index below {}", model_->bodies.size()), fmt::format("{}", sweep_body));
}

std::vector<int> TreeOperators::path(int a, int b) const {
  require_body(a), require_body(b);
  std::vector<int> out;
  while (a != b) {  // parents have lower indices
    int& deeper = a > b ? a : b;
    out.push_back(deeper);
    deeper = model_->bodies[deeper].parent;
  }
  if (a > 0) out.push_back(a);
  std::sort(out.begin(), out.end());
  return out;
}

void TreeOperators::at(const double* q) {
  if (!whole_) refuse(Code::unsupported, {"operators"}, "the whole tree", "a subgraph", "move the tree, then take the subgraph again");
  const Model& model = *model_;
  if (!q && model.nq > 0) refuse(Code::operator_shape, {"operators"}, "q", "a null pointer");
  q_.assign(q, q + model.nq);
  outward(model, soa::sweeps<double>(), sweeping_->position, Inputs{.q = q, .v = sweeping_->zeros.data(), .gravity = false},
          {.velocity = false});
  // The memory of the last q, unless a subgraph holds on to it.
  auto blocks = position_ && position_.use_count() == 1 ? std::move(position_) : std::make_shared<PositionBlocks>();
  read_blocks(model, sweeping_->position, q, *blocks);
  blocks->Bt.resize(model.nodes.size());
  for (std::size_t j = 0; j < model.nodes.size(); ++j)
    if (const UserNode& node = model.nodes[j]; node.sweep > 0)
      blocks->Bt[j] = node_block(model, node, model.user[model.owner[node.sweep]].pose, q);
  position_ = std::move(blocks);
  has_position_ = true;
  has_inertia_ = has_operational_space_ = has_direction_ = false;
  sweeping_->articulated = false;
  masked_ = weighted_ = false;
  free_.clear();
}

void TreeOperators::derivatives(const double* u, PositionBlocks& out) const {
  require(Kind::H);
  const Model& model = *model_;
  std::vector<double> rate(model.nq);
  model.qdot(q_.data(), u, rate.data());
  std::vector<Tangent> q(model.nq), zeros(model.nv, Tangent(0.0));
  for (std::size_t i = 0; i < q.size(); ++i) q[i] = {q_[i], rate[i]};
  if (!tangent_) tangent_ = std::make_unique<soa::Workspace<Tangent>>(model);
  outward(model, soa::sweeps<Tangent>(), *tangent_, {.q = q.data(), .v = zeros.data(), .gravity = false}, {.velocity = false});
  read_blocks(model, *tangent_, q.data(), out);
}

PositionBlocks TreeOperators::derivatives(const double* u) const {
  PositionBlocks out;
  derivatives(u, out);
  return out;
}

void TreeOperators::along(const double* u) {
  if (!direction_) direction_ = std::make_unique<PositionBlocks>();
  derivatives(u, *direction_);
  has_direction_ = true;
  mask_hinges();
}

void TreeOperators::mask_hinges() {
  Ht_free_.clear(), dHt_free_.clear();
  if (!masked_) return;
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    Ht_free_.push_back(position_->Ht[bodies_[i].sweep]);
    if (has_direction_) dHt_free_.push_back(direction_->Ht[bodies_[i].sweep]);
    for (int j = 0; j < bodies_[i].nh + bodies_[i].m; ++j) {
      if (is_free(bodies_[i].v + j)) continue;
      Ht_free_.back().col(j).setZero();
      if (has_direction_) dHt_free_.back().col(j).setZero();
    }
  }
}

void TreeOperators::articulate(const Articulate& options) {
  take(options);
  mask_hinges();
  inertia_.resize(bodies_.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) inertia_[i].P = M(static_cast<int>(i));
  for (int i = static_cast<int>(bodies_.size()) - 1; i >= 0; --i) {
    const OperatorBody& b = bodies_[i];
    Inertia& x = inertia_[i];
    const MatrixXd& H_star = Ht(i);
    const int n = b.nh + b.m;
    const MatrixXd PH = x.P * H_star;
    x.D = H_star.transpose() * PH;
    VectorXd made_of =
        (H_star.cwiseAbs().transpose() * x.P.cwiseAbs() * H_star.cwiseAbs()).diagonal();  // what round-off of D is measured by
    if (options.W) {
      x.D.diagonal() += ConstVector(options.W + b.v, n);
      made_of += ConstVector(options.W + b.v, n).cwiseAbs();
    }
    const auto where = [&](int j) { return soa::Breakdown{.body = b.sweep, .component = j < b.nh ? j : -1}; };
    MatrixXd U;  // S^-1 H P
    if (model_->bodies[b.sweep].square_root && !options.W) {
      U = factor_square_root(semidefinite_root(x.P), H_star, made_of, b.v, x.D, x.S, where);
    } else {
      factor(x.D, std::move(made_of), b.v, x.S, where);
      U = x.S.triangularView<Eigen::Lower>().solve(PH.transpose());
    }
    x.G = x.S.triangularView<Eigen::Lower>().transpose().solve(U).transpose();
    x.P_plus = x.P;
    x.P_plus.selfadjointView<Eigen::Lower>().rankUpdate(U.transpose(), -1.0);  // P - G D G*
    copy_upper_below(x.P_plus);
    if (b.parent >= 0) {
      MatrixXd& P = inertia_[b.parent].P;
      const MatrixXd shifted = x.P_plus.topLeftCorner<6, 6>() * A(i);
      P.noalias() += A(i).transpose() * shifted;
      copy_upper_below(P);
    }
  }
  has_inertia_ = true;
  if (sweeping_) sweeping_->articulated = false;
}

void TreeOperators::operational_space() {
  require(Kind::D);
  Y_.resize(bodies_.size()), Y_plus_.resize(bodies_.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const OperatorBody& b = bodies_[i];
    const Inertia& x = inertia_[i];
    const int size = 6 + b.m;
    MatrixXd &Y = Y_[i], &up = Y_plus_[i];
    up.setZero(size, size);
    if (b.parent >= 0) up.topLeftCorner<6, 6>() = A(static_cast<int>(i)) * Y_[b.parent] * A(static_cast<int>(i)).transpose();
    MatrixXd root = Ht(static_cast<int>(i)).transpose();  // S^-1 H
    x.S.triangularView<Eigen::Lower>().solveInPlace(root);
    const MatrixXd tau_bar = MatrixXd::Identity(size, size) - x.G * Ht(static_cast<int>(i)).transpose();
    Y = root.transpose() * root + tau_bar.transpose() * up * tau_bar;
    Y = (0.5 * (Y + Y.transpose())).eval();
  }
  has_operational_space_ = true;
}

void TreeOperators::require_nodes(std::span<const int> nodes) const {
  for (const int j : nodes) {
    const bool known = j >= 0 && j < static_cast<int>(model_->nodes.size());
    if (!known || model_->nodes[j].sweep == 0 || index_of(model_->nodes[j].sweep) < 0)
      refuse(Code::unknown_node, {"nodes of B"}, "nodes on bodies that take part and can move",
             known ? "\"" + model_->nodes[j].name + "\"" : fmt::format("index {}", j));
  }
}

SpaceLabels TreeOperators::labels(Space space, Sort sort) const {
  if (space == Space::node) return node_labels(nodes_, sort);
  const bool of_rates = space == Space::hinge || space == Space::rate;
  SpaceLabels out;
  out.names.resize(size(space)), out.units.resize(out.names.size());
  const auto put = [&](int i, std::string name, std::string_view rate) {
    out.names[i] = std::move(name), out.units[i] = unit_of(rate, sort);
  };
  for (const OperatorBody& b : bodies_) {
    const UserBody& u = model_->user[b.user];
    if (of_rates)
      for (int j = 0; j < b.nh; ++j) put(b.v + j, u.name + "." + u.v_names[j], u.v_units[j]);
    else
      for (int r = 0; r < 6; ++r) put(b.at + r, axis_of(u.name, r, sort), r < 3 ? "rad/s" : "m/s");
    const int first = of_rates ? b.etadot : b.at + 6;
    for (int j = 0; j < b.m; ++j) put(first + j, fmt::format("{}.etadot_{}", u.name, j + 1), "1/s");
  }
  return out;
}

void TreeOperators::apply_nodes(std::span<const int> nodes, bool star, const double* x, double* y) const {
  require(Kind::B);
  if (!star) Vector(y, n_body_).setZero();
  for (std::size_t j = 0; j < nodes.size(); ++j) {
    const OperatorBody& b = bodies_[index_of(model_->nodes[nodes[j]].sweep)];
    if (star)
      Map<Eigen::Matrix<double, 6, 1>>(y + 6 * j).noalias() = Bt(nodes[j]) * ConstVector(x + b.at, 6 + b.m);
    else
      Vector(y + b.at, 6 + b.m).noalias() += Bt(nodes[j]).transpose() * Map<const Eigen::Matrix<double, 6, 1>>(x + 6 * j);
  }
}

void TreeOperators::apply_inverse(Kind kind, const double* x, double* y) const {
  require(kind);
  for (int i = 0; i < static_cast<int>(bodies_.size()); ++i) {
    const OperatorBody& b = bodies_[i];
    if (kind == Kind::M) {
      const std::optional<MatrixXd> L = cholesky(M(i));
      if (!L)
        refuse(Code::no_inverse, {"operator M"}, "a positive definite inertia of each body",
               "that of " + model_->user[b.user].name + " is singular");
      Vector(y + b.at, 6 + b.m) = cholesky_solve(*L, ConstVector(x + b.at, 6 + b.m));
      continue;
    }
    Vector out(y + b.v, b.nh + b.m);
    out = ConstVector(x + b.v, b.nh + b.m);
    for (int j = 0; j < b.nh + b.m; ++j)
      if (!is_free(b.v + j)) out[j] = 0.0;
    S(i).triangularView<Eigen::Lower>().solveInPlace(out);
    S(i).triangularView<Eigen::Lower>().transpose().solveInPlace(out);
  }
}

bool TreeOperators::has_fused(Fused kernel) const {
  return sweeping_ && whole_ && has(Stage::position) && kernel != Fused::none &&
         (kernel == Fused::mass ? !masked_ && model_->rigid : !masked_ && !weighted_ && !model_->has_prescribed() && has(Stage::inertia));
}

bool TreeOperators::fused(Fused kernel, const double* x, double* y) const {
  if (!has_fused(kernel)) return false;
  const Model& model = *model_;
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  Sweeping& s = *sweeping_;
  if (kernel == Fused::mass) {
    const Inputs in{.q = q_.data(), .v = s.zeros.data(), .vdot = x, .gravity = false};
    outward(model, S, s.position, in, {.vdot = true, .velocity = false, .inertia = false});
    for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) S.gather(model, s.position, in, *run, y);
    return true;
  }
  if (!s.inertia) s.inertia = std::make_unique<Workspace>(model);
  if (!s.articulated && !articulate_at_rest(model, *s.inertia, q_.data()))
    throw NumericsError(describe_breakdown(model, s.inertia->breakdown, 0.0));
  s.articulated = true;
  solve_mass(model, *s.inertia, q_.data(), x, y);
  return true;
}

double TreeOperators::log_det() const {
  require(Kind::D);
  double sum = 0.0;
  for (const Inertia& x : inertia_)
    for (Eigen::Index j = 0; j < x.S.rows(); ++j) sum += 2.0 * std::log(x.S(j, j));
  return sum;
}

}  // namespace cardan::operators
