#pragma once
// What the letters of the algebra are applied to: a tree of bodies (tree_operators.hpp), or the tree of compound bodies that closed loops
// leave (compound_tree.hpp), at one q. Formulas and frames: docs/operators.md.
//
// Spaces. hinge: one number per velocity component, user's order of v (of the bodies that take part); of closed loops the independent ones,
// compound body after compound body. rate: all velocity components, user's order of v. body: [V; eta'] of each body that moves by itself,
// 6 + m numbers, user's order, V = [angular; linear] in the axes of the user's body frame B about its origin; rigidly merged bodies count
// as the one they are merged with. node: 6 numbers per selected node, node axes. Motions [rad/s; m/s] and forces [N m; N] (dual: power =
// f* V) share a space.
#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/dynamics/forward.hpp"
#include "core/model/model.hpp"

namespace cardan::operators {

enum class Space : std::uint8_t { hinge, body, node, rate };

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
  dM,       ///< as M, Direction
  X,        ///< rate x hinge, Position: v = X v_I, all components of closed loops from the independent ones; of an open tree 1
  dX        ///< as X, Direction
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
    {"X", Space::rate, Space::hinge, Stage::position, false, Sort::motion, Sort::motion},
    {"dX", Space::rate, Space::hinge, Stage::direction, false, Sort::motion, Sort::motion},
};
constexpr const KindFacts& facts(Kind kind) { return kKinds[static_cast<std::size_t>(kind)]; }
std::string_view name_of(Stage stage);

/// Names and units of the numbers of a space; no units where the sort is unknown.
struct SpaceLabels {
  std::vector<std::string> names, units;
};

/// Stages and products of the letters. Products use scratch of this object: one per thread.
class SpatialOperators {
 public:
  virtual ~SpatialOperators();

  // Stages -----------------------------------------------------------------------------------------------------------------
  struct Articulate {
    const double* W = nullptr;  // per hinge-space component: D = H P H* + diag(W) (armature, implicit springs; mathematics 4.9)
    std::span<const std::uint8_t> free = {};  // per component: 0 = its velocity is given: no row and no column in D, G, K; empty: all free
  };
  /// Inertia: P, D, G, P+ (Riccati, mathematics 4.4). NumericsError where D is singular.
  virtual void articulate(const Articulate& options) = 0;
  void articulate() { articulate(Articulate{}); }
  /// OperationalSpace: Y, Y+ (mathematics 6.1). Needs Inertia.
  virtual void operational_space() = 0;
  /// Direction: dH, dE_phi, dM, dX where q moves by N(q) u (u: nv numbers of the whole model; of closed loops the independent ones are
  /// read, the others follow).
  virtual void along(const double* u) = 0;
  bool has(Stage stage) const;
  /// Error (C0901) naming the operator and the missing stage.
  void require(Kind kind) const;
  /// Error (C0202) naming the first of these that is no node of a body that takes part.
  virtual void require_nodes(std::span<const int> nodes) const = 0;

  // What it is -------------------------------------------------------------------------------------------------------------
  const Model& model() const { return *model_; }
  const std::shared_ptr<const Model>& model_pointer() const { return model_; }
  const std::vector<int>& nodes() const { return nodes_; }
  const std::vector<double>& q() const { return q_; }
  bool is_masked() const { return masked_; }      ///< some components are not free
  bool is_weighted() const { return weighted_; }  ///< D has a W beside H P H*
  bool is_free(int hinge_component) const { return free_.empty() || free_[static_cast<std::size_t>(hinge_component)] != 0; }
  int size(Space space) const;
  /// Of motions: accelerations; of forces: what is dual to rates.
  virtual SpaceLabels labels(Space space, Sort sort) const = 0;
  SpaceLabels node_labels(std::span<const int> nodes, Sort sort) const;
  /// Place in the hinge space of the velocity component v of the model; -1 when it takes no part, or depends on others.
  int place_of_velocity(int v) const { return place_[static_cast<std::size_t>(v)]; }

  // Products -----------------------------------------------------------------------------------------------------------------
  /// y = A x or y = A* x for one operator, O(N); x and y must not overlap.
  virtual void apply(Kind kind, bool star, const double* x, double* y) const = 0;
  /// B f or B* V for these nodes instead of the selected ones.
  virtual void apply_nodes(std::span<const int> nodes, bool star, const double* x, double* y) const = 0;
  /// y = A^-1 x for the block-diagonal D and M.
  virtual void apply_inverse(Kind kind, const double* x, double* y) const = 0;
  enum class Fused : std::uint8_t { none, mass, mass_inverse };
  /// The same product by the sweeps of a step; false where they do not give it. NumericsError where they find a direction without inertia.
  virtual bool fused(Fused kernel, const double* x, double* y) const = 0;
  /// log det of the mass matrix (of its free components), = sum log det D. Needs Inertia.
  virtual double log_det() const = 0;

  /// Room for the intermediate vectors of an expression: at least `count` numbers.
  double* scratch(std::size_t count) const;

 protected:
  SpatialOperators() = default;
  SpatialOperators(SpatialOperators&&) noexcept;
  /// S of D = S S*, lower; rows of components that are not free are those of the unit matrix, and D has none of theirs. `made_of`: what
  /// round-off of each pivot is measured by. NumericsError, naming body and component, where D is singular.
  void factor(Eigen::MatrixXd& D, Eigen::VectorXd made_of, int v, Eigen::MatrixXd& S,
              const std::function<soa::Breakdown(int component)>& where) const;
  /// The same in square-root form, by reflections of root* H_star, root root* = P. Gives S^-1 H P.
  Eigen::MatrixXd factor_square_root(const Eigen::MatrixXd& root, const Eigen::MatrixXd& H_star, const Eigen::VectorXd& made_of, int v,
                                     Eigen::MatrixXd& D, Eigen::MatrixXd& S,
                                     const std::function<soa::Breakdown(int component)>& where) const;
  /// What articulate() begins with.
  void take(const Articulate& options);
  /// Unit of an acceleration, or of a force, from that of the rate: "rad/s" gives "rad/s^2", or "N m".
  static std::string unit_of(std::string_view rate, Sort sort);
  /// "tip:wx", of a force "tip:nx".
  static std::string axis_of(const std::string& place, int row, Sort sort);

  std::shared_ptr<const Model> model_;
  std::vector<int> place_, nodes_;
  std::vector<double> q_;
  std::vector<std::uint8_t> free_;
  int n_hinge_ = 0, n_body_ = 0, n_rate_ = 0;
  bool masked_ = false, weighted_ = false;
  bool has_position_ = false, has_inertia_ = false, has_operational_space_ = false, has_direction_ = false;

 private:
  mutable std::vector<double> scratch_;
};

}  // namespace cardan::operators
