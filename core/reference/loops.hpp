#pragma once
// Closed loops of the twin: geometric conditions on two frames in world axes, differentiated twice by hand, type by type; and the
// equations of motion with multipliers by a dense solution. No hinge coordinates, no motion relative to a common ancestor, no compliance
// by sweeps: nothing is shared with core/dynamics/loops.
#include <string_view>
#include <vector>

#include "core/reference/frame.hpp"

namespace cardan::reference {

template <class T>
struct DenseLoop {
  struct Term {
    int q, v;
    T coefficient;
  };
  std::string name;
  HingeShape<T> shape;     // its type: weld, point, line, plane, distance, coupling or a hinge
  int from = -1, to = -1;  // index into DenseModel::bodies; -1 = world
  ModalPoint<T> A, B;      // on these
  T length{0}, offset{0};
  std::vector<Term> terms;
  /// F(phase + sum of coefficient q).
  struct Function {
    std::string kind;        // polynomial, sine, cosine, table
    VecX<T> numbers;         // coefficients, ascending; an amplitude; of a table x of its points
    VecX<T> values, slopes;  // of a table, at its points
    bool periodic = false;
    T phase{0};
    std::vector<Term> of;
  };
  std::vector<Function> functions;
  bool prescribed = false;
};
/// Slopes at the points of a table: of the cubics between them that have continuous curvatures, zero at the ends unless it repeats.
template <class T>
VecX<T> slopes_of_table(const VecX<T>& x, const VecX<T>& values, bool periodic);

/// Rows c(q) = 0, G v = 0, G v' = gamma of one loop, and what a multiplier of 1 of each does to the end `to`: moment and force at its node,
/// world axes.
template <class T>
struct LoopRows {
  VecX<T> c, gamma;
  MatX<T> G, wrench;  // rows x nv, 6 x rows
};
/// `drive`: by how much the length or offset of a prescribed one is more, its rate and acceleration.
template <class T>
LoopRows<T> rows_of(const DenseLoop<T>& loop, const Frame<T>& A, const Frame<T>& B, const VecX<T>& q, const VecX<T>& v,
                    const Vec3<T>& drive);
/// False for a type that the twin does not know.
bool knows_loop(std::string_view type);

/// v' of M v' = force + G* lambda, G v' = gamma; lambda of smallest norm.
template <class T>
struct ClosedMotion {
  VecX<T> vdot, lambda;
  int rank = 0;
};
/// M positive definite, or made so by the rows. Rows that depend on others to `tolerance` (each scaled to unit length in the metric of the
/// diagonal of M) count once.
template <class T>
ClosedMotion<T> closed_motion(const MatX<T>& M, const VecX<T>& force, const MatX<T>& G, const VecX<T>& gamma, double tolerance = 1e-9);

}  // namespace cardan::reference
