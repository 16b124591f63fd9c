#pragma once
// The spatial operators of a tree, or of a subgraph of it, at one q: their blocks, and what each does to a stacked vector in
// O(N). Spaces, letters and stages: spatial_operators.hpp. The expressions of operators.hpp (C++) and expression.hpp (run time) are made of
// these; the sweeps of a step do the same without blocks, several times as fast.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/dynamics/part.hpp"
#include "core/operators/spatial_operators.hpp"
#include "core/soa/tangent.hpp"

namespace cardan::operators {

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

/// Blocks and stages of a tree, or of a part of it, at one q. Products use scratch of this object: one per thread. About 2 kB per
/// rigid body with all stages, 7 kB per body of five modes.
class TreeOperators final : public SpatialOperators {
 public:
  /// The whole tree.
  explicit TreeOperators(std::shared_ptr<const Model> model);
  ~TreeOperators() override;
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
  using SpatialOperators::articulate;
  void articulate(const Articulate& options) override;
  void operational_space() override;
  void along(const double* u) override;
  /// The same derivatives as values, by sweep index (Bt stays empty): leaves this as it is.
  PositionBlocks derivatives(const double* u) const;
  /// Into memory that is there.
  void derivatives(const double* u, PositionBlocks& out) const;
  void require_nodes(std::span<const int> nodes) const override;

  // What it is -------------------------------------------------------------------------------------------------------------
  const std::vector<OperatorBody>& bodies() const { return bodies_; }  ///< inboard before outboard
  bool whole() const { return whole_; }
  /// For sweeps over the bodies that take part; null for the whole tree.
  const Part* part() const { return part_.get(); }
  SpaceLabels labels(Space space, Sort sort) const override;
  /// Index into bodies() of a sweep body; -1 when it takes no part.
  int index_of(int sweep_body) const { return index_[sweep_body]; }
  /// InputError C0201 for a sweep index that there is not.
  void require_body(int sweep_body) const;
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
  /// Blocks of all bodies of the model, also of those that take no part: by sweep index. Needs Position.
  const PositionBlocks& position_blocks() const { return require(Kind::H), *position_; }

  // Products -----------------------------------------------------------------------------------------------------------------
  void apply(Kind kind, bool star, const double* x, double* y) const override;
  void apply_nodes(std::span<const int> nodes, bool star, const double* x, double* y) const override;
  void apply_inverse(Kind kind, const double* x, double* y) const override;
  /// Whether the sweeps of a step give it: the whole tree, all components free, no W; mass: of rigid trees (the sweeps form M_fl(eta) anew
  /// in each product).
  bool has_fused(Fused kernel) const;
  bool fused(Fused kernel, const double* x, double* y) const override;
  double log_det() const override;

  // As products see it (letter_products.hpp): every body by itself.
  static constexpr bool kCompounds = false;
  int count() const { return static_cast<int>(bodies_.size()); }
  static std::array<int, 1> members(int i) { return {i}; }
  int home(int i) const { return bodies_[i].parent; }
  int hinge_at(int i) const { return bodies_[i].v; }
  int hinge_size(int i) const { return bodies_[i].nh + bodies_[i].m; }
  void follow(bool, const double* x, double* y) const { std::copy(x, x + n_hinge_, y); }
  void follow_change(bool, const double*, double* y) const { std::fill_n(y, n_hinge_, 0.0); }

 private:
  struct Inertia {
    Eigen::MatrixXd P, P_plus, D, G, S;
  };
  struct Sweeping;  // workspaces of the fused kernels
  TreeOperators() = default;
  std::size_t sweep(int i) const { return static_cast<std::size_t>(bodies_[i].sweep); }
  void number(const std::vector<int>& sweep_bodies);
  void mask_hinges();

  std::vector<OperatorBody> bodies_;
  std::vector<int> index_;
  std::shared_ptr<const Part> part_;
  bool whole_ = true;
  std::shared_ptr<PositionBlocks> position_;  // shared with subgraphs: never written while it is
  std::unique_ptr<PositionBlocks> direction_;
  mutable std::unique_ptr<soa::Workspace<soa::Tangent>> tangent_;  // of derivatives, once they were asked for
  std::vector<Eigen::MatrixXd> Ht_free_, dHt_free_;
  std::vector<Inertia> inertia_;
  std::vector<Eigen::MatrixXd> Y_, Y_plus_;
  std::unique_ptr<Sweeping> sweeping_;
  mutable std::vector<double> work_;
};

}  // namespace cardan::operators
