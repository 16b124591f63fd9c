#pragma once
// Rigid bodies that turn about a coordinate axis e_i of their own frame: the innermost kernels. compile() chooses the body
// frames so that R_AB = R_O R_i(q + q0) with R_O = 1 ("aligned") or R_O = Rz(alpha) Ry(beta) ("tilt", i = z), and so that
// the offset l of B in O has no component along the axis. Then every rotation is one to three rotations in a plane, P H* is
// a stored column, and the hinge row and column of P+ are zeros that are never computed.
// `cardan describe` prints the flops of each, counted on these very lines (cost.hpp).
#include "core/soa/workspace.hpp"

namespace cardan::soa {

/// v <- R_i(theta) v (from the turned axes to the fixed ones), and its inverse.
template <int I, class T>
CARDAN_INLINE constexpr void turn(Vec3<T>& v, const T& c, const T& s) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  const T j = at<J>(v), k = at<K>(v);
  at<J>(v) = c * j - s * k;
  at<K>(v) = s * j + c * k;
}
template <int I, class T>
CARDAN_INLINE constexpr void turn_back(Vec3<T>& v, const T& c, const T& s) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  const T j = at<J>(v), k = at<K>(v);
  at<J>(v) = c * j + s * k;
  at<K>(v) = c * k - s * j;
}
/// s <- R_i s R_i*.
template <int I, class T>
CARDAN_INLINE constexpr void turn(Sym3<T>& m, const T& c, const T& s) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  const T jj = entry<J, J>(m), kk = entry<K, K>(m), jk = entry<J, K>(m), ij = entry<I, J>(m), ik = entry<I, K>(m);
  const T cs = c * s, ss = s * s, d = jj - kk, e = ss * d + (cs + cs) * jk;  // jj' = jj - e, kk' = kk + e
  entry<J, J>(m) = jj - e;
  entry<K, K>(m) = kk + e;
  entry<J, K>(m) = cs * d + (T(1) - (ss + ss)) * jk;
  entry<I, J>(m) = c * ij - s * ik;
  entry<I, K>(m) = s * ij + c * ik;
}
/// The same of the 2 x 2 block in the plane of a matrix that is not symmetric: its trace and its skew part stay, the rest turns twice as
/// far.
template <class T>
CARDAN_INLINE constexpr void turn_block(T& jj, T& jk, T& kj, T& kk, const T& c, const T& s) {
  const T cs = c * s, ss = s * s, d = jj - kk, t = jk + kj, e = ss * d + cs * t, f = cs * d - ss * t;
  jj = jj - e;
  kk = kk + e;
  jk = jk + f;
  kj = kj + f;
}
/// b <- R_i b R_i*.
template <int I, class T>
CARDAN_INLINE constexpr void turn(Mat3<T>& b, const T& c, const T& s) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  const T ij = entry<I, J>(b), ik = entry<I, K>(b), ji = entry<J, I>(b), ki = entry<K, I>(b);
  turn_block(entry<J, J>(b), entry<J, K>(b), entry<K, J>(b), entry<K, K>(b), c, s);
  entry<I, J>(b) = c * ij - s * ik;
  entry<I, K>(b) = s * ij + c * ik;
  entry<J, I>(b) = c * ji - s * ki;
  entry<K, I>(b) = s * ji + c * ki;
}

/// How O stands in the inboard body. Body, here and below: AxisBody, or such numbers of several bodies side by side (AlikeHinges).
enum class Tilt { none, beta, alpha_beta };

template <Tilt TILT, class T, class V, class Body>
CARDAN_INLINE constexpr void untilt(const Body& b, V& v) {  // inboard axes -> O axes, vectors
  if constexpr (TILT == Tilt::alpha_beta) turn_back<2>(v, T(b.cos_alpha), T(b.sin_alpha));
  if constexpr (TILT != Tilt::none) turn_back<1>(v, T(b.cos_beta), T(b.sin_beta));
}
template <Tilt TILT, class T, class V, class Body>
CARDAN_INLINE constexpr void tilt(const Body& b, V& v) {  // O axes -> inboard axes: vectors, Sym3, Mat3
  if constexpr (TILT != Tilt::none) turn<1>(v, T(b.cos_beta), T(b.sin_beta));
  if constexpr (TILT == Tilt::alpha_beta) turn<2>(v, T(b.cos_alpha), T(b.sin_alpha));
}

/// P <- what it starts from: one copy where the numbers have the same type.
CARDAN_INLINE void start(const AxisBody& b, ArticulatedInertia<double>& P) { P = b.P; }
template <class T>
CARDAN_INLINE void start(const AxisBody& b, ArticulatedInertia<T>& P) {
  P = cast<T>(b.P);
}

/// Base to tip: w, gamma_b, E, z = M gamma_b + b. The moment is the axial part of E S with the second moments S of the body
/// (2 S = tr J 1 - 2 J): M gamma + b = [ (E S)_axial + h x gamma.v ; m gamma.v + E h ].
template <class T, int I, Tilt TILT, OutwardFor For>
CARDAN_INLINE void outward_axis(const AxisBody& b, const Core<T>& inboard, Core<T>& body, Force<T>& z, const T& c, const T& s,
                                const Inputs<T>& in) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  Vec3<T> a = inboard.gamma.v + inboard.E * Vec3<T>{T(b.p[0]), T(b.p[1]), T(b.p[2])};
  Vec3<T> g = inboard.gamma.w;
  untilt<TILT, T>(b, a);
  untilt<TILT, T>(b, g);
  turn_back<I>(a, c, s);
  turn_back<I>(g, c, s);
  Vec3<T> w{T(0), T(0), T(0)};
  if constexpr (For.velocity) {
    w = inboard.w;
    untilt<TILT, T>(b, w);
    turn_back<I>(w, c, s);
    const T rate = in.v[b.v];
    at<J>(g) = at<J>(g) + at<K>(w) * rate;  // w x e_i rate
    at<K>(g) = at<K>(g) - at<J>(w) * rate;
    at<I>(w) = at<I>(w) + rate;
  }
  if constexpr (For.vdot) at<I>(g) = at<I>(g) + in.vdot[b.v];
  body.w = w;
  body.gamma = {g, a};
  Mat3<T>& E = body.E;
  set_acceleration_field(E, w, g);
  const T m(b.m);
  const Vec3<T> h{T(b.h[0]), T(b.h[1]), T(b.h[2])};
  const T xx(b.S[0]), yy(b.S[1]), zz(b.S[2]), xy(b.S[3]), xz(b.S[4]), yz(b.S[5]);
  z.f = m * a + E * h;
  z.n = Vec3<T>{(E.zx * xy + E.zy * yy + E.zz * yz) - (E.yx * xz + E.yy * yz + E.yz * zz),
                (E.xx * xz + E.xy * yz + E.xz * zz) - (E.zx * xx + E.zy * xy + E.zz * xz),
                (E.yx * xx + E.yy * xy + E.yz * xz) - (E.xx * xy + E.xy * yy + E.xz * yz)} +
        cross(h, a);
  // One state: copied here, added to in the inward sweep. Lanes: stores cost more than they do, so the first child writes.
  if constexpr (For.inertia)
    if (!b.leaf && (kWidth<T> == 1 || !b.written_by_child)) start(b, body.P);
}

/// z+ from B to the inboard body: turned, shifted by l = (l_j, l_k), tilted.
template <class T, int I, Tilt TILT, class Body>
CARDAN_INLINE Force<T> force_to_inboard(const Body& b, const T& c, const T& s, Force<T> z) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  const T lj(b.l[0]), lk(b.l[1]);
  turn<I>(z.n, c, s);
  turn<I>(z.f, c, s);
  at<I>(z.n) = at<I>(z.n) + (lj * at<K>(z.f) - lk * at<J>(z.f));
  at<J>(z.n) = at<J>(z.n) + lk * at<I>(z.f);
  at<K>(z.n) = at<K>(z.n) - lj * at<I>(z.f);
  tilt<TILT, T>(b, z.n);
  tilt<TILT, T>(b, z.f);
  return z;
}

/// to = a + b, number by number: the numbers of b go into the additions from where they stand.
template <class T>
CARDAN_INLINE void set_sum(ArticulatedInertia<T>& to, const ArticulatedInertia<T>& a, const ArticulatedInertia<double>& b) {
  const auto symmetric = [](Sym3<T>& x, const Sym3<T>& y, const Sym3<double>& z) {
    x.xx = y.xx + T(z.xx), x.yy = y.yy + T(z.yy), x.zz = y.zz + T(z.zz), x.xy = y.xy + T(z.xy), x.xz = y.xz + T(z.xz),
    x.yz = y.yz + T(z.yz);
  };
  symmetric(to.J, a.J, b.J);
  symmetric(to.M, a.M, b.M);
  to.B.xx = a.B.xx + T(b.B.xx), to.B.xy = a.B.xy + T(b.B.xy), to.B.xz = a.B.xz + T(b.B.xz);
  to.B.yx = a.B.yx + T(b.B.yx), to.B.yy = a.B.yy + T(b.B.yy), to.B.yz = a.B.yz + T(b.B.yz);
  to.B.zx = a.B.zx + T(b.B.zx), to.B.zy = a.B.zy + T(b.B.zy), to.B.zz = a.B.zz + T(b.B.zz);
}

/// P of a body whose outboard bodies have been gathered; of one that has none it may be taken from the model.
template <bool LEAF, class T>
CARDAN_INLINE decltype(auto) gathered(const AxisBody& b, Core<T>& core) {
  if constexpr (LEAF)
    return cast<T>(b.P);
  else
    return (core.P);
}

/// Tip to base. D = J_ii, G = P e_i / D, P+ = P - G D G* without its zero row i. False: no inertia about the axis.
template <class T, int I, Tilt TILT, InwardFor For, bool LEAF = false>
CARDAN_INLINE bool inward_axis(const AxisBody& b, const AxisBody& carrier, Core<T>& inboard, Force<T>& z_inboard, Core<T>& core,
                               AxisRecord<T>& body, const T& c, const T& s, const Inputs<T>& in, int n, Breakdown& breakdown) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  if constexpr (For.inertia) {
    auto&& P = gathered<LEAF>(b, core);
    const T D = entry<I, I>(P.J);
    if (!(D > T(kPivotLimit) * (P.J.xx + P.J.yy + P.J.zz))) {
      breakdown = {n, 0, static_cast<double>(D), kPivotLimit * static_cast<double>(P.J.xx + P.J.yy + P.J.zz)};
      return false;
    }
    const T inverse = T(1) / D;
    const T uj = entry<I, J>(P.J), uk = entry<I, K>(P.J);
    const T fi = entry<I, I>(P.B), fj = entry<I, J>(P.B), fk = entry<I, K>(P.B);
    const T gj = uj * inverse, gk = uk * inverse, ri = fi * inverse, rj = fj * inverse, rk = fk * inverse;
    body.inverse_D = inverse;
    at<J>(body.G.n) = gj;
    at<K>(body.G.n) = gk;
    at<I>(body.G.f) = ri;
    at<J>(body.G.f) = rj;
    at<K>(body.G.f) = rk;
    // P+ : J rows j, k; B rows j, k; M
    T jj = entry<J, J>(P.J) - gj * uj, kk = entry<K, K>(P.J) - gk * uk, jk = entry<J, K>(P.J) - gj * uk;
    T bji = entry<J, I>(P.B) - gj * fi, bjj = entry<J, J>(P.B) - gj * fj, bjk = entry<J, K>(P.B) - gj * fk;
    T bki = entry<K, I>(P.B) - gk * fi, bkj = entry<K, J>(P.B) - gk * fj, bkk = entry<K, K>(P.B) - gk * fk;
    Sym3<T> M;
    entry<I, I>(M) = entry<I, I>(P.M) - ri * fi;
    entry<J, J>(M) = entry<J, J>(P.M) - rj * fj;
    entry<K, K>(M) = entry<K, K>(P.M) - rk * fk;
    entry<I, J>(M) = entry<I, J>(P.M) - ri * fj;
    entry<I, K>(M) = entry<I, K>(P.M) - ri * fk;
    entry<J, K>(M) = entry<J, K>(P.M) - rj * fk;
    // turn by R_i: rows j, k of B, then its columns; J has only jj, kk, jk
    const T cs = c * s, ss = s * s, d = jj - kk, e = ss * d + (cs + cs) * jk;
    jk = cs * d + (T(1) - (ss + ss)) * jk;
    jj = jj - e;
    kk = kk + e;
    T t = bji;
    bji = c * t - s * bki;
    bki = s * t + c * bki;
    turn_block(bjj, bjk, bkj, bkk, c, s);
    turn<I>(M, c, s);
    // shift by l: B1 = B + l~ M; J1 = J - B1 l~ - (B l~)*
    const T lj(b.l[0]), lk(b.l[1]);
    const T mii = entry<I, I>(M), mij = entry<I, J>(M), mik = entry<I, K>(M), mjj = entry<J, J>(M), mjk = entry<J, K>(M),
            mkk = entry<K, K>(M);
    ArticulatedInertia<T> Q;
    const T ii_ = lj * mik - lk * mij, ij_ = lj * mjk - lk * mjj, ik_ = lj * mkk - lk * mjk;
    const T cji = bji + lk * mii, cjj = bjj + lk * mij, cjk = bjk + lk * mik;
    const T cki = bki - lj * mii, ckj = bkj - lj * mij, ckk = bkk - lj * mik;
    entry<I, I>(Q.B) = ii_;
    entry<I, J>(Q.B) = ij_;
    entry<I, K>(Q.B) = ik_;
    entry<J, I>(Q.B) = cji;
    entry<J, J>(Q.B) = cjj;
    entry<J, K>(Q.B) = cjk;
    entry<K, I>(Q.B) = cki;
    entry<K, J>(Q.B) = ckj;
    entry<K, K>(Q.B) = ckk;
    entry<I, I>(Q.J) = lj * ik_ - lk * ij_;
    entry<I, J>(Q.J) = lj * cjk - lk * cjj;
    entry<I, K>(Q.J) = lj * ckk - lk * ckj;
    entry<J, J>(Q.J) = jj + lk * (cji + bji);
    entry<K, K>(Q.J) = kk - lj * (cki + bki);
    entry<J, K>(Q.J) = jk - lj * cji + lk * bki;
    Q.M = M;
    if constexpr (TILT != Tilt::none) {
      tilt<TILT, T>(b, Q.J);
      tilt<TILT, T>(b, Q.B);
      tilt<TILT, T>(b, Q.M);
    }
    if (kWidth < T >> 1 && b.first)
      set_sum(inboard.P, Q, carrier.P);
    else
      inboard.P += Q;
  }
  if constexpr (For.bias) {
    const T tau = in.tau ? in.tau[b.v] : T(0);
    Force<T> z = body.z;
    const T eps = tau - at<I>(z.n);
    body.nu = eps * body.inverse_D;
    at<I>(z.n) = tau;
    at<J>(z.n) = at<J>(z.n) + eps * at<J>(body.G.n);
    at<K>(z.n) = at<K>(z.n) + eps * at<K>(body.G.n);
    z.f += eps * body.G.f;
    z_inboard += force_to_inboard<T, I, TILT>(b, c, s, z);
  }
  return true;
}

/// Phi* delta of the inboard body, in B.
template <class T, int I, Tilt TILT, class Body>
CARDAN_INLINE Motion<T> motion_to_outboard(const Body& b, const T& c, const T& s, Motion<T> d) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  untilt<TILT, T>(b, d.w);
  untilt<TILT, T>(b, d.v);
  const T lj(b.l[0]), lk(b.l[1]);
  at<I>(d.v) = at<I>(d.v) + (at<J>(d.w) * lk - at<K>(d.w) * lj);
  at<J>(d.v) = at<J>(d.v) - at<I>(d.w) * lk;
  at<K>(d.v) = at<K>(d.v) + at<I>(d.w) * lj;
  turn_back<I>(d.w, c, s);
  turn_back<I>(d.v, c, s);
  return d;
}

/// v' = nu - G* delta+, delta = delta+ + e_i v'.
template <class T, int I, Tilt TILT>
CARDAN_INLINE Motion<T> acceleration_axis(const AxisBody& b, const Motion<T>& inboard, const AxisRecord<T>& body, const T& c, const T& s,
                                          T* vdot) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  Motion<T> d = motion_to_outboard<T, I, TILT>(b, c, s, inboard);
  const T linear = dot(d.v, body.G.f);  // beside the angular part: the way through both is what the next body waits for
  const T a = ((body.nu - at<I>(d.w)) - at<J>(d.w) * at<J>(body.G.n) - at<K>(d.w) * at<K>(body.G.n)) - linear;
  vdot[b.v] = a;
  at<I>(d.w) = at<I>(d.w) + a;
  return d;
}

/// tau = H z; z seen from the inboard body (inverse dynamics).
template <class T, int I, Tilt TILT>
CARDAN_INLINE Force<T> gather_axis(const AxisBody& b, const Force<T>& z, const T& c, const T& s, T* tau) {
  tau[b.v] = at<I>(z.n);
  return force_to_inboard<T, I, TILT>(b, c, s, z);
}

// A rotor: axisymmetric about its hinge axis u, mass centre on it, nothing hangs on it. Whatever its angle it has one inertia
// seen from its carrier A, which M_sweep of the carrier holds. What is its own is the spin (J_axial = Ja, tau with the moment of
// its loads):  z_A += [ Ja q' (w x u) + u (tau - Ja u* gamma_w) ; 0 ],  P_A -= Ja u u*,  v' = tau / Ja - u* (gamma_w + delta_w).
template <class T>
CARDAN_INLINE Vec3<T> rotor_axis(const AxisBody& b) {
  return {T(b.u[0]), T(b.u[1]), T(b.u[2])};
}
template <class T>
CARDAN_INLINE void inward_rotor(const AxisBody& b, const Core<T>& carrier, Force<T>& z, AxisRecord<T>& body, const Inputs<T>& in) {
  const Vec3<T> u = rotor_axis<T>(b);
  const T Ja(b.J_axial);
  body.nu = body.load;
  if (in.tau) body.nu = body.nu + in.tau[b.v];
  z.n += (Ja * in.v[b.v]) * cross(carrier.w, u) + (body.nu - Ja * dot(u, carrier.gamma.w)) * u;
}
template <class T>
CARDAN_INLINE void acceleration_rotor(const AxisBody& b, const Core<T>& carrier, const AxisRecord<T>& body, T* vdot) {
  vdot[b.v] = body.nu / T(b.J_axial) - dot(rotor_axis<T>(b), carrier.gamma.w + carrier.delta.w);
}
template <class T>
CARDAN_INLINE void gather_rotor(const AxisBody& b, const Core<T>& carrier, Force<T>& z, const AxisRecord<T>& body, const Inputs<T>& in,
                                T* tau) {
  const Vec3<T> u = rotor_axis<T>(b);
  const T Ja(b.J_axial), vdot = in.vdot ? in.vdot[b.v] : T(0);
  tau[b.v] = Ja * (vdot + dot(u, carrier.gamma.w)) - body.load;
  z.n += (Ja * in.v[b.v]) * cross(carrier.w, u) + (Ja * vdot) * u;
}

// Loops over a run of axis bodies: one switch per body, everything else inlined.

/// Calls visit<I, TILT>() of an axis kernel.
template <class Visit>
CARDAN_INLINE auto for_axis(BodyKernel kind, const Visit& visit) {
  switch (kind) {
    case BodyKernel::axis_x:
      return visit.template operator()<0, Tilt::none>();
    case BodyKernel::axis_y:
      return visit.template operator()<1, Tilt::none>();
    case BodyKernel::axis_z:
      return visit.template operator()<2, Tilt::none>();
    case BodyKernel::tilt:
      return visit.template operator()<2, Tilt::beta>();
    default:
      return visit.template operator()<2, Tilt::alpha_beta>();
  }
}
template <class T, OutwardFor For>
static void outward_axes(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  const T *cosines = ws.cosines.data(), *sines = ws.sines.data();
  for (int n = begin; n < end; ++n) {
    const AxisBody& b = model.axis_bodies[n];
    if (b.kind == BodyKernel::rotor) continue;
    for_axis(
        b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          outward_axis<T, I, TILT, For>(b, ws.core(b.parent), ws.core(n), ws.z(n), cosines[b.angle], sines[b.angle], in);
        });
  }
}
template <class T, InwardFor For>
static void inward_axes(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  const T *cosines = ws.cosines.data(), *sines = ws.sines.data();
  for (int n = end - 1; n >= begin; --n) {
    const AxisBody& b = model.axis_bodies[n];
    if (b.kind == BodyKernel::rotor) {
      if constexpr (For.bias) inward_rotor(b, ws.core(b.parent), ws.z(b.parent), ws.axis(n), in);
      continue;
    }
    const auto inward = [&]<int I, Tilt TILT, bool LEAF>() __attribute__((always_inline)) {
      return inward_axis<T, I, TILT, For, LEAF>(b, model.axis_bodies[b.parent], ws.core(b.parent), ws.z(b.parent), ws.core(n), ws.axis(n),
                                                cosines[b.angle], sines[b.angle], in, n, ws.breakdown);
    };
    bool regular;
    if (kStates<T> && b.leaf)  // its core may be shared; of one state its P stands there, written with the workspace
      regular = for_axis(
          b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) { return inward.template operator()<I, TILT, kStates<T>>(); });
    else
      regular = for_axis(
          b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) { return inward.template operator()<I, TILT, false>(); });
    if (!regular) return;
  }
}
template <class T>
static void acceleration_axes(const SweepModel& model, Workspace<T>& ws, T* vdot, int begin, int end) {
  const T *cosines = ws.cosines.data(), *sines = ws.sines.data();
  Motion<T> delta = ws.core(begin - 1).delta;  // of body n - 1: of a chain it need not be read again
  for (int n = begin; n < end; ++n) {
    const AxisBody& b = model.axis_bodies[n];
    if (b.kind == BodyKernel::rotor) {
      acceleration_rotor(b, ws.core(b.parent), ws.axis(n), vdot);
      continue;
    }
    if (b.parent != n - 1) delta = ws.core(b.parent).delta;
    delta = for_axis(
        b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          return acceleration_axis<T, I, TILT>(b, delta, ws.axis(n), cosines[b.angle], sines[b.angle], vdot);
        });
    ws.core(n).delta = delta;
  }
}
template <class T>
static void gather_axes(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, T* tau, int begin, int end) {
  const T *cosines = ws.cosines.data(), *sines = ws.sines.data();
  Force<T> z = ws.z(end - 1);  // of body n: of a chain it need not be read again
  for (int n = end - 1; n >= begin; --n) {
    const AxisBody& b = model.axis_bodies[n];
    Force<T>& inboard = ws.z(b.parent);
    if (b.kind == BodyKernel::rotor) {
      gather_rotor(b, ws.core(b.parent), inboard, ws.axis(n), in, tau);
      z = ws.z(n - 1);
      continue;
    }
    const Force<T> f = for_axis(
        b.kind, [&]<int I, Tilt TILT>()
                    __attribute__((always_inline)) { return gather_axis<T, I, TILT>(b, z, cosines[b.angle], sines[b.angle], tau); });
    z = inboard + f;
    inboard = z;
    if (b.parent != n - 1) z = ws.z(n - 1);
  }
}

}  // namespace cardan::soa
