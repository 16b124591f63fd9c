#pragma once
// The spatial operators of a tree, or of a subgraph of it, at one q: their blocks, and what each does to a stacked vector in
// O(N). Formulas and frames: docs/operators.md. The expressions of operators.hpp (C++) and expression.hpp (run time) are made of
// these; the sweeps of a step do the same without blocks, several times as fast.
//
// Spaces. hinge: one number per velocity component, user's order of v (of the bodies that take part). body: [V; eta'] of each
// body that moves by itself, 6 + m numbers, user's order, V = [angular; linear] in the axes of the user's body frame B about its
// origin; rigidly merged bodies count as the one they are merged with. node: 6 numbers per selected node, node axes.
// Motions [rad/s; m/s] and forces [N m; N] (dual: power = f* V) share a space.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/dynamics/forward.hpp"
#include "core/dynamics/part.hpp"
#include "core/model/model.hpp"
#include "core/soa/tangent.hpp"

namespace cardan::operators {

enum class Space : std::uint8_t { hinge, body, node };

/// Shapes (rows x columns in spaces) and the stage that each needs.
enum class Kind : std::uint8_t {
  H,        ///< hinge x body, Position: tau = H f; H* v = relative velocity of the hinges [X_B H*_h, -X_B Gamma_P; 0, 1]
  phi,      ///< body x body, Position: (1 - E_phi)^-1; phi f gathers forces tip to base, phi* V scatters velocities
  E_phi,    ///< body x body, Position: block (par k, k) = Phi(par k, k), else 0
  M,        ///< body x body, Position: inertia M_fl(eta) per body, block-diagonal [kg m^2, kg m, kg], symmetric
  B,        ///< body x node, Position: B* V = velocities of the selected nodes, B f = their wrenches on the bodies
  P,        ///< body x body, Inertia: articulated body inertia, block-diagonal, symmetric
  P_plus,   ///< body x body, Inertia: tau_bar P, symmetric, singular
  D,        ///< hinge x hinge, Inertia: H P H* (+ W), block-diagonal, symmetric
  G,        ///< body x hinge, Inertia: Kalman gain P H* D^-1
  tau_bar,  ///< body x body, Inertia: 1 - G H
  K,        ///< body x hinge, Inertia: shifted gain E_phi G
  E_psi,    ///< body x body, Inertia: E_phi tau_bar
  psi,      ///< body x body, Inertia: (1 - E_psi)^-1
  Y,        ///< body x body, OperationalSpace: block-diagonal part of Omega = psi* H* D^-1 H psi, symmetric
  Y_plus,   ///< body x body, OperationalSpace: Phi* Y Phi, symmetric
  dH,       ///< as H, Direction: derivative along the direction of along()
  dE_phi,   ///< as E_phi, Direction
  dM        ///< as M, Direction
};
enum class Stage : std::uint8_t { none, position, inertia, operational_space, direction };

/// What a vector of a space holds: velocities or accelerations, or what is dual to them.
enum class Sort : std::uint8_t { motion, force, unknown };
constexpr Sort dual(Sort s) { return s == Sort::motion ? Sort::force : s == Sort::force ? Sort::motion : Sort::unknown; }

/// In the order of Kind. An operator takes a vector of sort `takes` and gives one of sort `gives`; its adjoint takes the dual of
/// what it gives.
struct KindFacts {
  std::string_view name;
  Space rows, columns;
  Stage stage;
  bool symmetric;
  Sort gives, takes;
};
inline constexpr KindFacts kKinds[] = {
    {"H", Space::hinge, Space::body, Stage::position, false, Sort::force, Sort::force},
    {"phi", Space::body, Space::body, Stage::position, false, Sort::force, Sort::force},
    {"E_phi", Space::body, Space::body, Stage::position, false, Sort::force, Sort::force},
    {"M", Space::body, Space::body, Stage::position, true, Sort::force, Sort::motion},
    {"B", Space::body, Space::node, Stage::position, false, Sort::force, Sort::force},
    {"P", Space::body, Space::body, Stage::inertia, true, Sort::force, Sort::motion},
    {"P_plus", Space::body, Space::body, Stage::inertia, true, Sort::force, Sort::motion},
    {"D", Space::hinge, Space::hinge, Stage::inertia, true, Sort::force, Sort::motion},
    {"G", Space::body, Space::hinge, Stage::inertia, false, Sort::force, Sort::force},
    {"tau_bar", Space::body, Space::body, Stage::inertia, false, Sort::force, Sort::force},
    {"K", Space::body, Space::hinge, Stage::inertia, false, Sort::force, Sort::force},
    {"E_psi", Space::body, Space::body, Stage::inertia, false, Sort::force, Sort::force},
    {"psi", Space::body, Space::body, Stage::inertia, false, Sort::force, Sort::force},
    {"Y", Space::body, Space::body, Stage::operational_space, true, Sort::motion, Sort::force},
    {"Y_plus", Space::body, Space::body, Stage::operational_space, true, Sort::motion, Sort::force},
    {"dH", Space::hinge, Space::body, Stage::direction, false, Sort::force, Sort::force},
    {"dE_phi", Space::body, Space::body, Stage::direction, false, Sort::force, Sort::force},
    {"dM", Space::body, Space::body, Stage::direction, true, Sort::force, Sort::motion},
};
constexpr const KindFacts& facts(Kind kind) { return kKinds[static_cast<std::size_t>(kind)]; }
std::string_view name_of(Stage stage);

using Matrix6X = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// Phi*, H* and M of every moving body of a model at one q, user's body frames; same index as Model::bodies.
struct PositionBlocks {
  std::vector<Matrix6X> A;             // first six rows of Phi*(p, k), 6 x (6 + m_p), zero columns where O does not deform
  std::vector<Eigen::MatrixXd> Ht, M;  // H*: (6 + m) x (nv + m); M: (6 + m) square
  std::vector<Matrix6X> Bt;            // per Model::nodes: B* of the node, 6 x (6 + m) of its body
};

/// A body that takes part.
struct OperatorBody {
  int sweep = 0;          // index into Model::bodies
  int user = 0;           // index into Model::user
  int parent = -1;        // index into TreeOperators::bodies(), -1 where the subgraph ends
  int nh = 0, m = 0;      // hinge velocities, modes
  int v = 0, etadot = 0;  // places in the hinge space
  int at = 0;             // place in the body space
};

/// Names and units of the numbers of a space; no units where the sort is unknown.
struct SpaceLabels {
  std::vector<std::string> names, units;
};

/// Blocks and stages of a tree, or of a part of it, at one q. Products use scratch of this object: one per thread. About 2 kB per
/// rigid body with all stages, 7 kB per body of five modes.
class TreeOperators {
 public:
  /// The whole tree.
  explicit TreeOperators(std::shared_ptr<const Model> model);
  ~TreeOperators();
  TreeOperators(TreeOperators&&) noexcept;
  /// The subgraph of `sweep_bodies` (any set; whoever's inboard body is not in it hangs on ground), at the same q, its blocks
  /// shared with this; stages beyond Position are to be computed anew. Operators carry over to subgraphs (Jain 2011).
  TreeOperators subgraph(std::vector<int> sweep_bodies) const;
  /// Sweep indices of a body and all outboard of it; of the path between two bodies, both included.
  std::vector<int> subtree(int sweep_body) const;
  std::vector<int> path(int sweep_body_a, int sweep_body_b) const;

  // Stages -----------------------------------------------------------------------------------------------------------------
  /// Position: blocks at q (nq numbers, user's order). Whole trees only: a subgraph stays where it was made.
  void at(const double* q);
  struct Articulate {
    const double* W = nullptr;  // per hinge-space component: D = H P H* + diag(W) (armature, implicit springs; mathematics 4.9)
    std::span<const std::uint8_t> free = {};  // per component: 0 = its velocity is given: no row and no column in D, G, K; empty: all free
  };
  /// Inertia: P, D, G, P+ (Riccati, mathematics 4.4). NumericsError where D is singular.
  void articulate(const Articulate& options);
  void articulate() { articulate(Articulate{}); }
  /// OperationalSpace: Y, Y+ (mathematics 6.1). Needs Inertia.
  void operational_space();
  /// Direction: dH, dE_phi, dM where q moves by N(q) u (u: nv numbers of the whole model).
  void along(const double* u);
  /// The same derivatives as values, by sweep index (Bt stays empty): leaves this as it is.
  PositionBlocks derivatives(const double* u) const;
  /// Into memory that is there.
  void derivatives(const double* u, PositionBlocks& out) const;
  /// Error (C0202) naming the first of these that is no node of a body that takes part.
  void require_nodes(std::span<const int> nodes) const;
  /// Error (C0901) naming the operator and the missing stage.
  void require(Kind kind) const;
  bool has(Stage stage) const;

  // What it is -------------------------------------------------------------------------------------------------------------
  const Model& model() const { return *model_; }
  const std::shared_ptr<const Model>& model_pointer() const { return model_; }
  const std::vector<OperatorBody>& bodies() const { return bodies_; }  ///< inboard before outboard
  const std::vector<int>& nodes() const { return nodes_; }
  const std::vector<double>& q() const { return q_; }
  bool whole() const { return whole_; }
  /// For sweeps over the bodies that take part; null for the whole tree.
  const Part* part() const { return part_.get(); }
  bool is_masked() const { return masked_; }  ///< some components are not free
  int size(Space space) const;
  /// Of motions: accelerations; of forces: what is dual to rates.
  SpaceLabels labels(Space space, Sort sort) const;
  SpaceLabels node_labels(std::span<const int> nodes, Sort sort) const;
  /// Index into bodies() of a sweep body; -1 when it takes no part.
  int index_of(int sweep_body) const { return index_[sweep_body]; }
  /// Place in the hinge space of the velocity component v of the model; -1 when it takes no part.
  int place_of_velocity(int v) const { return place_[v]; }
  /// A vector of the hinge space as nv numbers of the model, zero where nobody takes part; and back.
  Eigen::VectorXd to_model(const Eigen::VectorXd& x) const;
  Eigen::VectorXd from_model(const Eigen::VectorXd& x) const;
  std::vector<int> sweep_bodies() const;  ///< those that take part, ascending

  // Blocks of body i (index into bodies()) ------------------------------------------------------------------------------------
  const Matrix6X& A(int i) const { return position_->A[sweep(i)]; }
  const Eigen::MatrixXd& Ht(int i) const { return masked_ ? Ht_free_[i] : position_->Ht[sweep(i)]; }
  /// H* with the columns of all components, free or not.
  const Eigen::MatrixXd& Ht_all(int i) const { return position_->Ht[sweep(i)]; }
  const Eigen::MatrixXd& M(int i) const { return position_->M[sweep(i)]; }
  const Eigen::MatrixXd& P(int i) const { return inertia_[i].P; }
  const Eigen::MatrixXd& P_plus(int i) const { return inertia_[i].P_plus; }
  const Eigen::MatrixXd& D(int i) const { return inertia_[i].D; }
  const Eigen::MatrixXd& G(int i) const { return inertia_[i].G; }
  /// Lower Cholesky factor of D; rows of components that are not free are those of the unit matrix.
  const Eigen::MatrixXd& S(int i) const { return inertia_[i].S; }
  const Eigen::MatrixXd& Y(int i) const { return Y_[i]; }
  const Eigen::MatrixXd& Y_plus(int i) const { return Y_plus_[i]; }
  const Matrix6X& Bt(int node) const { return position_->Bt[node]; }  ///< by index into Model::nodes
  const Matrix6X& dA(int i) const { return direction_->A[sweep(i)]; }
  const Eigen::MatrixXd& dHt(int i) const { return masked_ ? dHt_free_[i] : direction_->Ht[sweep(i)]; }
  const Eigen::MatrixXd& dM(int i) const { return direction_->M[sweep(i)]; }
  bool is_weighted() const { return weighted_; }  ///< D has a W beside H P H*
  /// Blocks of all bodies of the model, also of those that take no part: by sweep index. Needs Position.
  const PositionBlocks& position_blocks() const { return require(Kind::H), *position_; }
  bool is_free(int hinge_component) const { return free_.empty() || free_[hinge_component] != 0; }

  // Products -----------------------------------------------------------------------------------------------------------------
  /// y = A x or y = A* x for one operator, O(N); x and y must not overlap.
  void apply(Kind kind, bool star, const double* x, double* y) const;
  /// B f or B* V for these nodes instead of the selected ones.
  void apply_nodes(std::span<const int> nodes, bool star, const double* x, double* y) const;
  /// y = A^-1 x for the block-diagonal D and M.
  void apply_inverse(Kind kind, const double* x, double* y) const;
  enum class Fused : std::uint8_t { none, mass, mass_inverse };
  /// Whether the sweeps of a step give it: the whole tree, all components free, no W; mass: of rigid trees (the sweeps form M_fl(eta) anew
  /// in each product). Then the same product by them.
  bool has_fused(Fused kernel) const;
  /// NumericsError where the sweeps find a direction without inertia.
  void apply_fused(Fused kernel, const double* x, double* y) const;
  /// log det of the mass matrix (of its free components), = sum log det D. Needs Inertia.
  double log_det() const;

  /// Room for the intermediate vectors of an expression: at least `count` numbers.
  double* scratch(std::size_t count) const;

 private:
  struct Inertia {
    Eigen::MatrixXd P, P_plus, D, G, S;
  };
  struct Sweeping;  // workspaces of the fused kernels
  TreeOperators() = default;
  std::size_t sweep(int i) const { return static_cast<std::size_t>(bodies_[i].sweep); }
  void number(const std::vector<int>& sweep_bodies);
  void mask_hinges();

  std::shared_ptr<const Model> model_;
  std::vector<OperatorBody> bodies_;
  std::vector<int> index_, place_, nodes_;
  std::vector<double> q_;
  std::vector<std::uint8_t> free_;
  int n_hinge_ = 0, n_body_ = 0;
  std::shared_ptr<const Part> part_;
  bool whole_ = true, masked_ = false, weighted_ = false;
  bool has_inertia_ = false, has_operational_space_ = false, has_direction_ = false;
  std::shared_ptr<PositionBlocks> position_;  // shared with subgraphs: never written while it is
  std::unique_ptr<PositionBlocks> direction_;
  mutable std::unique_ptr<soa::Workspace<soa::Tangent>> tangent_;  // of derivatives, once they were asked for
  std::vector<Eigen::MatrixXd> Ht_free_, dHt_free_;
  std::vector<Inertia> inertia_;
  std::vector<Eigen::MatrixXd> Y_, Y_plus_;
  std::unique_ptr<Sweeping> sweeping_;
  mutable std::vector<double> scratch_, work_;
};

}  // namespace cardan::operators
