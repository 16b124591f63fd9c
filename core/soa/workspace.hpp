#pragma once
// Scratch of the sweeps for one model and one scalar: one arena, allocated once, one record per body. Made by the caller,
// one per thread; holds no state of the simulation (everything in it follows from t, q, v and the inputs).
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "core/model/model.hpp"
#include "core/soa/record.hpp"

namespace cardan::soa {

/// A wrench [moment; force] on a node. In node axes, or in world axes.
template <class T>
struct NodeWrench {
  int node = 0;  // index into Model::nodes
  bool world_axes = false;
  Force<T> f;
};

/// What a right-hand side depends on. Pointers are in the user's order; null = zero.
template <class T>
struct Inputs {
  const T* q = nullptr;
  const T* v = nullptr;
  const T* tau = nullptr;                        // generalised forces of actuators, dual to v
  const T* vdot = nullptr;                       // all components (inverse dynamics); prescribed ones, the others zero (forward)
  std::span<const NodeWrench<T>> wrenches = {};
  bool gravity = true;                           // false: leave gravity out
};

/// What stopped a sweep: a direction without inertia.
struct Breakdown {
  int body = 0;        // sweep index; 0 = none
  int component = -1;  // velocity component of the hinge; -1: a mode
  double value = 0.0, limit = 0.0;
};

template <class T>
class Workspace {
 public:
  explicit Workspace(const Model& model);

  Core<T>& core(int k) { return *reinterpret_cast<Core<T>*>(arena_.get() + offset_[static_cast<std::size_t>(k)]); }
  const Core<T>& core(int k) const { return const_cast<Workspace*>(this)->core(k); }
  template <int NV>
  Hinge<T, NV>& hinge(int k) {
    return reinterpret_cast<RigidRecord<T, NV>*>(arena_.get() + offset_[static_cast<std::size_t>(k)])->hinge;
  }
  template <int NV>
  Modal<T>& modal(int k) {
    return reinterpret_cast<GeneralRecord<T, NV>*>(arena_.get() + offset_[static_cast<std::size_t>(k)])->modal;
  }
  AxisRecord<T>& axis(int k) { return *reinterpret_cast<AxisRecord<T>*>(arena_.get() + offset_[static_cast<std::size_t>(k)]); }
  const AxisRecord<T>& axis(int k) const { return const_cast<Workspace*>(this)->axis(k); }
  std::byte* base() { return arena_.get(); }
  std::size_t offset(int k) const { return offset_[static_cast<std::size_t>(k)]; }

  // Access by run-time kind, for what is not in the inner loop.
  /// Pose of B in A of a body with a stored pose (not an axis record).
  Pose<T>& X(int k) { return *reinterpret_cast<Pose<T>*>(arena_.get() + offset_[static_cast<std::size_t>(k)] + sizeof(Core<T>)); }
  const Pose<T>& X(int k) const { return const_cast<Workspace*>(this)->X(k); }
  /// Columns of H* at B, likewise.
  Motion<T>* H(int k) { return reinterpret_cast<Motion<T>*>(arena_.get() + offset_[static_cast<std::size_t>(k)] + sizeof(Core<T>) + sizeof(Pose<T>)); }
  const Motion<T>* H(int k) const { return const_cast<Workspace*>(this)->H(k); }
  Modal<T>* modal_of(int k) { return modal_[static_cast<std::size_t>(k)]; }  ///< null for bodies of rigid kernels
  const Modal<T>* modal_of(int k) const { return modal_[static_cast<std::size_t>(k)]; }

  cardan_hinge_out* hinge_records() { return dense_.data(); }
  const cardan_hinge_out& hinge_record(int i) const { return dense_[static_cast<std::size_t>(i)]; }

  /// Poses and velocities in the world: only where an op asks for them (gravity of a centre, outputs).
  void require_world();
  bool has_world() const { return !pose_W_.empty(); }
  Pose<T>& pose_W(int k) { return pose_W_[static_cast<std::size_t>(k)]; }
  const Pose<T>& pose_W(int k) const { return pose_W_[static_cast<std::size_t>(k)]; }
  Motion<T>& V(int k) { return V_[static_cast<std::size_t>(k)]; }  ///< spatial velocity of B, B axes
  const Motion<T>& V(int k) const { return V_[static_cast<std::size_t>(k)]; }

  Breakdown breakdown;
  std::size_t bytes() const;  ///< all of it
  std::vector<T> angles, sines, cosines;  // of the axis hinges, in sweep order: computed in one go

 private:
  struct Free {
    void operator()(std::byte* p) const { ::operator delete[](p, std::align_val_t(64)); }
  };
  std::unique_ptr<std::byte[], Free> arena_;
  std::size_t arena_bytes_ = 0;
  std::vector<std::size_t> offset_;
  std::vector<Modal<T>*> modal_;
  std::vector<cardan_hinge_out> dense_;
  std::vector<Pose<T>> pose_W_;
  std::vector<Motion<T>> V_;
  int n_bodies_ = 0;
};

}  // namespace cardan::soa
