#pragma once
// What wrenches on nodes do to the motion of nodes of a tree of rigid bodies: C = J M^-1 J* = sum over the bodies of E* D^-1 E, where E = H
// F are the hinge forces of unit wrenches F that an articulated body sees, tip to base (mathematics 6.1). Only the paths from the nodes to
// the base are walked; the six wrenches on a node are lanes.
#include "core/soa/columns.hpp"
#include "core/soa/kernels_acceleration.hpp"

namespace cardan::soa {

/// Memory of one call, for s nodes.
struct NodeColumns {
  using Six = Lanes<8>;  // moments and forces along the axes of the node, two lanes of zeros
  struct Node {
    int node, next;  // index into Model::nodes; who else has come to the same body, -1: nobody
    Force<Six> F;
    Six E[6], y[6];  // E, and D^-1 E
  };
  struct Block {
    Six row[6];
  };
  int n;
  Node* nodes;
  int *first, *last;  // per body: who has come there; -1: nobody
  Block* blocks;      // block (a, b) of C, a <= b, at b (b + 1) / 2 + a

  /// Node a comes to a body.
  CARDAN_INLINE void arrive(int body, int a) {
    (first[body] < 0 ? first[body] : nodes[last[body]].next) = a;
    last[body] = a;
  }
  /// All that have come to a body go on to another.
  CARDAN_INLINE void go_on(int from, int to) {
    (first[to] < 0 ? first[to] : nodes[last[to]].next) = first[from];
    last[to] = last[from];
  }
};

/// The unit wrenches on a node as forces on its body, at its origin.
CARDAN_INLINE Force<NodeColumns::Six> unit_wrenches(const Pose<double>& node) {
  using Six = NodeColumns::Six;
  const Mat3<double>& R = node.R;
  const Vec3<Six> n{Six(Six::Pack{R.xx, R.xy, R.xz, 0, 0, 0, 0, 0}), Six(Six::Pack{R.yx, R.yy, R.yz, 0, 0, 0, 0, 0}),
                    Six(Six::Pack{R.zx, R.zy, R.zz, 0, 0, 0, 0, 0})};
  const Vec3<Six> f{Six(Six::Pack{0, 0, 0, R.xx, R.xy, R.xz, 0, 0}), Six(Six::Pack{0, 0, 0, R.yx, R.yy, R.yz, 0, 0}),
                    Six(Six::Pack{0, 0, 0, R.zx, R.zy, R.zz, 0, 0})};
  return {n + cross(cast<Six>(node.p), f), f};
}

/// C += E* D^-1 E of the n components of one hinge, for all who have come to its body.
template <int N>
CARDAN_INLINE void add_compliance(NodeColumns& work, int body) {
  for (int b = work.first[body]; b >= 0; b = work.nodes[b].next)
    for (int a = work.first[body]; a >= 0; a = work.nodes[a].next) {
      if (a > b) continue;
      const NodeColumns::Node &left = work.nodes[a], &right = work.nodes[b];
      NodeColumns::Block& C = work.blocks[b * (b + 1) / 2 + a];
      unrolled<6>([&](auto r) CARDAN_INLINE_BODY {
        NodeColumns::Six sum = C.row[r];
        for (int j = 0; j < N; ++j) sum = sum + NodeColumns::Six(left.E[j].x[decltype(r)::value]) * right.y[j];
        C.row[r] = sum;
      });
    }
}

/// f(node) of all who have come to a body.
template <class F>
CARDAN_INLINE void for_arrived(NodeColumns& work, int body, const F& f) {
  for (int a = work.first[body]; a >= 0; a = work.nodes[a].next) f(work.nodes[a]);
}

template <int NV, class T>
static void compliance_rigid(Workspace<T>& ws, NodeColumns& work, int k) {
  using Six = NodeColumns::Six;
  const Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
  for_arrived(work, k, [&](NodeColumns::Node& a) {
    for (int j = 0; j < NV; ++j) a.y[j] = a.E[j] = dot(cast<Six>(hinge.H[j]), a.F);
    for (int j = 0; j < NV; ++j) a.F -= a.E[j] * cast<Six>(hinge.G[j]);
    if constexpr (NV == 1)
      a.y[0] = a.y[0] / Six(hinge.L[0]);
    else
      for (int j = 0; j < NV; ++j) {  // half of it: E becomes y
        const T* row = hinge.L + j * (j + 1) / 2;
        for (int i = 0; i < j; ++i) a.y[j] = a.y[j] - Six(row[i]) * a.y[i];
        a.E[j] = a.y[j] = a.y[j] / Six(row[j]);
      }
    a.F = to_inboard(cast<Six>(ws.X(k)), a.F);
  });
  add_compliance<NV>(work, k);
}

/// Of six free components: P = L d L*. Nothing goes on.
template <class T>
static void compliance_free(Workspace<T>& ws, NodeColumns& work, int k) {
  using Six = NodeColumns::Six;
  const T* L = ws.free(k).L;
  for_arrived(work, k, [&](NodeColumns::Node& a) {
    const Six F[6] = {a.F.n.x, a.F.n.y, a.F.n.z, a.F.f.x, a.F.f.y, a.F.f.z};
    for (int i = 0; i < 6; ++i) {
      a.E[i] = F[i];
      for (int j = 0; j < i; ++j) a.E[i] = a.E[i] - Six(L[i * (i + 1) / 2 + j]) * a.E[j];
      a.y[i] = a.E[i] * Six(L[i * (i + 1) / 2 + i]);
    }
  });
  add_compliance<6>(work, k);
}

/// Needs P, D, G of all bodies; nobody has come anywhere yet.
template <class T>
static void compliance_of_nodes(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, NodeColumns& work) {
  using Six = NodeColumns::Six;
  for (int i = 0; i < work.n * (work.n + 1) / 2; ++i)
    for (Six& row : work.blocks[i].row) row = Six(0);
  for (int a = 0; a < work.n; ++a) {
    NodeColumns::Node& own = work.nodes[a];
    const UserNode& node = model.nodes[own.node];
    own.F = unit_wrenches(node.shapes.pose);
    work.arrive(node.sweep, a);
  }
  for (int k = static_cast<int>(model.bodies.size()) - 1; k > 0; --k) {
    if (work.first[k] < 0) continue;
    const SweepBody& b = model.bodies[k];
    if (b.kind == BodyKernel::rotor) {
      const AxisBody& r = model.axis_bodies[k];
      const Vec3<Six> u = rotor_axis<Six>(r), axis = cast<Six>(b.axis);
      const Pose<Six> X = cast<Six>(pose_in_inboard(model, ws, k, in.q));
      for_arrived(work, k, [&](NodeColumns::Node& a) {
        a.E[0] = dot(axis, a.F.n);
        a.y[0] = a.E[0] / Six(r.J_axial);
        a.F = to_inboard(X, a.F);
        a.F.n -= a.E[0] * u;
      });
      add_compliance<1>(work, k);
    } else if (is_axis(b.kind)) {
      const AxisBody& axis = model.axis_bodies[k];
      const AxisRecord<T>& body = ws.axis(k);
      const Force<Six> G = cast<Six>(body.G);
      const Six c(ws.cosines[axis.angle]), s(ws.sines[axis.angle]), inverse(body.inverse_D);
      for_axis(
          axis.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
            constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
            for_arrived(work, k, [&](NodeColumns::Node& a) CARDAN_INLINE_BODY {
              Force<Six> F = a.F;
              const Six e = at<I>(F.n);
              a.E[0] = e, a.y[0] = e * inverse;
              at<I>(F.n) = Six(0);
              at<J>(F.n) = at<J>(F.n) - e * at<J>(G.n);
              at<K>(F.n) = at<K>(F.n) - e * at<K>(G.n);
              F.f -= e * G.f;
              a.F = force_to_inboard<Six, I, TILT>(axis, c, s, F);
            });
          });
      add_compliance<1>(work, k);
    } else if (b.kind == BodyKernel::free) {
      compliance_free(ws, work, k);
      continue;
    } else {
      with_hinge_size<T>(b.nv, [&]<int NV>() { compliance_rigid<NV>(ws, work, k); });
    }
    work.go_on(k, b.parent);
  }
}

}  // namespace cardan::soa
