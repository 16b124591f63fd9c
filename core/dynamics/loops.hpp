#pragma once
// Closed loops by multipliers (Jain 2011; Rodriguez, Jain & Kreutz-Delgado 1992; docs/mathematics/loops.md): G v' = gamma_c beside
// M v' + C = tau + G* lambda, with G M^-1 G* from sweeps over the tree, rank decided on G, and what exceeds it left out by name.
#include <Eigen/Core>

#include "core/dynamics/workspace.hpp"

namespace cardan {

/// Levers, scales and hinge coordinates at the start, which is assembled where it is open (Loops::moved; the model then has a description
/// that begins there). InputError C1103 with the residual of each row where it cannot be closed.
void prepare_loops(Model& model);

/// The same vehicle with its loops closed inside of the sweeps, each by rates (1) or by multipliers (0): what `loop_form: auto` chooses
/// from. Loops that share hinges (Loops::sets) all in the same way; modes on their way: by multipliers.
std::shared_ptr<const Model> embedded_by(const Model& model, const std::vector<std::uint8_t>& by_rates);

/// The op `keep`: what acts on each body, before the inward sweeps gather it.
void keep_loads(const Model& model, Workspace& workspace);
/// The op `loops`: v' of the open tree becomes that of the closed one, and with it all that the workspace holds. false: a loop cannot be
/// closed (Workspace::breakdown). Allocates in the first call with a workspace only.
bool close_loops(const Model& model, Workspace& workspace, const Inputs& in, double* vdot);

/// The op `embedding`: the sweeps and the loops in one (docs/mathematics/loops.md, 4); by multipliers over the open tree where the rank is
/// not that of the start. false: Workspace::breakdown.
bool run_embedding(const Model& model, Workspace& workspace, const Inputs& in, double* vdot);
/// The op `absolute`: all bodies in absolute coordinates as one system with multipliers (docs/mathematics/loops.md, 5), for comparison.
/// false: Workspace::breakdown. Allocates.
bool run_absolute(const Model& model, Workspace& workspace, const Inputs& in, double* vdot);
/// After forward_dynamics with the same inputs, where loops are closed inside of the sweeps: multipliers, and in the workspace what
/// observers read of the closed system. Does nothing where that is there.
void settle_loops(const Model& model, Workspace& workspace, const Inputs& in);

/// v' = M_c^-1 tau of the closed system at rest at q, without any other force (nv; zero forces on given motions), where loops are closed
/// inside of the sweeps: O(N), also where they share bodies. false: they are not, or the rank is not that of the start.
bool closed_response(const Model& model, Workspace& workspace, const double* q, const LoopDrive* drives, const double* tau, double* vdot);

/// What the loops of a workspace do: after forward_dynamics and settle_loops.
struct LoopForces {
  std::span<const double> multipliers;     // per row, of smallest norm where rows are redundant
  std::span<const NodeWrench> wrenches;    // on nodes of bodies, both ends of each loop
  std::span<const double> residual, rate;  // c and G v, per row
  std::span<const double> tau;             // of couplings, nv; empty: there are none
  std::span<const Force<double>> unit;     // what a multiplier of 1 does to the end `to`, at its node, axes of the node `from`, per row
};
LoopForces loop_forces(const Workspace& workspace);
/// Moment and force that a loop transmits to its end `to`, at that node, axes of the node `from`.
Force<double> loop_wrench(const Model& model, const Workspace& workspace, int loop);
/// Rows that counted in the last evaluation over the open tree; all that do at the start where loops are closed inside of the sweeps.
int rows_that_counted(const Model& model, const Workspace& workspace);
/// Hinge forces on components that are held which multipliers can take the place of, one a column: nothing moves otherwise with them. Empty
/// where what holds is unique: rows that imply each other because of what is held there are none.
Eigen::MatrixXd idle_forces(const Model& model, const Workspace& workspace, const std::vector<int>& components);
/// What all multipliers do, in W: nothing but for rounding, and what moves as a function of time. Of couplings alone, or of all loops.
double loop_power(const Model& model, const Workspace& workspace, const LoopDrive* drives, bool of_couplings);

/// Which rows there are, at a state.
struct LoopRank {
  int rows = 0, rank = 0;
  std::vector<int> redundant;  // rows
  double smallest = 0.0;       // pivot that was kept, of scaled rows
  double largest = 0.0;        // pivot that was not
  double distance = 0.0;       // of them the smallest singular value that counts: 0 at a singular posture
};
LoopRank loop_rank(const Model& model, Workspace& workspace, const double* q, const LoopDrive* drives = nullptr);
/// What the loops leave free at a state: v = X v_independent, nv x mobility, keeps all of them closed. NumericsError N0601 at a singular
/// posture, where motions that are free to first order cannot all go on.
struct LoopFreedom {
  std::vector<int> rows;                    // as many as count
  std::vector<int> dependent, independent;  // velocity components: those of the pivots, as many as rows; the others, ascending
  Eigen::MatrixXd X, G_D_inverse;           // ... and the inverse of G of these rows and dependent components
};
LoopFreedom loop_freedom(const Model& model, Workspace& workspace, const double* q, const LoopDrive* drives = nullptr);
/// A scaled pivot below is that of a posture near a singular one: of loops in good postures they are above 0.05.
inline constexpr double kNearSingular = 1e-3;
/// What numbers of few digits may amount to, of the size of a loop: what a row that others imply may be open by, and its scaled pivot.
inline constexpr double kTyped = 1e-4;
/// What the breakdown of a row (N0601) was at q [nq] and t [s], where that is a singular posture: its pivot and the coordinates of the loop
/// go to `failure`, with what leads there. Else nothing. Allocates.
void tell_singular_posture(const Model& model, const soa::Breakdown& breakdown, double t, const double* q, const LoopDrive* drives,
                           RunFailure& failure);
/// G, rows x nv.
Eigen::MatrixXd loop_matrix(const Model& model, Workspace& workspace, const double* q, const LoopDrive* drives = nullptr);
/// c and G of all rows, each over the size of its loop: pure numbers.
struct LoopRows {
  Eigen::VectorXd c;
  Eigen::MatrixXd G;  // rows x nv
};
LoopRows loop_rows(const Model& model, Workspace& workspace, const double* q, const LoopDrive* drives = nullptr);
/// "tip: rotation about x", "gear".
std::string name_of_row(const Model& model, const Workspace& workspace, int row);

/// The state nearest to (q, v), in the metric of the mass matrix, that closes the loops: motion that the loops leave free is not touched.
/// Rows that others imply are as open as these leave them, by what numbers were typed with; up to kTyped of the size of their loop.
/// q: nq, v: nv, changed in place. false: it was not reached; both are as near as it got. Keeps scratch, so make one and use it again.
class LoopProjection {
 public:
  explicit LoopProjection(const Model& model);
  ~LoopProjection();
  bool close(double* q, double* v, const LoopDrive* drives = nullptr);
  /// Of the last close(), before it changed anything: the largest residuals of c and of G v, relative to the size of the loops, of rows
  /// that can be closed.
  double distance() const { return distance_; }
  double rate() const { return rate_; }
  /// As distance(), relative to where loops and their ends are if that is more: what tolerances of coordinates are relative to.
  double drift() const { return drift_; }
  /// The row that was open most.
  int worst() const { return worst_; }
  /// The smallest pivot of scaled rows there, and its row: small near a singular posture.
  double pivot() const { return pivot_; }
  int weakest() const { return weakest_; }
  /// What a row that others imply is open by still, relative to the size of its loop; 0: none is.
  double left_open() const { return left_open_; }
  /// Of a close() that was false.
  soa::Breakdown breakdown() const;

 private:
  const Model& model_;
  Workspace ws_;
  Eigen::VectorXd step_, next_, mu_;
  std::vector<double> given_, agreed_;  // c before anything was changed; of rows what does not contradict itself
  int worst_ = 0, weakest_ = 0;
  double pivot_ = 1.0;
  double distance_ = 0.0, rate_ = 0.0, open_ = 0.0;  // relative to the size of the loops
  double drift_ = 0.0, left_open_ = 0.0;
};

/// A row that others imply but for what numbers were typed with, at the state nearest to (q, v) that closes the others: of each loop the
/// one that is open most; where all are closed there, the one that is least implied.
struct RowLeftOpen {
  int loop = 0;
  std::string what;  // "close: row 3, along z is open by 1e-09 m and ..."
};
std::vector<RowLeftOpen> rows_left_open(const Model& model, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                                        const LoopDrive* drives = nullptr);

}  // namespace cardan
