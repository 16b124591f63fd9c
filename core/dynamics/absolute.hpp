#pragma once
// A vehicle with closed loops as one system of all bodies in absolute coordinates, its hinges and loops as rows with multipliers (Orlandea,
// Chace & Calahan 1977; docs/mathematics/loops.md, 5). No sweep passes a hinge here but to find where the bodies are.
#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "core/dynamics/loop_pass.hpp"
#include "core/linalg/sparse_lu.hpp"
#include "core/model/absolute.hpp"

namespace cardan {

/// Numbers in rows, each on columns of its own.
struct SparseRows {
  std::vector<int> start{0}, column;
  std::vector<double> value;
  int size() const { return static_cast<int>(start.size()) - 1; }
  double times(int row, const double* x) const {
    double sum = 0.0;
    for (int i = start[static_cast<std::size_t>(row)]; i < start[static_cast<std::size_t>(row) + 1]; ++i)
      sum += value[static_cast<std::size_t>(i)] * x[column[static_cast<std::size_t>(i)]];
    return sum;
  }
  void add_transposed(int row, double factor, double* x) const {
    for (int i = start[static_cast<std::size_t>(row)]; i < start[static_cast<std::size_t>(row) + 1]; ++i)
      x[column[static_cast<std::size_t>(i)]] += factor * value[static_cast<std::size_t>(i)];
  }
};

/// Q, U: coordinates and velocities of the bodies, those of AbsoluteModel::bodies: per body that is not part of another [quaternion;
/// position; modes], [angular velocity in axes of the body; velocity of its origin in axes of the world; modes]. (q, v): those of the
/// vehicle. Keeps scratch, so make one and use it again.
class AbsoluteSystem {
 public:
  /// Of a model with Loops::absolute.
  explicit AbsoluteSystem(const Model& model);

  const AbsoluteModel& bodies() const { return a_; }
  int rows() const { return rows_; }
  /// Where the rows of a loop of the vehicle begin: those of all loops but couplings, of hinges, of couplings; then one for each rate of a
  /// hinge that is given.
  int first_row(int loop) const { return first_row_[static_cast<std::size_t>(loop)]; }

  /// The bodies as the hinges place them. Coordinates of hinges are looked for near q from now on, directions of rows anywhere.
  void enter(const double* q, const double* v, double* Q, double* U);
  /// All that follows is at these. `drives` as in Inputs; `given`: coordinates and rates of the vehicle, of which those count that are
  /// given.
  struct Given {
    const double *q = nullptr, *v = nullptr;
  };
  void place(const double* Q, const double* U, const LoopDrive* drives, Given given);
  /// The row of a given rate whose coordinate is not its integral holds no place.
  bool holds_a_place(int row) const { return row < first_given_ || given_[static_cast<std::size_t>(row - first_given_)].q >= 0; }
  /// Coordinates and rates of the hinges, and the modes: where the rows are open, those that are nearest. near: coordinates of hinges are
  /// looked for near them from now on, and rows near those that are.
  void leave(double* q, double* v, bool near);
  /// Directions of rows are looked for near those that they have: multipliers of a hinge whose directions turn are smooth in time, where
  /// directions that are chosen anew may change places.
  void keep_rows();

  /// c, G and G U, less what is given as a function of time.
  std::span<const double> residual() const { return c_; }
  std::span<const double> rate() const { return rate_; }
  const SparseRows& G() const { return G_; }
  /// Rates of the hinges of the vehicle, which are times U what they are.
  const SparseRows& hinge_rates() const { return H_; }
  /// M U' + C - loads - G* lambda: nv of the bodies. `in`: of the vehicle, but for its q, v and v'; null: without U', without multipliers.
  void forces(const Inputs& in, const double* Udot, const double* lambda, double* out);
  /// U' and multipliers of the rows that are kept; of the others zero. False: the system is singular.
  bool accelerate(const Inputs& in, std::span<const std::uint8_t> kept, double* Udot, double* lambda);
  /// U' that the forces of accelerate() would give each velocity of the bodies by itself: the size of what may cancel.
  std::vector<double> accelerations_alone() const;
  /// c'' of a row at U', and the sum of the magnitudes of which it is made.
  double acceleration(int row, const double* Udot) const;
  double size_of_acceleration(int row, const double* Udot) const;
  /// [m/s^2] Of a loop of the vehicle that is no coupling: the size of the products of rates in c'' of its rows, which may cancel.
  double size_of_centripetal(int loop) const;
  /// Of a velocity of the bodies, as accelerate() has it: the diagonal of M.
  double inertia(int velocity) const { return M_[static_cast<std::size_t>(diagonal_[static_cast<std::size_t>(velocity)])]; }
  /// v' of the vehicle.
  void rates_of_hinges(const double* Udot, double* vdot) const;

  /// Moment and force that the hinge of a body transmits to it at P, P axes, as the multipliers and tau have it.
  Force<double> hinge_wrench(int user_body, const double* lambda, const double* tau) const;
  /// The same of the multipliers of a loop that is no coupling, at its end `to`, axes of the node `from`.
  Force<double> loop_wrench(int loop, const double* lambda) const;

 private:
  struct Hinge {  // of the vehicle, that moves
    int user, loop, q, v, nq, nv;
    int first;  // of its rows in H_
  };
  void place_hinge(const Hinge& hinge);
  void push_of_unit_wrenches(const LoopEnd& end, const LoopEndMotion<double>& at, bool to, const LoopPlace<double>& r, double* T) const;
  void fill(int loop, const Force<double>& W, SparseRows& rows, int row) const;
  void couple();
  bool solve(std::span<const std::uint8_t> kept, double* Udot, double* lambda);
  void masses();

  const Model& m_;
  const AbsoluteModel& a_;
  Workspace tree_, ws_;
  std::vector<Hinge> hinges_;
  struct GivenRate {  // of the vehicle; its row in H_
    int q, v, rate;
  };
  std::vector<GivenRate> given_;
  int first_given_ = 0;
  std::vector<int> first_row_, coupling_of_;  // per loop of the vehicle: its number among couplings
  int rows_ = 0;
  std::vector<double> Q_, U_, q_near_, q_, v_, zero_;
  Inputs at_;
  std::vector<std::vector<int>> columns_;            // per loop: velocities of the bodies at its ends
  std::vector<std::vector<double>> pushes_;          // per loop: 6 numbers for each of them, of unit wrenches
  SparseRows G_, H_;                                 // H_: rates of hinges
  std::vector<double> c_, rate_, bias_, of_hinges_;  // c'' and v' without U'
  std::vector<std::vector<double>> gradient_;
  std::vector<Force<double>> unit_;  // per rate of hinges: the wrench whose power it tells, axes of O
  std::vector<double> M_, unit_vdot_, column_, forces_;
  std::vector<int> block_;  // per velocity of the bodies: where its block begins
  std::vector<int> block_size_, diagonal_;
  std::vector<NodeWrench> wrenches_;
  SparseLu lu_;
};

/// Rows of all hinges, and of loops those that are independent at in.q as G of the open tree has them: 1. Others are implied by them.
std::vector<std::uint8_t> independent_rows(const Model& model, Workspace& workspace, const Inputs& in, const AbsoluteSystem& system);

/// Scratch of the op `absolute`, in a workspace.
struct AbsoluteWork {
  explicit AbsoluteWork(const Model& model)
      : system(model),
        Q(static_cast<std::size_t>(system.bodies().closed->nq)),
        U(static_cast<std::size_t>(system.bodies().closed->nv)),
        Udot(U),
        lambda(static_cast<std::size_t>(system.rows())) {}
  AbsoluteSystem system;
  std::vector<double> Q, U, Udot, lambda;
  std::vector<std::uint8_t> kept;
};

}  // namespace cardan
