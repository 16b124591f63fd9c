#pragma once
// Constructor of Workspace: sizes and pointers of every record. Included by the files that instantiate a scalar.
#include <algorithm>
#include <cstring>
#include <new>
#include <type_traits>

#include "core/soa/workspace.hpp"

namespace cardan::soa {

template <class T>
static constexpr std::size_t family_scratch(std::size_t m) {
  return std::is_same_v<T, double> || m == 0 ? 0 : 2 * m + 6 * m + m * m + 6 + m;
}

/// Lanes: which core each body makes use of, and how many are shared. A body needs w, gamma, E and delta until its last outboard body has
/// read them, and P from the moment that this one has written it: the same bodies, there and back. So bodies of axis kernels share cores
/// as a stack does, and what a pass brings into the cache stays small on large trees (few bodies stay in the nearest one). Not those that
/// rotors or a second pass read (refine), nor those whose P the outward sweep writes. -1: a core of its own.
struct SharedCores {
  std::vector<int> of;
  int count = 0;
};
static inline SharedCores share_cores(const SweepModel& model) {
  const int n = static_cast<int>(model.bodies.size());
  SharedCores cores{std::vector<int>(model.bodies.size(), -1)};
  std::vector<int> last(model.bodies.size());
  constexpr int few = 8;
  std::vector<bool> shares(model.bodies.size(), n > few && model.graded.swept.empty());
  for (int k = 1; k < n; ++k) {
    const SweepBody& b = model.bodies[k];
    const bool rotor = b.kind == BodyKernel::rotor;
    last[k] = k, last[b.parent] = k;
    if (rotor) shares[b.parent] = false;
    if (rotor || !is_axis(b.kind) || !(model.axis_bodies[k].leaf || model.axis_bodies[k].written_by_child)) shares[k] = false;
  }
  std::vector<int> until;  // of each shared core: the last body that needs it
  for (int k = 1; k < n; ++k) {
    if (!shares[k]) continue;
    const auto free = std::ranges::find_if(until, [&](int last_user) { return last_user < k; });
    cores.of[k] = static_cast<int>(free - until.begin());
    if (free == until.end())
      until.push_back(last[k]);
    else
      *free = last[k];
  }
  cores.count = static_cast<int>(until.size());
  return cores;
}

template <class T>
Workspace<T>::Workspace(const SweepModel& model) {
  const std::size_t n = model.bodies.size();
  n_bodies_ = static_cast<int>(n);
  for (auto* column : {&sines, &cosines}) column->resize((model.angles.size() + 7) / 8 * 8, T(0));
  core_at_.resize(n);
  modal_.assign(n, nullptr);
  n_dense_ = static_cast<std::size_t>(model.n_dense);
  dense_.resize(n_dense_ * kWidth<T>);
  loads.resize(model.graded.swept.size());
  if (!loads.empty()) correction.resize(static_cast<std::size_t>(model.nv), T(0));
  if (model.rigid) articulated_q.resize(static_cast<std::size_t>(model.nq));
  if constexpr (!std::is_same_v<T, double>) family.resize(static_cast<std::size_t>(model.nq + model.nv));
  struct Counts {
    std::size_t re, ee, U, m, b, C, by_nodes, node, root;
    std::size_t all() const { return re + ee + U + 3 * m + b + C + by_nodes + node + root; }
  };
  std::vector<Counts> counts(n);
  std::vector<std::size_t> modal_at(n, 0);
  const auto round = [](std::size_t bytes) { return (bytes + 63) / 64 * 64; };
  std::vector<bool> ee_changes(n, false);  // some outboard hinge or the pnode adds to P_ee
  for (const FlexibleBody& f : model.flexible)
    if (!f.attached.empty()) sums.resize(std::max(sums.size(), 6 + 6 * f.attached.size()), T(0));
  for (std::size_t k = 1; k < n; ++k) {
    const SweepBody& b = model.bodies[k];
    if (b.n_modes > 0 && model.flexible[b.flexible].curved) curved_size_ = std::max(curved_size_, 6 * static_cast<std::size_t>(b.n_modes));
    if (b.onode >= 0) ee_changes[b.parent] = true;
    if (b.pnode >= 0 && model.shapes[b.pnode].deforms()) ee_changes[k] = true;
  }
  if (curved_size_ > 0) curved.reset(new T[curved_size_]());
  constexpr bool lanes = kStates<T>;
  const SharedCores shared = lanes ? share_cores(model) : SharedCores{std::vector<int>(n, -1)};
  if (lanes) record_at_.resize(n);
  std::size_t total = static_cast<std::size_t>(shared.count) * sizeof(Core<T>);
  /// Room for a core, if the body has one of its own, and for the record behind it.
  const auto place = [&](std::size_t k, std::size_t record) {
    const int share = shared.of[k];
    core_at_[k] = share < 0 ? total : static_cast<std::size_t>(share) * sizeof(Core<T>);
    if (share < 0) total += sizeof(Core<T>);
    if (lanes) record_at_[k] = total;
    total = round(total + record);
  };
  place(0, sizeof(Force<T>));  // ground
  for (std::size_t k = 1; k < n; ++k) {
    const SweepBody& b = model.bodies[k];
    std::size_t record = 0;
    if (is_axis(b.kind) || b.kind == BodyKernel::free) {
      place(k, is_axis(b.kind) ? sizeof(AxisRecord<T>) : sizeof(FreeRecord<T>));
      continue;
    }
    with_hinge_size<T>(b.nv, [&]<int NV>() {
      record = b.square_root        ? sizeof(SquareRootRecord<T, NV>)
               : is_general(b.kind) ? sizeof(GeneralRecord<T, NV>)
                                    : sizeof(RigidRecord<T, NV>);
    });
    place(k, record);
    if (!is_general(b.kind)) continue;
    const auto m = static_cast<std::size_t>(b.n_modes);
    Counts c{};
    if (m > 0) {
      const FlexibleBody& f = model.flexible[b.flexible];
      bool masked = false;
      if (model.has_prescribed())
        for (int j = 0; j < b.n_modes; ++j) masked = masked || model.prescribed[b.etadot + j];
      c.m = m;
      c.ee = !f.by_nodes && (!f.M_ee_constant || ee_changes[k] || masked || f.pushed_by_loops) ? m * m : 0;
      c.re = c.ee > 0 || !f.M_re_constant ? 6 * m : 0;
      c.U = c.ee > 0 || (c.re > 0 && !f.M_ee_identity) ? 6 * m : 0;
      c.b = f.constant ? 0 : 6 + m;
      c.C = b.pnode >= 0 && model.shapes[b.pnode].deforms() ? 6 * m : 0;
      c.by_nodes = f.by_nodes ? by_nodes_size(static_cast<int>(f.attached.size())) : 0;
    }
    if (b.onode >= 0) {
      c.node = sizeof(ModalNode<T>) / sizeof(T);
      if (model.shapes[b.onode].is_curved()) c.node += ModalNode<T>::curved_size(static_cast<std::size_t>(b.n_parent_modes));
      const SweepBody& inboard = model.bodies[b.parent];
      c.root = model.flexible[inboard.flexible].by_nodes ? sizeof(NodeRoot<T>) / sizeof(T) : 0;
    }
    counts[k] = c;
    modal_at[k] = total;
    total += round(sizeof(T) * c.all() + sizeof(double) * family_scratch<T>(m));
  }
  arena_bytes_ = total;
  arena_.reset(new (std::align_val_t(64)) std::byte[total]);
  std::memset(arena_.get(), 0, total);
  for (std::size_t k = 0; k < n; ++k) new (&core(static_cast<int>(k))) Core<T>();
  new (&z(0)) Force<T>();
  for (std::size_t k = 1; k < n; ++k) {
    const SweepBody& b = model.bodies[k];
    std::byte* at = record(static_cast<int>(k));
    if (is_axis(b.kind)) {
      new (at) AxisRecord<T>();
      if (b.kind != BodyKernel::rotor) core(static_cast<int>(k)).P = cast<T>(model.axis_bodies[k].P);  // a leaf's stays, where it is alone
      continue;
    }
    if (b.kind == BodyKernel::free) {
      new (at) FreeRecord<T>();
      continue;
    }
    with_hinge_size<T>(b.nv, [&]<int NV>() {
      if (!is_general(b.kind)) {
        new (at) RigidRecord<T, NV>();
        return;
      }
      GeneralRecord<T, NV>* const record = b.square_root ? new (at) SquareRootRecord<T, NV>() : new (at) GeneralRecord<T, NV>();
      Modal<T>& modal = record->modal;
      modal_[k] = &modal;
      T* next = reinterpret_cast<T*>(arena_.get() + modal_at[k]);
      const auto take = [&](std::size_t count) -> T* {
        if (count == 0) return nullptr;
        T* p = next;
        for (std::size_t i = 0; i < count; ++i) new (p + i) T(0);
        next += count;
        return p;
      };
      const Counts& c = counts[k];
      modal.P_re = take(c.re);
      modal.P_ee = take(c.ee);
      modal.U = c.U > 0 ? take(c.U) : modal.P_re;  // M_ee = 1
      modal.z = take(c.m);
      modal.nu = take(c.m);
      modal.accel = take(c.m);
      modal.b = take(c.b);
      modal.C = take(c.C);
      modal.by_nodes = take(c.by_nodes);
      if (c.by_nodes > 0) {
        const FlexibleBody& f = model.flexible[b.flexible];
        const ByNodes<T> w(modal.by_nodes, 6 * static_cast<int>(f.attached.size()));
        for (std::size_t i = 0; i < f.MV.size(); ++i) w.MV[i] = T(f.MV[i]);
      }
      if (c.node > 0) modal.node = new (take(c.node)) ModalNode<T>();
      if (c.root > 0) modal.root = new (take(c.root)) NodeRoot<T>();
      modal.family = family_scratch<T>(c.m) > 0 ? reinterpret_cast<double*>(next) : nullptr;
    });
  }
  if (model.world) require_world();
}

template <class T>
void Workspace<T>::require_world() {
  pose_W_.resize(static_cast<std::size_t>(n_bodies_));
  V_.resize(static_cast<std::size_t>(n_bodies_));
}

template <class T>
std::size_t Workspace<T>::bytes() const {
  return arena_bytes_ + 2 * sines.size() * sizeof(T) + family.size() * sizeof(double) + articulated_q.size() * sizeof(T) +
         composite.size() * sizeof(RigidInertia<T>) + (rest.size() + sums.size() + correction.size() + curved_size_) * sizeof(T) +
         loads.size() * sizeof(Force<T>) + dense_.size() * sizeof(cardan_hinge_out) + pose_W_.size() * sizeof(Pose<T>) +
         V_.size() * sizeof(Motion<T>);
}

}  // namespace cardan::soa
