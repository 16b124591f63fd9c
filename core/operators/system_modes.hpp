#pragma once
// Small vibrations of the assembled system about q at rest: K x = lambda M x in the hinge space, M the mass matrix by the sweeps, K
// the stiffness of hinge springs, of the bodies' modes and of devices; matrix-free, O(N) per product, where no device has any. Gravity
// stiffness is not in K (the linear model of linear_model.hpp has it), nor are devices with states of their own.
#include <complex>
#include <span>

#include "core/operators/devices_of_tree.hpp"

namespace cardan::operators {

struct SystemModesOptions {
  int elastic = 10;                        // how many elastic modes, lowest first
  int rigid = 12;                          // shapes of at most so many rigid-body modes
  const DeviceForces* devices = nullptr;   // of the model, with their marks and inputs; null: theirs is left out
  const Model* closed = nullptr;           // of closed_system_modes: the vehicle with its loops, along which preload of devices is turned
  std::span<const LoopDrive> drives = {};  // of that: lengths of loops that are functions of time
};

/// Rigid-body modes first, then elastic ones with rising frequency.
struct SystemModes {
  int n_rigid = 0;                  // all zeros of the spectrum; of the first options.rigid there are shapes
  int first_elastic = 0;            // columns before it are rigid-body modes
  Eigen::VectorXd frequency;        // [Hz] k; 0 for rigid-body modes
  Eigen::VectorXd damping;          // [-] k: x* C x / (2 omega), C of dampers and modes; 0 for rigid-body modes
  Eigen::MatrixXd shapes;           // n x k, hinge space, X* M X = 1; given motions do not move
  Eigen::MatrixXd kinetic;          // bodies x k: share of each body in the kinetic energy, columns sum to 1
  Eigen::MatrixXd strain;           // n x k: share of each component's stiffness in the strain energy; 0 for rigid-body modes
  Eigen::VectorXd residual;         // k: |K x - lambda M x| over omega in the norm of K^-1
  bool complete = false;            // Sylvester: as many eigenvalues lie below as were found. False: no gap to count in
  SpaceLabels labels;               // of the rows of shapes and strain; shapes are scaled by mass, so units are left open
  std::vector<std::string> bodies;  // of the rows of kinetic
};

/// Needs Position (of a tree or a subgraph). Components whose motion is given, or that articulate() left out, do not move. LinalgError
/// where ARPACK does not converge or modes were missed, NumericsError at a free direction without inertia, InputError C0401 for a stiffness
/// that is not positive.
///
/// No shift and no factorisation: components u without stiffness are eliminated, x_u = -M_uu^-1 M_us x_s, by the innovations
/// factors of M_uu; what is left, K_s x_s = lambda (M_ss - M_su M_uu^-1 M_us) x_s, has a K_s that is diagonal but for the blocks
/// of modes. The null space of K is known, so rigid-body modes are exact zeros.
///
/// Where devices have stiffness the components u divide into those that they strain, which join s, and the rest, by the eigenvectors of
/// the K of each device; the problem of s is then solved densely, C0401 beyond 1000 components.
SystemModes system_modes(const TreeOperators& tree, const SystemModesOptions& options = {});

/// The same of a vehicle with closed loops: `tree` is its open tree (open_tree()), v = X y its motions (LoopFreedom::X; nv x mobility).
/// Dense in y: frequencies are singular values of the root of K along them. Of multipliers at rest K has
/// those that preload of devices needs (options.closed), not those of springs of hinges and of weight.
SystemModes closed_system_modes(const TreeOperators& tree, const Eigen::MatrixXd& X, const SystemModesOptions& options = {});

/// Number of eigenvalues below lambda > 0, rigid-body modes included: pivots of M - K / lambda by the articulated recursion (mathematics
/// 4.9 with W = -K / lambda) and the law of inertia, O(N). Without devices.
int count_below(const TreeOperators& tree, double lambda);

/// A root of the characteristic polynomial.
struct Pole {
  std::complex<double> value;  // [rad/s]
  double frequency = 0.0;      // [Hz] |value| / 2 pi
  double damping = 0.0;        // [-] -Re / |value|; 0 where value is zero to rounding, < 4 sqrt(eps |A|)
};
/// Eigenvalues of A (square), by rising frequency, of a pair the one above the real axis first.
std::vector<Pole> poles(const Eigen::MatrixXd& A);
/// Of x+ = A x at ticks dt apart: log z / dt, -inf of z = 0.
std::vector<Pole> poles(const Eigen::MatrixXd& A, double dt);

}  // namespace cardan::operators
