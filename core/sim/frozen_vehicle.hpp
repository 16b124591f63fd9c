#pragma once
// The vehicle with its configuration frozen, as a linear system: M u' + C u + K y = r(t), y' = u, with M of one configuration, K and C of
// the modes and of springs and dampers on hinges. Solved through a step in O(N): modes in closed form, velocities of what they hang on as
// polynomials of time, bodies eliminated tip to base as in the articulated sweeps (docs/mathematics/exponential.md, 3 and 4).
#include <Eigen/Core>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "core/base/checkpoint.hpp"
#include "core/operators/tree_operators.hpp"
#include "core/time/oscillator_table.hpp"

namespace cardan {

/// User's order of q and v throughout; components that follow a given motion, or are held, stand still and have no equation.
class FrozenVehicle {
 public:
  /// `gyroscopic`: C has the moments that turn with what carries fast rotors, at the speeds that these have where it is frozen.
  explicit FrozenVehicle(std::shared_ptr<const Model> model, bool gyroscopic = false);

  /// What acts at hinges beside springs, by its tangent: stiffness and damping per velocity component, nv numbers each.
  struct AtHinges {
    std::vector<double> stiffness, damping;
  };
  /// M, C, K from now on at (q, v). `devices`: of what they push with there. NumericsError where the model has no configuration there.
  void freeze(const double* q, const double* v, const AtHinges* devices = nullptr);
  /// Whether K or C of stops, friction and devices are others at (q, v) than where it is frozen, so that it matters.
  bool stiffened(const double* q, const double* v, const AtHinges* devices);
  /// The q where it is frozen; null: nowhere yet. Other components may be held now.
  const double* where() const { return at_.empty() ? nullptr : at_.data(); }
  bool holds_others() const;
  /// Whether rotors turn at other speeds at v than where it is frozen, so that it matters.
  bool spun(const double* v) const;

  /// Whether nothing holds the three components from v on, of a root: neither springs nor dampers nor a given motion.
  bool floats(int v) const;

  /// M u' + C u + K y per velocity component; zero where there is no equation.
  void force(const double* y, const double* u, const double* du, double* r) const;

  /// r(s) = r[0] + r[1] s + r[2] s^2, s = 0 ... 1 over the step; nv numbers each.
  using Drive = std::array<const double*, 3>;
  /// The solution at the end of a step of h [s] from (y, u): travel = y(h) - y, and u(h); nv numbers each. y, u null: from rest at y = 0.
  void advance(double h, const double* y, const double* u, const Drive& r, double* travel, double* rate);
  /// The same at the fraction s of the last step that started from a state.
  void inside(double s, double* travel, double* rate) const;

  /// Of the last advance(), per velocity component: what the last two terms of its acceleration do through the step, travel and rate; nv
  /// numbers each, zero of modes in closed form. `lost`: of what a spring or damper of its own holds and has no terms that fall off, the
  /// amplitude that such terms tell; zero elsewhere. false: every acceleration is as short as what drives it, and nothing is filled in.
  bool last_terms(double* travel, double* rate, bool lost) const;

  /// Lengths of steps that differ by less are one [s]: instants of a schedule are rounded.
  void set_rounding(double dt) { rounding_ = dt; }
  /// Where and with what held it is frozen, and the lengths of steps that are kept.
  void remember(Archive& archive);

  /// [rad/s] of the fastest mode that is solved in closed form; 0: there is none.
  double fastest() const { return fastest_; }
  /// visit(first coordinate, first velocity, modes) of each body whose modes are solved in closed form.
  template <class Visit>
  void each_flexible(const Visit& visit) const {
    for (const Body& b : bodies_)
      if (b.in_closed_form) visit(b.eta, b.etadot, std::span<const Oscillator>(b.modes));
  }

 private:
  /// Legendre coefficients, one column a degree.
  using Series = Eigen::Matrix<double, Eigen::Dynamic, kDegrees>;
  struct Body {
    int parent = -1;  // index into bodies_
    int m = 0, eta = 0, etadot = 0, first_mode = 0;
    bool in_closed_form = false;    // its modes, which move nothing outboard of it
    int size = 6;                   // of its motion: 6, and modes that are coordinates like those of hinges
    std::vector<int> v, y, column;  // of the coordinates that are solved for: velocity, place in y or -1, column of H*
    bool wide_inside = false;       // what is outboard of its hinge swings in time: an inertia per pair of degrees
    bool wide = false;              // ... with the hinge
    Eigen::Matrix<double, 6, Eigen::Dynamic> A;
    Eigen::MatrixXd Ht, M, K, C;
    Eigen::MatrixXd Mre;           // 6 x m, of modes in closed form
    Eigen::MatrixXd shape, to_xi;  // eta = shape xi, xi = to_xi eta, where the given modes are not those of the body by itself; else empty
    std::vector<Oscillator> modes;
    int rotor = -1;              // its velocity
    double per_speed = 0.0;      // [-] rate of nutation over its speed: its moment of inertia over that of its carrier
    bool fast = false;           // a rotor that is
    Eigen::Matrix3d gyroscopic;  // [N m s] moment over the angular velocity
  };
  struct Factor {
    Eigen::MatrixXd D_inverse, gain, back;  // gain: P H*, its first six rows; back: D^-1 H P, its first six columns
  };
  struct Step {  // what belongs to one length of step
    double h = 0.0;
    long used = 0, frozen = -1;
    std::vector<OscillatorTable> tables;  // mode by mode
    std::vector<Factor> factors;          // body by body
  };
  void make_modes(Body& b, const FlexibleBody& f) const;
  void freeze_held(const double* q, const double* v);
  void look_at_hinges(const double* q, const double* v, const AtHinges* devices);
  void spin(Body& b, int block, double speed);
  /// V_ from rates of coordinates.
  void move(const double* u) const;
  Step& step_of(double h);
  void fill(Step& step, double h) const;
  void factor(Step& step);
  void to_modes(const Body& b, const double* eta, Eigen::VectorXd& xi) const;
  void from_modes(const Body& b, Eigen::VectorXd& xi, double* eta) const;

  std::shared_ptr<const Model> model_;
  operators::TreeOperators tree_;
  std::vector<Body> bodies_;  // inboard before outboard, in the order of tree_
  std::vector<std::uint8_t> held_;
  std::vector<double> at_;  // q and v where it is frozen; empty: it is not yet
  AtHinges beside_, now_;   // springs, where it is frozen and where it was looked at last
  double fastest_ = 0.0, rounding_ = 0.0;
  int n_modes_ = 0;        // in closed form
  bool spinning_ = false;  // a rotor counts
  long frozen_ = 0, used_ = 0;
  std::vector<Step> steps_;
  std::vector<Eigen::MatrixXd> P_;                  // per body, scratch of factor()
  mutable std::vector<Eigen::VectorXd> a_, f_, V_;  // per body, scratch of force() and of move()
  mutable Eigen::VectorXd xi_, xi_rate_, xi_acceleration_;
  // Of the last advance(): per body forces, motions and accelerations of its coordinates; what acts on each mode, one a column.
  std::vector<Series> Z_, delta_, Gamma_, eps_;
  const Step* step_ = nullptr;
  std::vector<double> u_;
  Eigen::Matrix<double, OscillatorTable::kCauses, Eigen::Dynamic> causes_;
};

}  // namespace cardan
