#pragma once
// Working memory of the sweeps, side by side in one arena, laid out when the workspace is made: per body a core, which is the same
// for every hinge, so that a sweep reaches an inboard body without knowing its hinge, and a record.
#include <cstddef>

#include "core/spatial/inertia.hpp"

namespace cardan::soa {

/// What a body tells its outboard bodies (w, gamma, E; then delta) and gathers from them (P): read by nobody else, so that bodies may
/// share one (Workspace). name [unit] (shape) frame -- meaning. All in the sweep frame of the body (B), A = inboard body.
template <class T>
struct Core {
  Vec3<T> w;                // [rad/s] angular velocity of B in inertial space
  Motion<T> gamma;          // [rad/s^2; m/s^2] gamma_b: acceleration at v' = 0 (gravity and prescribed motion inside)
  Motion<T> delta;          // [rad/s^2; m/s^2] part of gamma caused by v'
  ArticulatedInertia<T> P;  // [kg m^2, kg m, kg] articulated body inertia
  Mat3<T> E;                // [1/s^2] w'~ + w~ w~ at v' = 0: acceleration of a point p of the body = gamma.v + E p
};

/// E = w'~ + w~ w~, number by number: a copy of the whole would wait for its parts.
template <class T>
CARDAN_INLINE constexpr void set_acceleration_field(Mat3<T>& E, const Vec3<T>& w, const Vec3<T>& a) {
  const T xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z, xy = w.x * w.y, xz = w.x * w.z, yz = w.y * w.z;
  E.xx = -(yy + zz), E.xy = xy - a.z, E.xz = xz + a.y;
  E.yx = xy + a.z, E.yy = -(xx + zz), E.yz = yz - a.x;
  E.zx = xz - a.y, E.zy = yz + a.x, E.zz = -(xx + yy);
}

// The records. All begin with z [N m; N], the residual force M gamma_b + b - f_ext + sum Phi z+: made outward, read inward.

/// Hinges that turn about a coordinate axis of their body (AxisBody): the pose is a cosine and a sine (Workspace::cosines).
/// Of a rotor the sweeps use nu = tau + load only; its core is filled where it is looked at (core/dynamics/observe.cpp).
template <class T>
struct AxisRecord {
  Force<T> z;
  Force<T> G;       // gain P H* D^-1; component i of G.n is 1 and not stored
  T inverse_D, nu;  // [1/(kg m^2)], [rad/s^2]
  T load;           // [N m] rotor: moment of node wrenches about its axis
};

/// Six degrees of freedom: D = H P H* with an invertible H, so that P = L d L* is all there is to factor.
template <class T>
struct FreeRecord {
  Force<T> z;
  Pose<T> X;
  T L[21];   // of P, by rows: below the diagonal L, on it 1/d
  T tau[6];  // wrench of the hinge forces at P
};

template <class T, int NV>
struct Hinge {
  Motion<T> H[NV > 0 ? NV : 1];       // columns of H*, at B
  Force<T> G[NV > 0 ? NV : 1];        // columns of the gain G = P H* D^-1
  T nu[NV > 0 ? NV : 1];              // D^-1 eps
  T L[NV > 0 ? NV*(NV + 1) / 2 : 1];  // D = L L*, packed by rows; D itself for NV = 1 in rigid kernels
};

/// How the modes of the inboard body move O: by [Jl psi; phi] at rho, in its axes about its origin. The sums over its modes are
/// taken by the inboard body, for all its nodes in one pass. Where its family tells how O moves (NodeShapes::curved), S' eta' and S stand
/// behind it in the arena.
template <class T>
struct ModalNode {
  Mat3<T> Jl;
  Vec3<T> rho;                    // [m]
  T moved[6], rate[6], accel[6];  // [rad, m]: sum of [psi; phi] times eta, eta', eta''; of a curved node x, S eta', S eta''

  static constexpr std::size_t curved_size(std::size_t m) { return 6 + 6 * m; }
  CARDAN_INLINE T* bent() { return reinterpret_cast<T*>(this + 1); }
  CARDAN_INLINE T* S() { return bent() + 6; }
  CARDAN_INLINE const T* S() const { return const_cast<ModalNode*>(this)->S(); }
};

/// The square root of an inertia, the rows of force first, with a hinge reflected out of it: L Q, Q the product of the reflections.
template <class T>
struct HingeRoot {
  T L[36], inverse[6];  // P_r = L L*, columns; 1 / L_jj, 0 where P_r has no inertia
  T v[36], scale[6];    // reflections 1 - scale v v* that take the hinge out of L, one per hinge velocity
};

/// Of a body on a deforming node whose inboard body is eliminated through its nodes (mathematics/flexible.md, 7): P+ = C C*
/// and z+ = C zeta + e. No P+ and no z+ is formed.
template <class T>
struct NodeRoot : HingeRoot<T> {
  T C[36];            // columns, moment about the origin of the inboard body, in its axes
  T N[36];            // rows: the same columns as forces on the node's shapes
  T zeta[6], phi[6];  // what goes through the hinge in the end: C phi + e
  T e[6], e_N[6];     // at the origin of the inboard body; on the node's shapes
};

/// Of a hinge that is factored in square-root form (kernels_square_root.hpp): the columns of L Q, and y.
template <class T>
struct SquareRoot : HingeRoot<T> {
  Force<T> along[6];   // per hinge velocity those that the hinge moves along, L Q T = P H*; zero of a prescribed one
  Force<T> across[6];  // the others, P+ = across across*; zero where a reflection took one out
  T y[6];              // per hinge velocity: T nu
};

/// Work of a body with n outboard hinges on deforming nodes, N = 6 n: B (N x N), A (N x N), its inverse
/// pivots, u, t and e = -Q* e of the nodes (N each), columns of X~* C L^-* and of M_re V (N of 6 each).
static inline std::size_t by_nodes_size(int n) { return static_cast<std::size_t>(2 * 36 * n * n + 16 * 6 * n); }
template <class T>
struct ByNodes {
  T *B, *A, *inverse, *u, *t, *e, *XC, *MV;
  ByNodes(T* at, int N) : B(at), A(B + N * N), inverse(A + N * N), u(inverse + N), t(u + N), e(t + N), XC(e + N), MV(XC + 6 * N) {}
};

/// Pointers into the arena of what only flexible bodies, and bodies that hang on a deforming node, have. m = own modes.
/// Null where the body has none.
template <class T>
struct Modal {
  T *P_re, *P_ee;        // 6 x m, m x m (column-major): modal blocks of P; each null where the block of M_fl stays constant
  T* U;                  // m x 6 (row j: 6 numbers): L^-1 P_re'* where P_ee' = L D L* is factored, else M_ee^-1 M_re*
  T *z, *nu, *accel;     // m each: residual (without M_re* gamma where P_re is null), nu_e of it (with a factor P_ee': L^-1 eps_e), eta''
  T* C;                  // 6 x m: X_B Gamma_P, null when the pnode does not deform
  ModalNode<T>* node;    // null when the onode does not deform
  NodeRoot<T>* root;     // null unless the inboard body is eliminated through its nodes
  T* by_nodes;           // work of eliminate_by_nodes, null unless the body is eliminated through its outboard nodes
  T* b;                  // 6 + m: velocity terms of the family
  RigidInertia<T> M_rr;  // of M_fl(eta)
  ArticulatedInertia<T> P_r;  // after the modes are eliminated
  double* family;             // eta, eta', M_re, M_ee, b of one lane, for the family's functions; null for double, which needs no copy
};

template <class T, int NV>
struct RigidRecord {
  Force<T> z;
  Pose<T> X;  // [-, m] B in A: Phi* = X_BA
  Hinge<T, NV> hinge;
};
template <class T, int NV>
struct GeneralRecord {
  Force<T> z;
  Pose<T> X;
  Hinge<T, NV> hinge;
  Modal<T> modal;
};
template <class T, int NV>
struct SquareRootRecord : GeneralRecord<T, NV> {
  SquareRoot<T> square_root;
};

}  // namespace cardan::soa
