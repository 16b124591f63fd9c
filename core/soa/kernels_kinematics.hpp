#pragma once
// Base to tip: pose (Phi*), hinge map, angular velocity, then the acceleration gamma_b at v' = 0 and the residual force
// z = M gamma_b + b - f_ext, in one pass. Gamma form (mathematics 0.6): no linear velocity occurs, so that an orbit at
// 7.5 km/s loses nothing. Inverse dynamics is the same pass with v' given: gamma in place of gamma_b.
#include <cmath>

#include "core/soa/columns.hpp"
#include "core/soa/tangent.hpp"
#include "core/soa/workspace.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan::soa {

/// Frame P in O, hinge map at P and its rates: what mathematics 2.1 asks of a hinge.
template <class T, int NV>
struct HingeFrame {
  Mat3<T> R;
  Vec3<T> l;
  Motion<T> H[NV > 0 ? NV : 1];
  Vec3<T> Hdot_w;  // angular part of Hdot* v
  Vec3<T> s;       // s_h = R_h* (l_h'' at v' = 0)
};

/// R, l and H of a hinge with constant axis u (rotation, slide, screw).
template <class T>
static void axis_frame(const SweepBody& b, int shape, const T& q, HingeFrame<T, 1>& h) {
  using std::cos, std::sin;
  const Vec3<T> u = cast<T>(b.axis), none{T(0), T(0), T(0)};
  h.Hdot_w = h.s = none;
  if (shape == CARDAN_SHAPE_SLIDE) {
    h.R = Mat3<T>::identity();
    h.l = q * u;
    h.H[0] = {none, u};
    return;
  }
  h.R = rotation_about(u, T(sin(q)), T(cos(q)));
  const T pitch = T(b.pitch);
  h.l = shape == CARDAN_SHAPE_SCREW ? (pitch * q) * u : none;
  h.H[0] = {u, shape == CARDAN_SHAPE_SCREW ? pitch * u : none};
}

/// R, l, H from the record that the family filled. s_h is zero by definition for ball and free (2.1).
template <class T, int NV>
static void dense_frame(const Workspace<T>& ws, const SweepBody& b, const T* v, HingeFrame<T, NV>& h) {
  const auto number = [&](int at) { return ws.hinge_number(b.dense, at); };
  const auto vector = [&](int at) { return Vec3<T>{number(at), number(at + 1), number(at + 2)}; };
  h.R = {number(0), number(1), number(2), number(3), number(4), number(5), number(6), number(7), number(8)};
  h.l = vector(9);
  Motion<T> rate{};
  for (int j = 0; j < NV; ++j) {
    h.H[j] = {vector(12 + 6 * j), vector(15 + 6 * j)};
    rate += v[j] * h.H[j];
  }
  h.Hdot_w = vector(48);
  if (b.shape == CARDAN_SHAPE_BALL || b.shape == CARDAN_SHAPE_FREE)
    h.s = {T(0), T(0), T(0)};
  else
    h.s = cross(rate.w, rate.v) + vector(51);
}

template <class T, int NV>
static void hinge_frame(const Workspace<T>& ws, const SweepBody& b, const T* q, const T* v, HingeFrame<T, NV>& h) {
  if constexpr (NV == 0) {
    h.R = cast<T>(b.fixed_hinge.R);
    h.l = cast<T>(b.fixed_hinge.p);
    h.Hdot_w = h.s = {T(0), T(0), T(0)};
  } else if constexpr (NV == 1) {
    if (b.shape <= CARDAN_SHAPE_SCREW)
      axis_frame(b, b.shape, q[b.q], h);
    else
      dense_frame<T, 1>(ws, b, v + b.v, h);
  } else {
    dense_frame<T, NV>(ws, b, v + b.v, h);
  }
}

/// Rigid body on a node that does not deform, B = P.
template <class T, int NV, OutwardFor For>
static void outward_rigid(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    const SweepBody& b = model.bodies[k];
    Core<T>& body = ws.core(k);
    const Core<T>& inboard = ws.core(b.parent);
    Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    HingeFrame<T, NV> h;
    hinge_frame<T, NV>(ws, b, in.q, in.v, h);
    const Mat3<T> R_O = cast<T>(b.O.R);
    Pose<T>& X = ws.X(k);
    X.R = R_O * h.R;
    X.p = cast<T>(b.O.p) + R_O * h.l;
    Motion<T> rate{}, push{};
    for (int j = 0; j < NV; ++j) {
      hinge.H[j] = h.H[j];
      if constexpr (For.velocity) rate += in.v[b.v + j] * h.H[j];
      if constexpr (For.vdot) push += in.vdot[b.v + j] * h.H[j];
    }
    const Vec3<T>& p = X.p;
    Motion<T>& gamma = body.gamma;
    const RigidInertia<T> M = cast<T>(b.M_sweep);
    if constexpr (For.velocity) {
      const Vec3<T>& wA = inboard.w;
      const Vec3<T> w1 = transpose_times(X.R, wA);
      body.w = w1 + rate.w;
      gamma.w = transpose_times(X.R, inboard.gamma.w) + cross(w1, rate.w) + h.Hdot_w;
      gamma.v =
          transpose_times(X.R, inboard.gamma.v + cross(inboard.gamma.w, p) + cross(wA, cross(wA, p))) + T(2) * cross(w1, rate.v) + h.s;
    } else {
      gamma = to_outboard(X, inboard.gamma);
      body.w = {T(0), T(0), T(0)};
    }
    if constexpr (For.vdot) gamma += push;
    Force<T>& z = ws.z(k);
    z = M * gamma;
    if constexpr (For.velocity) z += gyroscopic(M, body.w);
    if constexpr (For.inertia) {
      body.P = articulated(M);
      body.P.J = cast<T>(b.J_P);
    }
    set_acceleration_field(body.E, For.velocity ? body.w : Vec3<T>{T(0), T(0), T(0)}, gamma.w);
  }
}

/// Deformed pose and rates of a node (mathematics 3.1), body axes: theta, Jl, W eta' and the bias a_j without its
/// dependence on the node's own axes.
template <class T>
struct DeformedNode {
  CARDAN_INLINE DeformedNode() {}
  Mat3<T> Jl;      // angular velocity = Jl theta'
  Mat3<T> R;       // N in B
  Vec3<T> rho;     // [m]
  Motion<T> rate;  // [W eta'; Phi eta']
  Motion<T> bias;  // [dJl(theta; theta') theta'; 0]; of a curved node [... + Jl a_w; a_v], a = S' eta'
  const T* S;      // of a curved node, until the next one is asked for (Workspace::curved); else null
};

/// x, v: the sums of [psi; phi] times eta and eta'.
template <class T>
static void deform(const Pose<double>& undeformed, const T* x, const T* v, DeformedNode<T>& d) {
  const Vec3<T> theta{x[0], x[1], x[2]}, theta_rate{v[0], v[1], v[2]};
  const RotationCoefficients<T> c = rotation_coefficients(dot(theta, theta));
  d.rho = cast<T>(undeformed.p) + Vec3<T>{x[3], x[4], x[5]};
  d.R = rotation_of_vector(c, theta) * cast<T>(undeformed.R);
  d.Jl = rotation_of_vector(RotationCoefficients<T>{c.a, c.b, T(0), T(0), T(0)}, theta);  // 1 + a theta~ + b theta~^2
  d.rate = {d.Jl * theta_rate, {v[3], v[4], v[5]}};
  d.bias = {left_jacobian_dot(c, theta, theta_rate, theta_rate), {T(0), T(0), T(0)}};
  d.S = nullptr;
}
template <class T>
static void deform(const NodeShapes& s, const T* eta, const T* etadot, DeformedNode<T>& d) {
  T x[6], v[6] = {T(0), T(0), T(0), T(0), T(0), T(0)};
  if (etadot)
    sum_columns_of<Six<T>>(s.columns.data(), 6, eta, etadot, s.n_modes, x, v);
  else
    sum_columns(s.columns.data(), eta, s.n_modes, x);
  deform<T>(s.pose, x, v, d);
}

/// Column j of Gamma in body axes at the node: [Jl psi; phi].
template <class T>
static Motion<T> node_column(const NodeShapes& s, const DeformedNode<T>& d, int j) {
  const auto column = [&](const auto* c) -> Motion<T> { return {d.Jl * Vec3<T>{T(c[0]), T(c[1]), T(c[2])}, {T(c[3]), T(c[4]), T(c[5])}}; };
  return d.S ? column(d.S + 6 * j) : column(s.columns.data() + 6 * j);
}

/// How the family moves a node (cardan_body_family::node), in double.
static inline void family_node(const FlexibleBody& f, int, int node, const double* eta, const double* etadot, double*, double* x, double* S,
                               double* a) {
  f.family->node(f.packed.data(), static_cast<std::uint32_t>(node), eta, etadot, x, S, a);
}
/// Any other scalar: lane by lane through double. scratch: 8 m numbers.
template <class T>
static void family_node(const FlexibleBody& f, int m, int node, const T* eta, const T* etadot, double* scratch, T* x, T* S, T* a) {
  double *e = scratch, *ed = e + m, *columns = ed + m, moved[6], bent[6];
  for (int l = 0; l < kWidth<T>; ++l) {
    for (int i = 0; i < m; ++i) e[i] = lane(eta[i], l);
    for (int i = 0; etadot && i < m; ++i) ed[i] = lane(etadot[i], l);
    family_node(f, m, node, e, etadot ? ed : nullptr, nullptr, moved, columns, a ? bent : nullptr);
    for (int i = 0; i < 6; ++i) set_lane(x[i], l, moved[i]);
    for (int i = 0; i < 6 * m; ++i) set_lane(S[i], l, columns[i]);
    for (int i = 0; a && i < 6; ++i) set_lane(a[i], l, bent[i]);
  }
}
/// x, S, S eta' and S' eta' of a curved node; without etadot the last two are zero.
template <class T>
static void move_curved(const FlexibleBody& f, const NodeShapes& s, const T* eta, const T* etadot, double* scratch, T* S, T* moved, T* rate,
                        T* bent) {
  family_node(f, s.n_modes, s.curved, eta, etadot, scratch, moved, S, etadot ? bent : nullptr);
  if (etadot)
    sum_columns(S, etadot, s.n_modes, rate);
  else
    Six<T>().to(rate), Six<T>().to(bent);
}
/// What S does to a deformed node beyond its values.
template <class T>
static void bend(const T* S, const T* bent, DeformedNode<T>& d) {
  d.S = S;
  d.bias.w += d.Jl * Vec3<T>{bent[0], bent[1], bent[2]};
  d.bias.v = {bent[3], bent[4], bent[5]};
}
template <class T>
static void deform_curved(const FlexibleBody& f, const NodeShapes& s, const T* eta, const T* etadot, double* scratch, T* S,
                          DeformedNode<T>& d) {
  T x[6], v[6], bent[6];
  move_curved(f, s, eta, etadot, scratch, S, x, v, bent);
  deform<T>(s.pose, x, v, d);
  bend(S, bent, d);
}
/// A node of sweep body k, which deforms, whatever its shapes. q, v: of the system; v may be null.
template <class T>
static void deform(const SweepModel& model, const Workspace<T>& ws, int k, const NodeShapes& s, const T* q, const T* v,
                   DeformedNode<T>& d) {
  const SweepBody& b = model.bodies[k];
  const T *eta = q + b.eta, *etadot = v ? v + b.etadot : nullptr;
  if (s.is_curved())
    deform_curved(model.flexible[b.flexible], s, eta, etadot, ws.modal_of(k)->family, ws.curved.get(), d);
  else
    deform<T>(s, eta, etadot, d);
}

/// The family's functions, in double. M_rr null: only b.
static inline void family_inertia(const FlexibleBody& f, int, const double* eta, const double* etadot, const Vec3<double>& w,
                                  Modal<double>& modal, double* M_rr) {
  if (M_rr)
    f.family->mass(f.packed.data(), eta, M_rr, f.M_re_constant ? nullptr : modal.P_re,
                   modal.P_ee && !f.M_ee_constant ? modal.P_ee : nullptr);
  if (etadot) f.family->bias(f.packed.data(), eta, etadot, &w.x, modal.b);
}
/// Any other scalar: lane by lane through double, but for families that take all lanes at once.
template <class T>
static void family_inertia(const FlexibleBody& f, int m, const T* eta, const T* etadot, const Vec3<T>& w, Modal<T>& modal, T* M_rr) {
  if constexpr (kStates<T>)
    if (f.states && M_rr) {
      const auto of = [](const T* a) { return reinterpret_cast<const double*>(a); };
      const auto to = [](T* a) { return reinterpret_cast<double*>(a); };
      f.family->states(f.packed.data(), kWidth<T>, of(eta), of(etadot), of(&w.x), to(M_rr), f.M_re_constant ? nullptr : to(modal.P_re),
                       modal.P_ee && !f.M_ee_constant ? to(modal.P_ee) : nullptr, to(modal.b));
      return;
    }
  double *e = modal.family, *ed = e + m, *re = ed + m, *ee = re + 6 * m, *bias = ee + m * m, rr[10];
  for (int l = 0; l < kWidth<T>; ++l) {
    for (int i = 0; i < m; ++i) e[i] = lane(eta[i], l);
    if (M_rr) {
      f.family->mass(f.packed.data(), e, rr, f.M_re_constant ? nullptr : re, modal.P_ee && !f.M_ee_constant ? ee : nullptr);
      for (int i = 0; i < 10; ++i) set_lane(M_rr[i], l, rr[i]);
      for (int i = 0; i < 6 * m && !f.M_re_constant; ++i) set_lane(modal.P_re[i], l, re[i]);
      for (int i = 0; i < m * m && modal.P_ee && !f.M_ee_constant; ++i) set_lane(modal.P_ee[i], l, ee[i]);
    }
    if (!etadot) continue;
    for (int i = 0; i < m; ++i) ed[i] = lane(etadot[i], l);
    const double omega[3] = {lane(w.x, l), lane(w.y, l), lane(w.z, l)};
    f.family->bias(f.packed.data(), e, ed, omega, bias);
    for (int i = 0; i < 6 + m; ++i) set_lane(modal.b[i], l, bias[i]);
  }
}

/// Level 0 (FlexibleBody::constant): only the mass centre moves, mc = I2 + M_ve eta, and
/// b = [omega x (J omega + M_we eta'); omega x (omega x mc) + 2 omega x M_ve eta'; 0]. x, v: M_re eta, M_re eta'.
template <bool Velocity, class T>
static RigidInertia<T> constant_inertia(const FlexibleBody& f, const T* x, const T* v, const Vec3<T>& w, Force<T>& b) {
  RigidInertia<T> M = cast<T>(f.M_rr);
  M.h += Vec3<T>{x[3], x[4], x[5]};
  if constexpr (Velocity) b = {cross(w, M.J * w + Vec3<T>{v[0], v[1], v[2]}), cross(w, cross(w, M.h) + T(2) * Vec3<T>{v[3], v[4], v[5]})};
  return M;
}

/// What the modes of a body do, in one pass over them: M_re eta and M_re eta' of a constant body, and how they move its nodes.
template <bool Velocity, class T>
static void sum_modes(Workspace<T>& ws, const SweepBody& b, const FlexibleBody& f, const T* q, const T* v, T* M_re_eta, T* M_re_etadot) {
  const std::size_t nodes = f.attached.size(), own = f.constant ? 6 : 0;
  const int rows = static_cast<int>(own + 6 * nodes);
  const T *eta = q + b.eta, *etadot = v + b.etadot;
  if constexpr (kWidth<T> == 1 && Velocity)  // of lanes the registers hold no more than six
    if (f.constant && nodes == 1) {
      T x[12], rate[12];
      sum_columns_of<Twelve<T>>(f.shapes.data(), 12, eta, etadot, b.n_modes, x, rate);
      ModalNode<T>& node = *ws.modal_of(f.attached[0])->node;
      Six<T>(x).to(M_re_eta), Six<T>(rate).to(M_re_etadot);
      Six<T>(x + 6).to(node.moved), Six<T>(rate + 6).to(node.rate);
      return;
    }
  const auto sum = [&](std::size_t at, T* moved, T* rate) {
    if constexpr (Velocity) {
      sum_columns_of<Six<T>>(f.shapes.data() + at, rows, eta, etadot, b.n_modes, moved, rate);
    } else {
      sum_columns_of<Six<T>>(f.shapes.data() + at, rows, eta, b.n_modes, moved);
      Six<T>().to(rate);
    }
  };
  if (f.constant) sum(0, M_re_eta, M_re_etadot);
  for (std::size_t a = 0; a < nodes; ++a) {
    ModalNode<T>& node = *ws.modal_of(f.attached[a])->node;
    sum(own + 6 * a, node.moved, node.rate);
  }
}

/// M_fl(eta), b and z = M_fl gamma_b + b of a flexible body. Families compute in double.
template <bool Velocity, class T>
static void flexible_inertia(const SweepModel& model, Workspace<T>& ws, int k, const Inputs<T>& in, bool given, Core<T>& body,
                             Modal<T>& modal) {
  const SweepBody& b = model.bodies[k];
  const FlexibleBody& f = model.flexible[b.flexible];
  const int m = b.n_modes;
  const T *eta = in.q + b.eta, *etadot = Velocity ? in.v + b.etadot : nullptr;
  RigidInertia<T> M;
  Force<T> bias{};
  T x[6], v[6];
  for (std::size_t a = 0; f.curved && a < f.attached.size(); ++a) {
    ModalNode<T>& node = *ws.modal_of(f.attached[a])->node;
    move_curved(f, model.shapes[model.bodies[f.attached[a]].onode], eta, etadot, modal.family, node.S(), node.moved, node.rate,
                node.bent());
  }
  if (!f.attached.empty() && !f.curved)
    sum_modes<Velocity>(ws, b, f, in.q, in.v, x, v);
  else if (f.constant && Velocity)  // nothing hangs there: most bodies
    sum_columns_of<Six<T>>(f.shapes.data(), 6, eta, etadot, m, x, v);
  else if (f.constant)
    sum_columns_of<Six<T>>(f.shapes.data(), 6, eta, m, x);
  if (f.constant) {
    M = constant_inertia<Velocity>(f, x, v, body.w, bias);
  } else {
    T M_rr[10];
    family_inertia(f, m, eta, etadot, body.w, modal, M_rr);
    M = {M_rr[0], {M_rr[1], M_rr[2], M_rr[3]}, {M_rr[4], M_rr[5], M_rr[6], M_rr[7], M_rr[8], M_rr[9]}};
    if constexpr (Velocity) bias = {{modal.b[0], modal.b[1], modal.b[2]}, {modal.b[3], modal.b[4], modal.b[5]}};
  }
  if (modal.P_re && f.M_re_constant)
    for (int i = 0; i < 6 * m; ++i) modal.P_re[i] = T(f.M_re[i]);
  if (modal.P_ee && f.M_ee_constant)
    for (int i = 0; i < m * m; ++i) modal.P_ee[i] = T(f.M_ee[i]);
  modal.M_rr = M;
  const Motion<T>& g = body.gamma;
  Force<T>& z = ws.z(k);
  z = M * g;
  if constexpr (Velocity) z += bias;
  body.P = articulated(M);
  for (int j = 0; j < m; ++j) modal.z[j] = Velocity && !f.constant ? modal.b[6 + j] : T(0);
  if (modal.P_re) {  // else M_re is constant, and M_re* gamma is taken in where z is used
    const T gamma[6] = {g.w.x, g.w.y, g.w.z, g.v.x, g.v.y, g.v.z};
    add_columns(modal.P_re, gamma, m, modal.z);
  }
  if (given) {
    const T* accel = in.vdot + b.etadot;
    T force[6];
    if (modal.P_re)
      sum_columns(modal.P_re, accel, m, force);
    else
      sum_columns(f.M_re.data(), accel, m, force);
    z += Force<T>{{force[0], force[1], force[2]}, {force[3], force[4], force[5]}};
    for (int j = 0; j < m; ++j) {
      if (f.M_ee_identity && f.M_ee_constant)
        modal.z[j] = modal.z[j] + accel[j];
      else
        for (int i = 0; i < m; ++i) modal.z[i] = modal.z[i] + (modal.P_ee ? modal.P_ee[m * j + i] : T(f.M_ee[m * j + i])) * accel[j];
    }
  }
}

/// A frame on its way from the inboard body to the body itself: O at the onode, P behind the hinge.
template <class T>
struct PassingFrame {
  Mat3<T> R;        // to the axes of the inboard body
  Vec3<T> p;        // [m] from its origin, in its axes
  Vec3<T> w;        // angular velocity; of O in the axes of the inboard body, of P in its own
  Motion<T> gamma;  // likewise
};

/// O. `given`: with the accelerations of modes of Inputs::vdot.
template <bool Velocity, class T>
CARDAN_INLINE void move_onode(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, bool given, int k, PassingFrame<T>& O) {
  const SweepBody& b = model.bodies[k];
  const Core<T>& inboard = ws.core(b.parent);
  if (b.onode < 0) {
    O.R = cast<T>(b.O.R), O.p = cast<T>(b.O.p);
    O.w = Velocity ? inboard.w : Vec3<T>{T(0), T(0), T(0)};
    O.gamma = {inboard.gamma.w, inboard.gamma.v + cross(inboard.gamma.w, O.p)};
    if constexpr (Velocity) O.gamma.v += cross(inboard.w, cross(inboard.w, O.p));
    return;
  }
  const NodeShapes& shapes = model.shapes[b.onode];
  ModalNode<T>& node = *ws.modal_of(k)->node;
  DeformedNode<T> at_O;
  deform<T>(shapes.pose, node.moved, node.rate, at_O);
  if (shapes.is_curved()) bend<T>(node.S(), node.bent(), at_O);
  O.R = at_O.R, O.p = at_O.rho;
  O.w = Vec3<T>{T(0), T(0), T(0)};
  O.gamma = {inboard.gamma.w, inboard.gamma.v + cross(inboard.gamma.w, O.p)};
  if constexpr (Velocity) {
    O.w = inboard.w + at_O.rate.w;
    O.gamma.v += cross(inboard.w, cross(inboard.w, O.p));
    O.gamma.w += cross(inboard.w, at_O.rate.w) + at_O.bias.w;
    O.gamma.v += T(2) * cross(inboard.w, at_O.rate.v);
    if (at_O.S) O.gamma.v += at_O.bias.v;
  }
  if (given)
    for (int j = 0; j < b.n_parent_modes; ++j) O.gamma += in.vdot[model.bodies[b.parent].etadot + j] * node_column(shapes, at_O, j);
  node.Jl = at_O.Jl, node.rho = at_O.rho;
}

/// From P to B (X_B), undoing the deformation of the pnode; the nv columns of H come from P to B too. Then M, b and z of the body.
template <bool Velocity, class T>
CARDAN_INLINE void move_body(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, bool given, int k, const PassingFrame<T>& P,
                             Motion<T>* H, int nv) {
  const SweepBody& b = model.bodies[k];
  Core<T>& body = ws.core(k);
  Modal<T>& modal = *ws.modal_of(k);
  Pose<T>& X = ws.X(k);
  if (b.pnode >= 0) {
    const NodeShapes& shapes = model.shapes[b.pnode];
    DeformedNode<T> at_P;
    if (shapes.is_curved())
      deform_curved<T>(model.flexible[b.flexible], shapes, in.q + b.eta, Velocity ? in.v + b.etadot : nullptr, modal.family, modal.C, at_P);
    else
      deform<T>(shapes, in.q + b.eta, Velocity ? in.v + b.etadot : nullptr, at_P);
    const Vec3<T>& rho = at_P.rho;
    body.w = at_P.R * P.w;
    if constexpr (Velocity) body.w -= at_P.rate.w;
    Motion<T> g{at_P.R * P.gamma.w, at_P.R * P.gamma.v};
    if constexpr (Velocity) {
      g.w -= cross(body.w, at_P.rate.w) + at_P.bias.w;
      g.v -= cross(body.w, cross(body.w, rho)) + T(2) * cross(body.w, at_P.rate.v);
      if (at_P.S) g.v -= at_P.bias.v;
    }
    if (modal.C)
      for (int j = 0; j < b.n_modes; ++j) {
        const Motion<T> column = node_column(shapes, at_P, j);
        if (given) g -= in.vdot[b.etadot + j] * column;
        const Vec3<T> at_B = column.v - cross(column.w, rho);
        T* C = modal.C + 6 * j;
        C[0] = column.w.x, C[1] = column.w.y, C[2] = column.w.z, C[3] = at_B.x, C[4] = at_B.y, C[5] = at_B.z;
      }
    body.gamma = {g.w, g.v - cross(g.w, rho)};
    X.R = P.R * transpose(at_P.R);
    X.p = P.p - X.R * rho;
    for (int j = 0; j < nv; ++j) {
      const Vec3<T> w = at_P.R * H[j].w;
      H[j] = {w, at_P.R * H[j].v - cross(w, rho)};
    }
  } else {
    body.w = P.w;
    body.gamma = P.gamma;
    X = {P.R, P.p};
  }
  set_acceleration_field(body.E, Velocity ? body.w : Vec3<T>{T(0), T(0), T(0)}, body.gamma.w);
  if (b.n_modes > 0) return flexible_inertia<Velocity>(model, ws, k, in, given, body, modal);
  const RigidInertia<T> M = cast<T>(b.M_sweep);
  Force<T>& z = ws.z(k);
  z = M * body.gamma;
  if constexpr (Velocity) z += gyroscopic(M, body.w);
  body.P = articulated(M);
  body.P.J = cast<T>(b.J_P);
}

template <bool Velocity, class T>
CARDAN_APART void move_onode_apart(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, bool given, int k, PassingFrame<T>& O) {
  move_onode<Velocity>(model, ws, in, given, k, O);
}
template <bool Velocity, class T>
CARDAN_APART void move_body_apart(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, bool given, int k,
                                  const PassingFrame<T>& P, Motion<T>* H, int nv) {
  move_body<Velocity>(model, ws, in, given, k, P, H, nv);
}

/// Flexible bodies, bodies on deforming nodes, prescribed motion: mathematics 3.8 in gamma form. `given`: with H* v' of Inputs::vdot.
template <class T, int NV, bool Velocity>
static void outward_general(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in, bool given, int begin, int end) {
  for (int k = begin; k < end; ++k) {
    const SweepBody& b = model.bodies[k];
    Hinge<T, NV>& hinge = ws.template hinge<NV>(k);
    HingeFrame<T, NV> h;
    hinge_frame<T, NV>(ws, b, in.q, in.v, h);
    PassingFrame<T> O, P;
    if constexpr (kOften<NV>)
      move_onode<Velocity>(model, ws, in, given, k, O);
    else
      move_onode_apart<Velocity>(model, ws, in, given, k, O);

    // Across the hinge.
    P.R = O.R * h.R;
    const Vec3<T> lever = O.R * h.l, w1 = transpose_times(P.R, O.w);
    P.p = O.p + lever;
    Motion<T> rate{}, push{};
    for (int j = 0; j < NV; ++j) {
      hinge.H[j] = h.H[j];
      if constexpr (Velocity) rate += in.v[b.v + j] * h.H[j];
      if (given) push += in.vdot[b.v + j] * h.H[j];
    }
    P.w = w1 + rate.w;
    P.gamma = {transpose_times(P.R, O.gamma.w), transpose_times(P.R, O.gamma.v + cross(O.gamma.w, lever))};
    if constexpr (Velocity) {
      P.gamma.w += cross(w1, rate.w) + h.Hdot_w;
      P.gamma.v += transpose_times(P.R, cross(O.w, cross(O.w, lever))) + T(2) * cross(w1, rate.v) + h.s;
    }
    if (given) P.gamma += push;
    if constexpr (kOften<NV>)
      move_body<Velocity>(model, ws, in, given, k, P, hinge.H, NV);
    else
      move_body_apart<Velocity>(model, ws, in, given, k, P, hinge.H, NV);
  }
}

/// tau_e = user - K eta - C eta': the elastic forces of the modes join z (left-hand side).
template <class T>
static void elastic(const SweepModel& model, Workspace<T>& ws, const Inputs<T>& in) {
  for (std::size_t k = 1; k < model.bodies.size(); ++k) {
    const SweepBody& b = model.bodies[k];
    if (b.n_modes == 0) continue;
    const FlexibleBody& f = model.flexible[b.flexible];
    Modal<T>& modal = *ws.modal_of(static_cast<int>(k));
    const int m = b.n_modes;
    const T *eta = in.q + b.eta, *etadot = in.v + b.etadot;
    if (f.K_diagonal) {
      const double *K = f.K.data(), *C = f.C.data();
      T* __restrict z = modal.z;
      for (int j = 0; j < m; ++j) z[j] = z[j] + T(K[j]) * eta[j] + T(C[j]) * etadot[j];
    } else {
      for (int j = 0; j < m; ++j)
        for (int i = 0; i < m; ++i) {
          const auto at = static_cast<std::size_t>(m * j + i);
          modal.z[i] = modal.z[i] + T(f.K[at]) * eta[j] + T(f.C[at]) * etadot[j];
        }
    }
  }
}

}  // namespace cardan::soa
