#pragma once
// The tree that closed loops leave when the bodies of each are taken as one (Jain 2011, 2012: constraint embedding;
// docs/mathematics/loops.md, 8). A compound body is the bodies that move against each other in a loop, with those of all loops that share
// some with it; it hangs on the body where their ways begin, its home, and its hinge has the independent rates of its loops:
//
//   v = X v_I     H* of a compound = phi_S* H_S* X     Phi* from home to each of its bodies     P of each of its bodies by itself
//
// With these letters all of the algebra is that of a tree: X* M X = H phi M phi* H*, its inverse (1 - H psi K)* D^-1 (1 - H psi K). O(N)
// for compounds of bounded size; X and D of a compound are dense.
#include "core/dynamics/loops.hpp"
#include "core/operators/tree_operators.hpp"

namespace cardan::operators {

struct Compound {
  std::vector<int> members = {};  // index into bodies(), inboard before outboard
  int home = -1;                  // the same; -1: ground
  int v = 0, n = 0;               // its place in the hinge space
  std::vector<int> loops = {};    // index into Loops::all; empty: a body by itself
  std::vector<int> rates = {};    // of its members, places in the rate space: ascending
  int rank = 0;                   // of the rows of its loops, at the start
};

class CompoundTree final : public SpatialOperators {
 public:
  /// A vehicle without closed loops has compounds of one body each.
  explicit CompoundTree(std::shared_ptr<const Model> closed);
  ~CompoundTree() override;
  /// Position: blocks at q (nq numbers, user's order), which closes the loops; `drives`: what is given as functions of time. NumericsError
  /// N0601 at a singular posture, where motions that are free to first order cannot all go on.
  void at(const double* q, const LoopDrive* drives = nullptr);

  using SpatialOperators::articulate;
  void articulate(const Articulate& options) override;
  void operational_space() override;
  void along(const double* u) override;
  void require_nodes(std::span<const int> nodes) const override { open_.require_nodes(nodes); }
  SpaceLabels labels(Space space, Sort sort) const override;

  void apply(Kind kind, bool star, const double* x, double* y) const override;
  void apply_nodes(std::span<const int> nodes, bool star, const double* x, double* y) const override;
  void apply_inverse(Kind kind, const double* x, double* y) const override;
  /// mass: of rigid vehicles, X* M X by the sweeps of the open tree. Its inverse: loops closed inside of the sweeps, O(N) also where they
  /// share bodies; all components free, none given, the rank as at the start.
  bool fused(Fused kernel, const double* x, double* y) const override;
  double log_det() const override;

  const std::vector<Compound>& compounds() const { return compounds_; }  ///< inboard before outboard
  /// Velocity components of the model in the order of the hinge space: the independent ones.
  const std::vector<int>& independent() const { return independent_; }
  const Eigen::MatrixXd& X(int compound) const { return X_[compound]; }  ///< rates x n

  // As products see it (letter_products.hpp), by bodies but for D.
  static constexpr bool kCompounds = true;
  const std::vector<OperatorBody>& bodies() const { return open_.bodies(); }
  int count() const { return static_cast<int>(compounds_.size()); }
  const std::vector<int>& members(int c) const { return compounds_[c].members; }
  int home(int c) const { return compounds_[c].home; }
  int hinge_at(int c) const { return compounds_[c].v; }
  int hinge_size(int c) const { return compounds_[c].n; }
  const Matrix6X& A(int i) const { return A_[i]; }
  const Eigen::MatrixXd& Ht(int i) const { return masked_ ? Ht_free_[i] : Ht_[i]; }
  const Eigen::MatrixXd& M(int i) const { return open_.M(i); }
  const Eigen::MatrixXd& P(int i) const { return P_[i]; }
  const Eigen::MatrixXd& G(int i) const { return G_[i]; }
  const Eigen::MatrixXd& D(int c) const { return D_[c]; }
  const Eigen::MatrixXd& Y(int i) const { return Y_[i]; }  ///< block of a body with itself
  const Matrix6X& dA(int i) const { return dA_[i]; }
  const Eigen::MatrixXd& dHt(int i) const { return masked_ ? dHt_free_[i] : dHt_[i]; }
  const Eigen::MatrixXd& dM(int i) const { return open_.dM(i); }
  void follow(bool star, const double* x, double* y) const { follow_by(X_, star, x, y); }          ///< X v_I, or X* of forces
  void follow_change(bool star, const double* x, double* y) const { follow_by(dX_, star, x, y); }  ///< the same of dX
  void solve(int compound, double* h) const;                                                       ///< D^-1, in place

 private:
  void gather_compounds();
  void number();
  /// X of every compound at a q where open_ is.
  void close(const double* q, const LoopDrive* drives, bool at_start);
  /// A and H* of the bodies of compounds, from those of the open tree and X.
  void build();
  void mask();
  void follow_by(const std::vector<Eigen::MatrixXd>& X, bool star, const double* x, double* y) const;

  TreeOperators open_;
  std::vector<Compound> compounds_;
  std::vector<int> of_body_;  // compound, per body
  std::vector<int> independent_;
  std::vector<LoopDrive> drives_;
  bool as_at_start_ = true;  // the rank of all loops
  std::vector<Eigen::MatrixXd> X_, dX_;
  struct Dependence {
    std::vector<int> rows, dependent;  // of all rows; of the compound's rates
    Eigen::MatrixXd G_D;               // of these
  };
  std::vector<Dependence> dependence_;
  std::vector<Matrix6X> A_, dA_;
  std::vector<Eigen::MatrixXd> Ht_, Ht_free_, dHt_, dHt_free_, P_, G_, D_, S_, Y_;
  mutable Workspace ws_;
  mutable std::vector<double> work_;
  mutable Eigen::VectorXd rates_, forces_, numbers_, response_;
};

}  // namespace cardan::operators
