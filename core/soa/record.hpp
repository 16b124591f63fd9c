#pragma once
// Working memory of the sweeps: one record per body, side by side in one arena, laid out when the workspace is made.
// The head of a record is the same for every hinge, so that a sweep reaches an inboard body without knowing its hinge.
#include "core/spatial/inertia.hpp"

namespace cardan::soa {

/// name [unit] (shape) frame -- meaning. All in the sweep frame of the body (B), A = inboard body.
template <class T>
struct Core {
  Vec3<T> w;                // [rad/s] angular velocity of B in inertial space
  Motion<T> gamma;          // [rad/s^2; m/s^2] gamma_b: acceleration at v' = 0 (gravity and prescribed motion inside)
  Force<T> z;               // [N m; N] residual force M gamma_b + b - f_ext + sum Phi z+
  ArticulatedInertia<T> P;  // [kg m^2, kg m, kg] articulated body inertia
  Motion<T> delta;          // [rad/s^2; m/s^2] part of gamma caused by v'
  Mat3<T> E;                // [1/s^2] w'~ + w~ w~ at v' = 0: acceleration of a point p of the body = gamma.v + E p
};

/// w'~ + w~ w~.
template <class T>
static constexpr Mat3<T> acceleration_field(const Vec3<T>& w, const Vec3<T>& a) {
  const T xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z, xy = w.x * w.y, xz = w.x * w.z, yz = w.y * w.z;
  return {-(yy + zz), xy - a.z, xz + a.y, xy + a.z, -(xx + zz), yz - a.x, xz - a.y, yz + a.x, -(xx + yy)};
}

/// Hinges that turn about a coordinate axis of their body (AxisBody): the pose is a cosine and a sine (Workspace::cosines).
/// Of a rotor the sweeps use nu = tau + load only; its core is filled where it is looked at (core/dynamics/observe.cpp).
template <class T>
struct AxisRecord {
  Core<T> core;
  Force<T> G;               // gain P H* D^-1
  T D, nu;                  // [kg m^2], [rad/s^2]
  T load;                   // [N m] rotor: moment of node wrenches about its axis
};

/// Six degrees of freedom: D = H P H* with an invertible H, so that P = L d L* is all there is to factor.
template <class T>
struct FreeRecord {
  Core<T> core;
  Pose<T> X;
  T L[21];                  // of P, by rows: below the diagonal L, on it 1/d
  T tau[6];                 // wrench of the hinge forces at P
};

template <class T, int NV>
struct Hinge {
  Motion<T> H[NV > 0 ? NV : 1];  // columns of H*, at B
  Force<T> G[NV > 0 ? NV : 1];   // columns of the gain G = P H* D^-1
  T nu[NV > 0 ? NV : 1];         // D^-1 eps
  T L[NV > 0 ? NV * (NV + 1) / 2 : 1];  // D = L L*, packed by rows
};

/// Pointers into the arena of what only flexible bodies, and bodies that hang on a deforming node, have. m = own modes,
/// mp = modes of the inboard body. Null where the body has none.
template <class T>
struct Modal {
  T *P_re, *P_ee;      // 6 x m, m x m (column-major): modal blocks of P; P_ee null where M_ee stays constant
  T* U;                // m x 6 (row j: 6 numbers): P_ee'^-1 P_re'*
  T *z, *nu, *accel;   // m each: residual, nu_e, eta''
  T* C;                // 6 x m: X_B Gamma_P, null when the pnode does not deform
  T* Y;                // 6 x 6, null when the onode does not deform: modal columns of Phi* are Y S, S the shapes of the node
  ArticulatedInertia<T> P_plus;  // bodies with Y: P+, for the inboard body's modes
  T* compliant;        // scratch of Woodbury (mathematics 4.10), null unless outboard nodes deform and M_ee is constant
  T* M_rr;             // 10: m, mc, J of M_fl(eta)
  T* b;                // 6 + m: scratch of the bias
  ArticulatedInertia<T> P_r;  // after the modes are eliminated
  double* family;      // eta, eta', M_re, M_ee, b of one lane, for the family's functions; null for double, which needs no copy
};

template <class T, int NV>
struct RigidRecord {
  Core<T> core;
  Pose<T> X;                // [-, m] B in A: Phi* = X_BA
  Hinge<T, NV> hinge;
};
template <class T, int NV>
struct GeneralRecord {
  Core<T> core;
  Pose<T> X;
  Hinge<T, NV> hinge;
  Modal<T> modal;
};

}  // namespace cardan::soa
