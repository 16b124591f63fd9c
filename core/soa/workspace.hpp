#pragma once
// Scratch of the sweeps for one model and one scalar: one arena, allocated once, a core and a record per body. Made by the caller,
// one per thread; holds no state of the simulation (everything in it follows from t, q, v and the inputs).
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "core/model/coupling.hpp"
#include "core/model/sweep_model.hpp"
#include "core/soa/lanes.hpp"
#include "core/soa/record.hpp"

namespace cardan {
struct LoopWork;  // core/dynamics/loops.hpp
}
namespace cardan::soa {

/// A wrench [moment; force] on a node. In node axes, or in world axes.
template <class T>
struct NodeWrench {
  int node = 0;  // index into Model::nodes
  bool world_axes = false;
  Force<T> f;
};

/// What a right-hand side depends on. Pointers are in the user's order. q and v must be given; tau and vdot may be null = zero
/// (vdot not where a motion is prescribed).
template <class T>
struct Inputs {
  const T* q = nullptr;
  const T* v = nullptr;
  const T* tau = nullptr;   // generalised forces of actuators, dual to v
  const T* vdot = nullptr;  // all components (inverse dynamics); prescribed ones, the others zero (forward)
  std::span<const NodeWrench<T>> wrenches = {};
  bool gravity = true;                  // false: leave gravity out
  const FieldMoment* moment = nullptr;  // of gravity that is a field of a family; null: t = 0
  const LoopDrive* drives = nullptr;    // of loops that are given as functions of time, Loops::n_drives; null: as in the model, at rest
};

/// What a pass is made for: base to tip, tip to base.
struct OutwardFor {
  bool vdot = false;     // add H* v' of Inputs::vdot (prescribed motion, inverse dynamics)
  bool velocity = true;  // velocity terms; false: as if v = 0
  bool inertia = true;   // P starts from M; false: it is not wanted, or is there (then only with velocity)
};
struct InwardFor {
  bool inertia = true;  // P, D, G: functions of q only
  bool bias = true;     // z, eps, nu: need P, D, G at the same q
};

/// A pivot of D below this fraction of the inertia it is made of is round-off, not inertia.
inline constexpr double kPivotLimit = 4e-16;
/// Below this fraction it is asked how much of a pivot rounding may be (rounding_of_pivot).
inline constexpr double kSmallPivot = 1e-6;

/// What rounding may be of pivot j of D = L L*, whose columns are made of inertias of the sizes scale[i]: components l before it have gone
/// into it by the factors w = D_jl D_ll^-1, so an error e of D is one of (1, w) e (1, w)*. `at(l, i)`: L.
template <class T, class L>
[[gnu::noinline, gnu::cold]] T rounding_of_pivot(const L& at, const T* scale, int j) {
  using std::sqrt;
  T w[6], root = sqrt(scale[j]);
  for (int i = j - 1; i >= 0; --i) {
    T sum = at(j, i);
    for (int l = i + 1; l < j; ++l) sum = sum - at(l, i) * w[l];
    w[i] = sum / at(i, i);
    root = root + sqrt(w[i] * w[i] * scale[i]);
  }
  return T(kPivotLimit) * root * root;
}
/// So many times more where modes were eliminated before: as many as move all mass of their body leave nothing but rounding.
inline constexpr double kRoundingOfModes = 10.0;
/// Its square root in square-root form: what is left of it after the rounding of six reflected columns.
inline constexpr double kRootPivotLimit = 2e-15;

/// What stopped a sweep: a direction without inertia.
struct Breakdown {
  int body = 0;        // sweep index; 0 = none
  int component = -1;  // velocity component of the hinge; -1: a mode
  double value = 0.0, limit = 0.0;
  int row = -1;  // of the loops, which then stopped it
};

template <class T>
class Workspace {
 public:
  explicit Workspace(const SweepModel& model);

  CARDAN_INLINE Core<T>& core(int k) { return *reinterpret_cast<Core<T>*>(arena_.get() + core_at_[k]); }
  CARDAN_INLINE const Core<T>& core(int k) const { return const_cast<Workspace*>(this)->core(k); }
  CARDAN_INLINE Force<T>& z(int k) { return *reinterpret_cast<Force<T>*>(record(k)); }
  CARDAN_INLINE const Force<T>& z(int k) const { return const_cast<Workspace*>(this)->z(k); }
  template <int NV>
  CARDAN_INLINE Hinge<T, NV>& hinge(int k) {
    return reinterpret_cast<RigidRecord<T, NV>*>(record(k))->hinge;
  }
  template <int NV>
  CARDAN_INLINE Modal<T>& modal(int k) {
    return reinterpret_cast<GeneralRecord<T, NV>*>(record(k))->modal;
  }
  template <int NV>
  CARDAN_INLINE SquareRoot<T>& square_root(int k) {
    return reinterpret_cast<SquareRootRecord<T, NV>*>(record(k))->square_root;
  }
  CARDAN_INLINE AxisRecord<T>& axis(int k) { return *reinterpret_cast<AxisRecord<T>*>(record(k)); }
  CARDAN_INLINE const AxisRecord<T>& axis(int k) const { return const_cast<Workspace*>(this)->axis(k); }
  CARDAN_INLINE FreeRecord<T>& free(int k) { return *reinterpret_cast<FreeRecord<T>*>(record(k)); }
  // Access by run-time kind, for what is not in the inner loop.
  /// Pose of B in A of a body with a stored pose (not an axis record).
  CARDAN_INLINE Pose<T>& X(int k) { return *reinterpret_cast<Pose<T>*>(record(k) + sizeof(Force<T>)); }
  CARDAN_INLINE const Pose<T>& X(int k) const { return const_cast<Workspace*>(this)->X(k); }
  /// Columns of H* at B, likewise.
  CARDAN_INLINE Motion<T>* H(int k) { return reinterpret_cast<Motion<T>*>(record(k) + sizeof(Force<T>) + sizeof(Pose<T>)); }
  CARDAN_INLINE const Motion<T>* H(int k) const { return const_cast<Workspace*>(this)->H(k); }
  CARDAN_INLINE Modal<T>* modal_of(int k) { return modal_[k]; }  ///< null for bodies of rigid kernels
  CARDAN_INLINE const Modal<T>* modal_of(int k) const { return modal_[k]; }

  /// Records of the dense hinges, all of one lane side by side; with slopes the first are values, and behind them stand for each hinge the
  /// slopes of its numbers, of each number along all directions.
  CARDAN_INLINE cardan_hinge_out* hinge_records(int lane) { return dense_.data() + static_cast<std::size_t>(lane) * n_dense_; }
  /// Number `at` of record i, counted from R_OP.
  CARDAN_INLINE T hinge_number(int i, int at) const {
    T a(0);
    if constexpr (kHasSlopes<T>) {
      a.x = record_of(0, i)[at];
      __builtin_memcpy(&a.d, const_cast<Workspace*>(this)->slopes_of(i) + (kWidth<T> - 1) * at, sizeof a.d);
    } else {
      for (int l = 0; l < kWidth<T>; ++l) set_lane(a, l, record_of(l, i)[at]);
    }
    return a;
  }
  CARDAN_INLINE double hinge_value(int i, int at) const { return record_of(0, i)[at]; }  ///< of the first lane
  CARDAN_INLINE void set_hinge_number(int i, int at, const T& a) {
    if constexpr (kHasSlopes<T>) {
      const_cast<double*>(record_of(0, i))[at] = a.x;
      __builtin_memcpy(slopes_of(i) + (kWidth<T> - 1) * at, &a.d, sizeof a.d);
    } else {
      for (int l = 0; l < kWidth<T>; ++l) const_cast<double*>(record_of(l, i))[at] = lane(a, l);
    }
  }

  /// Poses and velocities in the world: only where an op asks for them (gravity of a centre, outputs).
  void require_world();
  CARDAN_INLINE bool has_world() const { return !pose_W_.empty(); }
  CARDAN_INLINE Pose<T>& pose_W(int k) { return pose_W_[k]; }
  CARDAN_INLINE const Pose<T>& pose_W(int k) const { return pose_W_[k]; }
  CARDAN_INLINE Motion<T>& V(int k) { return V_[k]; }  ///< spatial velocity of B, B axes
  CARDAN_INLINE const Motion<T>& V(int k) const { return V_[k]; }

  Breakdown breakdown;
  std::size_t bytes() const;             ///< all of it
  std::size_t body_bytes(int k) const {  ///< of the core and the record of one body, where no core is shared
    const auto i = static_cast<std::size_t>(k);
    return (i + 1 < core_at_.size() ? core_at_[i + 1] : arena_bytes_) - core_at_[i];
  }
  std::vector<T> sines, cosines;           // of the axis hinges; filled up to a multiple of 8
  std::vector<T> articulated_q;            // P, D, G and poses are those of this q; only of trees of rigid bodies
  bool articulated = false;                // ... and are still there
  std::vector<RigidInertia<T>> composite;  // per body, for the mass matrix: only where it is asked for
  std::vector<T> columns;                  // of the mass matrix and of its inverse, likewise
  std::vector<T> rest;                     // nv zeros, likewise
  std::vector<T> correction;               // of v', where it is refined (nv)
  std::vector<Force<T>> loads;  // ... and what central gravity and wrenches on nodes do to each body: [moment about its mass centre; force]
  std::vector<T> sums;          // of a pass over the modes of a body: a number for each row of FlexibleBody::UV
  std::unique_ptr<LoopWork, void (*)(LoopWork*)> loops{nullptr, nullptr};  // of closed loops
  std::vector<double> family;   // q and v of one lane, for families that are called lane by lane; empty for double
  std::unique_ptr<T[]> curved;  // S of the curved node that was asked for last, of those that no hinge stands on; null where there are none

 private:
  static constexpr int kRecord = sizeof(cardan_hinge_out) / sizeof(double);
  CARDAN_INLINE const double* record_of(int lane, int i) const {
    return reinterpret_cast<const double*>(dense_.data() + static_cast<std::size_t>(lane) * n_dense_ + static_cast<std::size_t>(i));
  }
  /// With slopes: of hinge i, kWidth<T> - 1 of each number.
  CARDAN_INLINE double* slopes_of(int i) {
    return reinterpret_cast<double*>(dense_.data() + n_dense_) + static_cast<std::ptrdiff_t>(kWidth<T> - 1) * kRecord * i;
  }
  struct Free {
    void operator()(std::byte* p) const { ::operator delete[](p, std::align_val_t(64)); }
  };
  std::unique_ptr<std::byte[], Free> arena_;
  std::size_t arena_bytes_ = 0;
  // The record stands behind its core, but in lanes, where bodies may share cores (workspace_layout.hpp).
  CARDAN_INLINE std::byte* record(int k) {
    if constexpr (kStates<T>)
      return arena_.get() + record_at_[k];
    else
      return arena_.get() + core_at_[k] + sizeof(Core<T>);
  }
  std::vector<std::size_t> core_at_, record_at_;  // the second of lanes only
  std::size_t curved_size_ = 0;
  std::vector<Modal<T>*> modal_;
  std::vector<cardan_hinge_out> dense_;
  std::size_t n_dense_ = 0;
  std::vector<Pose<T>> pose_W_;
  std::vector<Motion<T>> V_;
  int n_bodies_ = 0;
};

/// Hinges of these sizes stand between most bodies that deform: what does not depend on the size is compiled into each of their sweeps; for
/// the rest once, as a function that they call (name_apart), which costs some percent of their time and spares a fifth of the code.
template <int NV>
inline constexpr bool kOften = NV <= 1;
#ifdef __clang__
#define CARDAN_APART [[gnu::noinline]] static
#else
#define CARDAN_APART [[gnu::noinline, gnu::noclone]] static
#endif

/// Calls visit<NV>() for a hinge with nv velocities.
template <class T, class Visit>
static void with_hinge_size(int nv, const Visit& visit) {
  switch (nv) {
    case 0:
      return visit.template operator()<0>();
    case 1:
      return visit.template operator()<1>();
    case 2:
      return visit.template operator()<2>();
    case 3:
      return visit.template operator()<3>();
    case 4:
      return visit.template operator()<4>();
    case 5:
      return visit.template operator()<5>();
    default:
      return visit.template operator()<6>();
  }
}

}  // namespace cardan::soa
