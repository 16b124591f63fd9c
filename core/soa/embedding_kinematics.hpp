#pragma once
// Loops that are closed inside of the sweeps, before these: rows and gamma_c seen from home at rest, which rates depend on which, how the
// bodies of a loop move with what is left free (docs/mathematics/loops.md, 4). One state at a time.
#include <algorithm>
#include <cmath>

#include "core/soa/embedding_gears.hpp"
#include "core/soa/embedding_work.hpp"
#include "core/soa/kernels_axis.hpp"
#include "core/soa/kernels_composite.hpp"
#include "core/soa/kernels_free.hpp"
#include "core/soa/kernels_kinematics.hpp"
#include "core/soa/sweeps.hpp"

namespace cardan::soa {

static constexpr double kNoPivot = 1e-10;      // of scaled rows (docs/mathematics/loops.md, 2)
static constexpr double kWeakPivot = 1e-2;     // where another loop may have a better one: over the open tree rows of all are looked at
static constexpr double kOpenRows = 10.0;      // ... of rows that imply each other on closed loops: also below so much of the residual
static constexpr double kMostOpenRows = 1e-4;  // ... but not more
/// Rows of multipliers that have less than this of their compliance by the inertia of the start beside the rows before them lose as many
/// digits of v': over the open tree what is left open is taken away once more, and rows are chosen anew.
static constexpr double kWeakCompliance = 1e-3;
static constexpr double kSteepOwn = 4.0;      // of rates of a loop alone per other, in the root of their energy: beyond, others are pivots
static constexpr double kContradicts = 1e-6;  // what a redundant row may lack, relative to the largest gamma_c

/// R <- R R_i(theta): its columns turn in their plane.
template <int I, class T>
CARDAN_INLINE void turn_columns(Mat3<T>& R, const T& c, const T& s) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  const auto row = [&](T & j, T & k) __attribute__((always_inline)) {
    const T x = j;
    j = c * x + s * k;
    k = c * k - s * x;
  };
  row(entry<0, J>(R), entry<0, K>(R));
  row(entry<1, J>(R), entry<1, K>(R));
  row(entry<2, J>(R), entry<2, K>(R));
}
template <int I, class T>
CARDAN_INLINE Vec3<T> column_of(Mat3<T> R) {
  return {entry<0, I>(R), entry<1, I>(R), entry<2, I>(R)};
}

/// The axis of an axis body, whose frame is R.
template <class T>
CARDAN_INLINE Vec3<T> turning_axis(BodyKernel kind, const Mat3<T>& R) {
  return kind == BodyKernel::axis_x ? column_of<0>(R) : kind == BodyKernel::axis_y ? column_of<1>(R) : column_of<2>(R);
}

/// A body that turns about an axis of its own and stands at p, seen from home: from the body inboard of it.
template <int I, Tilt TILT, class T, class Body>
CARDAN_INLINE void path_axis(const Body& b, const Vec3<T>& p, const T& c, const T& s, const T& rate, const PathStateOf<T>& A,
                             PathStateOf<T>& B) {
  const Vec3<T> r = A.R * p;
  B.R = A.R;
  if constexpr (TILT == Tilt::alpha_beta) turn_columns<2>(B.R, b.cos_alpha, b.sin_alpha);
  if constexpr (TILT != Tilt::none) turn_columns<1>(B.R, b.cos_beta, b.sin_beta);
  turn_columns<I>(B.R, c, s);
  const Vec3<T> turning = rate * column_of<I>(B.R), wr = cross(A.w, r);
  B.p = A.p + r;
  B.v = A.v + wr;
  B.a = A.a + cross(A.alpha, r) + cross(A.w, wr);
  B.alpha = A.alpha + cross(A.w, turning);
  B.w = A.w + turning;
}

/// The same of any rigid body.
static inline void path_any(const SweepModel& model, const Workspace<double>& ws, const Inputs<double>& in, int k, const PathState& A,
                            PathState& B) {
  const SweepBody& b = model.bodies[k];
  const Pose<double> X = pose_in_inboard(model, ws, k, in.q);
  Motion<double> rate{};
  for (int j = 0; j < b.nv; ++j) rate += in.v[b.v + j] * hinge_column(model, ws, k, j);
  Vec3<double> Hdot_w{}, bend{};
  if (b.kind == BodyKernel::free) {
    if (b.shape == CARDAN_SHAPE_FREE_BODY) bend = cross(rate.w, rate.v);
  } else if (!is_axis(b.kind)) {
    with_hinge_size<double>(b.nv, [&]<int NV>() {
      HingeFrame<double, NV> h;
      hinge_frame<double, NV>(ws, b, in.q, in.v, h);
      Hdot_w = h.Hdot_w, bend = h.s;
    });
  }
  const Vec3<double> r = A.R * X.p;
  B.R = A.R * X.R;
  const Vec3<double> turning = B.R * rate.w, sliding = B.R * rate.v, wr = cross(A.w, r);
  B.p = A.p + r;
  B.v = A.v + wr + sliding;
  B.a = A.a + cross(A.alpha, r) + cross(A.w, wr) + 2.0 * cross(A.w, sliding) + B.R * bend;
  B.alpha = A.alpha + cross(A.w, turning) + B.R * Hdot_w;
  B.w = A.w + turning;
}

/// The same of a slide along u with the axes of the inboard body.
template <class T>
CARDAN_INLINE void path_shift(const Vec3<T>& p, const Vec3<T>& u, const T& rate, const PathStateOf<T>& A, PathStateOf<T>& B) {
  const Vec3<T> r = A.R * p, wr = cross(A.w, r), sliding = rate * (A.R * u);
  B.R = A.R, B.w = A.w, B.alpha = A.alpha;
  B.p = A.p + r;
  B.v = A.v + wr + sliding;
  B.a = A.a + cross(A.alpha, r) + cross(A.w, wr + T(2.0) * sliding);
}

/// A place on a body seen from home; not `turned`: with the axes of the body.
template <class T>
static inline PathStateOf<T> place_on(const PathStateOf<T>& s, const Pose<T>& node, bool turned) {
  const Vec3<T> r = s.R * node.p, wr = cross(s.w, r);
  return {turned ? s.R * node.R : s.R, s.p + r, s.w, s.v + wr, s.alpha, s.a + cross(s.alpha, r) + cross(s.w, wr)};
}
/// The same where it deforms with body k (docs/mathematics/flexible.md, 1).
static inline PathState place_on(const SweepModel& model, const Inputs<double>& in, int k, const NodeShapes& shapes, const PathState& s,
                                 PathExit& exit) {
  const SweepBody& b = model.bodies[k];
  DeformedNode<double> d;
  deform<double>(shapes, in.q + b.eta, in.v + b.etadot, d);
  const Vec3<double> r = s.R * d.rho, wr = cross(s.w, r), turning = s.R * d.rate.w, moving = s.R * d.rate.v;
  const PathState out{s.R * d.R,
                      s.p + r,
                      s.w + turning,
                      s.v + wr + moving,
                      s.alpha + cross(s.w, turning) + s.R * d.bias.w,
                      s.a + cross(s.alpha, r) + cross(s.w, wr) + 2.0 * cross(s.w, moving)};
  exit = {&shapes, d.Jl, d.rho, out.p};
  return out;
}

/// A body of a general kernel: flexible, on a flexible body or with given motions.
static inline void path_general(const SweepModel& model, const Workspace<double>& ws, const Inputs<double>& in, int k, const PathState& A,
                                PathExit& exit, PathState& B) {
  const SweepBody& b = model.bodies[k];
  const PathState O = b.onode >= 0 ? place_on(model, in, b.parent, model.shapes[b.onode], A, exit) : place_on(A, b.O, true);
  with_hinge_size<double>(b.nv, [&]<int NV>() {
    HingeFrame<double, NV> h;
    hinge_frame<double, NV>(ws, b, in.q, in.v, h);
    Motion<double> rate{}, push{};
    for (int j = 0; j < NV; ++j) {
      rate += in.v[b.v + j] * h.H[j];
      if (b.has_prescribed && in.vdot && model.prescribed[b.v + j]) push += in.vdot[b.v + j] * h.H[j];
    }
    const Vec3<double> r = O.R * h.l;
    B.R = O.R * h.R;
    const Vec3<double> turning = B.R * rate.w, sliding = B.R * rate.v, wr = cross(O.w, r);
    B.p = O.p + r;
    B.v = O.v + wr + sliding;
    B.a = O.a + cross(O.alpha, r) + cross(O.w, wr) + 2.0 * cross(O.w, sliding) + B.R * (h.s + push.v);
    B.alpha = O.alpha + cross(O.w, turning) + B.R * (h.Hdot_w + push.w);
    B.w = O.w + turning;
  });
  if (b.pnode < 0) return;
  // From P to B: its deformation is undone.
  DeformedNode<double> d;
  deform<double>(model.shapes[b.pnode], in.q + b.eta, in.v + b.etadot, d);
  B.R = B.R * transpose(d.R);
  const Vec3<double> r = B.R * d.rho, turning = B.R * d.rate.w, moving = B.R * d.rate.v;
  B.w -= turning;
  B.p -= r;
  B.v -= cross(B.w, r) + moving;
  B.alpha -= cross(B.w, turning) + B.R * d.bias.w;
  B.a -= cross(B.alpha, r) + cross(B.w, cross(B.w, r)) + 2.0 * cross(B.w, moving);
}

/// What the modes of body k of a path, or of home, do to an end: by frame B, and by the place where the path leaves. x: of the end.
/// add(mode, turning, moving at x)
template <class Add>
static inline void columns_of_modes(const SweepModel& model, const Workspace<double>& ws, int k, bool moves_frame, const PathState& s,
                                    const PathExit& exit, const Vec3<double>& x, const Add& add) {
  const double* C = moves_frame ? ws.modal_of(k)->C : nullptr;
  for (int j = 0; j < model.bodies[k].n_modes; ++j) {
    Vec3<double> turning{}, moving{};
    if (exit.shapes) {
      const double* c = exit.shapes->columns.data() + 6 * j;
      turning = s.R * (exit.Jl * Vec3<double>{c[0], c[1], c[2]});
      moving = s.R * Vec3<double>{c[3], c[4], c[5]} + cross(turning, x - exit.x);
    }
    if (C) {
      const Motion<double> frame = motion_column(C, j);
      const Vec3<double> w = s.R * frame.w;
      turning -= w;
      moving -= s.R * frame.v + cross(w, x - s.p);
    }
    add(j, turning, moving);
  }
}

/// Rows of a loop between places, their residuals and gamma_c, in axes of home; and G.
static inline void geometric_rows(const SweepModel& model, const EmbeddedLoop& c, const Workspace<double>& ws, EmbeddingWork& k,
                                  const Inputs<double>& in, const RowsOfHinges& hinges) {
  static const PathState at_rest{Mat3<double>::identity(), {}, {}, {}, {}, {}};
  PathState* path = k.path.data();
  PathExit *exits = k.exits.data(), *of_home = exits + c.path.size();
  if (c.deforms)
    for (std::size_t i = 0; i < c.path.size() + 2; ++i) exits[i].shapes = nullptr;
  for (std::size_t i = 0; i < c.path.size(); ++i) {
    const EmbeddedLoop::PathBody& p = c.path[i];
    if (p.seen) continue;
    const PathState& A = p.inboard < 0 ? at_rest : path[c.path[static_cast<std::size_t>(p.inboard)].state];
    PathState& B = path[p.state];
    const BodyKernel kind = model.bodies[p.body].kind;
    if (is_axis(kind) && kind != BodyKernel::rotor) {
      const AxisBody& b = model.axis_bodies[p.body];
      for_axis(
          kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
            path_axis<I, TILT>(b, Vec3<double>{b.p[0], b.p[1], b.p[2]}, ws.cosines[b.angle], ws.sines[b.angle], in.v[b.v], A, B);
          });
    } else if (is_general(kind)) {
      path_general(model, ws, in, p.body, A, p.inboard >= 0 ? exits[p.inboard] : of_home[p.sign > 0.0], B);
    } else if (p.shifts) {
      const SweepBody& b = model.bodies[p.body];
      path_shift(ws.X(p.body).p, b.axis, in.v[b.v], A, B);
    } else {
      path_any(model, ws, in, p.body, A, B);
    }
  }
  const bool forces = c.closing != Closing::weld && c.closing != Closing::hinge;  // whose axes are of no account at `to`
  const auto end = [&](int at, int node, const Pose<double>& pose, int side) {
    const PathState& s = at < 0 ? at_rest : path[c.path[static_cast<std::size_t>(at)].state];
    if (node < 0) return place_on(s, pose, side == 0 || !forces);
    return place_on(model, in, at < 0 ? c.home : c.path[static_cast<std::size_t>(at)].body, model.nodes[node].shapes, s,
                    at < 0 ? of_home[side] : exits[at]);
  };
  const PathState a = end(c.from_at, c.from_node, c.from, 0), b = end(c.to_at, c.to_node, c.to, 1);
  const Vec3<double> d = b.p - a.p, w = b.w - a.w, u = b.v - a.v - cross(a.w, d);
  Force<double>* W = k.W.data() + c.row;
  double* residual = k.c.data() + c.row;
  double extra[6] = {};
  for (int i = 0; i < c.rows; ++i) W[i] = {};
  const Vec3<double> axes[] = {column_of<0>(a.R), column_of<1>(a.R), column_of<2>(a.R)};
  const auto hold = [&](int i, int axis) { W[i].f = axes[axis], residual[i] = dot(axes[axis], d); };
  switch (c.closing) {
    case Closing::weld: {
      const Vec3<double> bx = column_of<0>(b.R), by = column_of<1>(b.R), bz = column_of<2>(b.R);
      const Vec3<double> turn = 0.5 * (cross(axes[0], bx) + cross(axes[1], by) + cross(axes[2], bz));  // to first order
      for (int i = 0; i < 3; ++i) W[i].n = axes[i], residual[i] = dot(axes[i], turn), hold(3 + i, i);
      break;
    }
    case Closing::point:
      hold(2, 2);
      [[fallthrough]];
    case Closing::line:
      hold(0, 0), hold(1, 1);
      break;
    case Closing::plane:
      hold(0, 2);
      break;
    case Closing::distance: {
      const double length = std::sqrt(dot(d, d));
      W[0].f = (1.0 / length) * d;
      residual[0] = length - c.length;
      const double along = dot(W[0].f, u);
      extra[0] = (dot(u, u) - along * along) / length;
      break;
    }
    case Closing::hinge:
      if (c.turns) {
        rows_across(transpose_times(a.R, b.R * c.axis), W);
        const Vec3<double> turn = cross(a.R * c.axis, b.R * c.axis), wu = cross(w, u);  // to first order
        for (int i = 0; i < 2; ++i) W[i].n = a.R * W[i].n, residual[i] = dot(W[i].n, turn);
        for (int i = 0; i < 3; ++i) hold(2 + i, i), extra[2 + i] = -dot(axes[i], wu);
        break;
      }
      [[fallthrough]];
    default: {
      const RelativePlace place{transpose(a.R) * b.R, transpose_times(a.R, d), transpose_times(a.R, w), transpose_times(a.R, u)};
      hinges.close(hinges.context, c.loop, place, W, residual, extra);
      for (int i = 0; i < c.rows; ++i) W[i] = {a.R * W[i].n, a.R * W[i].f};
    }
  }
  const Vec3<double> wdot = b.alpha - a.alpha - cross(a.w, w);
  const Vec3<double> udot = b.a - a.a - cross(a.alpha, d) - 2.0 * cross(a.w, u) - cross(a.w, cross(a.w, d));
  for (int i = 0; i < c.rows; ++i) k.g[static_cast<std::size_t>(c.row + i)] = -(dot(W[i].n, wdot) + dot(W[i].f, udot) + extra[i]);
  double* G = k.numbers.data() + c.G;
  const auto set_column = [&](int column, double sign, const Vec3<double>& turning, const Vec3<double>& moving) {
    for (int i = 0; i < c.rows; ++i) G[i * c.own_columns + column] = sign * (dot(W[i].n, turning) + dot(W[i].f, moving));
  };
  for (std::size_t i = 0; i < c.path.size(); ++i) {
    const EmbeddedLoop::PathBody& p = c.path[i];
    const PathState& s = path[p.state];
    const Vec3<double> arm = b.p - s.p;  // both ends at the place of `to`
    const BodyKernel kind = model.bodies[p.body].kind;
    if (is_axis(kind) && kind != BodyKernel::rotor) {
      const Vec3<double> turning = p.sign * turning_axis(kind, s.R), moving = cross(turning, arm);
      for (int r = 0; r < c.rows; ++r) {
        double& entry = G[r * c.own_columns + p.column] = dot(W[r].f, moving);
        if (!forces) entry += dot(W[r].n, turning);
      }
    } else if (forces && kind == BodyKernel::slide) {
      const Vec3<double> moving = p.sign * (s.R * model.bodies[p.body].axis);
      for (int r = 0; r < c.rows; ++r) G[r * c.own_columns + p.column] = dot(W[r].f, moving);
    } else {
      for (int j = 0; j < p.n; ++j) {
        const Motion<double> H = hinge_column(model, ws, p.body, j);
        const Vec3<double> turning = s.R * H.w;
        set_column(p.column + j, p.sign, turning, s.R * H.v + cross(turning, arm));
      }
    }
    if (p.modes >= 0)
      columns_of_modes(model, ws, p.body, true, s, exits[i], b.p, [&](int j, const Vec3<double>& turning, const Vec3<double>& moving) {
        set_column(p.modes + j, p.sign, turning, moving);
      });
  }
  if (c.home_modes < 0) return;
  const int n_modes = model.bodies[c.home].n_modes;
  for (int i = 0; i < c.rows; ++i)
    for (int j = 0; j < n_modes; ++j) G[i * c.own_columns + c.home_modes + j] = 0.0;
  for (int side = 0; side < 2; ++side)
    columns_of_modes(model, ws, c.home, false, at_rest, of_home[side], b.p,
                     [&](int j, const Vec3<double>& turning, const Vec3<double>& moving) {
                       for (int i = 0; i < c.rows; ++i)
                         G[i * c.own_columns + c.home_modes + j] += (side ? 1.0 : -1.0) * (dot(W[i].n, turning) + dot(W[i].f, moving));
                     });
}

/// A vector of each.
template <class T>
CARDAN_INLINE Vec3<T> vector_of(const double (*x)[AlikeRows::kMost]) {
  return {side<T>(x[0]), side<T>(x[1]), side<T>(x[2])};
}
/// The same in every lane.
template <class T>
CARDAN_INLINE Vec3<T> in_all(const Vec3<double>& x) {
  return {T(x.x), T(x.y), T(x.z)};
}
template <class T>
CARDAN_INLINE PathStateOf<T> in_all(const PathState& s) {
  const Mat3<double>& R = s.R;
  return {{T(R.xx), T(R.xy), T(R.xz), T(R.yx), T(R.yy), T(R.yz), T(R.zx), T(R.zy), T(R.zz)},
          in_all<T>(s.p),
          in_all<T>(s.w),
          in_all<T>(s.v),
          in_all<T>(s.alpha),
          in_all<T>(s.a)};
}

/// geometric_rows of loops side by side, as far as anybody asks: bodies found before are where they were found, in every lane.
template <class T>
static void geometric_rows(const SweepModel& model, const Embedding& e, const AlikeRows& all, Workspace<double>& ws, EmbeddingWork& k,
                           const Inputs<double>& in) {
  const EmbeddedLoop* loops = e.loops.data() + all.first;
  const EmbeddedLoop& c = *loops;
  static const PathState at_rest{Mat3<double>::identity(), {}, {}, {}, {}, {}};
  union Found {
    CARDAN_INLINE Found() {}  // nothing is written before it is found
    PathStateOf<T> s;
  } found[AlikeRows::kMostBodies], before;
  const int bodies = static_cast<int>(c.path.size());
  const auto state_at = [&](int i) __attribute__((always_inline))->const PathStateOf<T>& {
    const EmbeddedLoop::PathBody* p = i < 0 ? nullptr : &c.path[static_cast<std::size_t>(i)];
    if (p && !p->seen) return found[i].s;
    return before.s = in_all<T>(p ? k.path[static_cast<std::size_t>(p->state)] : at_rest);
  };
  for (int i = 0; i < bodies; ++i) {
    const EmbeddedLoop::PathBody& p = c.path[static_cast<std::size_t>(i)];
    if (p.seen) continue;
    const AlikeRows::Body& body = all.bodies[static_cast<std::size_t>(i)];
    const AlikeHinges& h = body.hinges;
    const PathStateOf<T>& A = state_at(p.inboard);
    const T rate = each<T>([&](int l) { return in.v[h.v[l]]; });
    if (p.shifts) {
      Vec3<T> r;
      const Places<T> at([&](int l) { return &ws.X(h.body[l]).p.x; });
      at.take(0, r.x, r.y), at.take(2, r.z);
      path_shift(r, vector_of<T>(body.u), rate, A, found[i].s);
    } else {
      for_axis(
          h.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
            path_axis<I, TILT>(HingesAside<T>(h), vector_of<T>(body.p), cosine_of<T>(ws, h), sine_of<T>(ws, h), rate, A, found[i].s);
          });
    }
  }
  const Vec3<T> Rx = vector_of<T>(all.from_R), Ry = vector_of<T>(all.from_R + 3), Rz = vector_of<T>(all.from_R + 6);
  const Pose<T> from{{Rx.x, Rx.y, Rx.z, Ry.x, Ry.y, Ry.z, Rz.x, Rz.y, Rz.z}, vector_of<T>(all.from_p)};
  const PathStateOf<T> a = place_on(state_at(c.from_at), from, true);
  const PathStateOf<T> b = place_on(state_at(c.to_at), Pose<T>{Mat3<T>::identity(), vector_of<T>(all.to_p)}, false);
  const Vec3<T> d = b.p - a.p, u = b.v - a.v - cross(a.w, d);
  const Vec3<T> udot = b.a - a.a - cross(a.alpha, d) - T(2.0) * cross(a.w, u) - cross(a.w, cross(a.w, d));
  const Vec3<T> axes[] = {column_of<0>(a.R), column_of<1>(a.R), column_of<2>(a.R)};
  const Vec3<T>* W = axes + (c.closing == Closing::plane ? 2 : 0);
  const Places<T> residual([&](int l) { return k.c.data() + loops[l].row; }), g([&](int l) { return k.g.data() + loops[l].row; });
  for (int i = 0; i < c.rows; ++i) residual.template put<false>(i, dot(W[i], d)), g.template put<false>(i, -dot(W[i], udot));
  T G[AlikeRows::kMostNumbers];
  const auto set_column = [&](int column, double sign, const Vec3<T>& moving) __attribute__((always_inline)) {
    for (int i = 0; i < c.rows; ++i) G[i * c.own_columns + column] = T(sign) * dot(W[i], moving);
  };
  for (int i = 0; i < bodies; ++i) {
    const EmbeddedLoop::PathBody& p = c.path[static_cast<std::size_t>(i)];
    if (p.seen) {
      const PathState& s = k.path[static_cast<std::size_t>(p.state)];
      const Vec3<T> arm = b.p - in_all<T>(s.p);
      for (int j = 0; j < p.n; ++j) {
        const Motion<double> H = hinge_column(model, ws, p.body, j);
        set_column(p.column + j, p.sign, in_all<T>(s.R * H.v) + cross(in_all<T>(s.R * H.w), arm));
      }
      continue;
    }
    const PathStateOf<T>& s = found[i].s;
    const AlikeRows::Body& body = all.bodies[static_cast<std::size_t>(i)];
    if (p.shifts)
      set_column(p.column, p.sign, s.R * vector_of<T>(body.u));
    else
      set_column(p.column, p.sign, cross(turning_axis(body.hinges.kind, s.R), b.p - s.p));
  }
  const Places<T> to([&](int l) { return k.numbers.data() + loops[l].G; });
  const int numbers = c.rows * c.own_columns;
  int i = 0;
  for (; i + 4 <= numbers; i += 4) to.template put<false>(i, G[i], G[i + 1], G[i + 2], G[i + 3]);
  for (; i < numbers; ++i) to.template put<false>(i, G[i]);
}
static inline void geometric_rows(const SweepModel& model, const Embedding& e, const AlikeRows& all, Workspace<double>& ws,
                                  EmbeddingWork& k, const Inputs<double>& in) {
  if constexpr (kMostAside == 4)
    if (all.n == 4) return geometric_rows<Lanes<4>>(model, e, all, ws, k, in);
  geometric_rows<Lanes<2>>(model, e, all, ws, k, in);
}

/// Scaled rows of a loop in its inputs, or in all rates of its way: rates in the root of their energy, rows in metres, G x + constant = 0,
/// the constant behind the columns. `plain`: loops before are named. Returns how far the loop is open.
static inline double scale_rows(const Embedding& e, const EmbeddedLoop& c, EmbeddingWork& k, int columns, bool plain) {
  const double *G = k.numbers.data() + c.G, *numbers = k.numbers.data();
  const double *g = k.g.data() + c.row, *residual = k.c.data() + c.row;
  const int stride = padded(columns + 1);
  const bool coupling = c.closing == Closing::coupling;
  double open = 0.0;
  double* row = k.numbers.data() + c.B;
  for (int i = 0; i < c.rows; ++i, row += stride, G += c.own_columns) {
    double weight = 1.0;  // of the forces of these closures, which are of length one
    if (c.closing == Closing::hinge || c.closing == Closing::weld) {
      const Force<double>& W = k.W[static_cast<std::size_t>(c.row + i)];
      weight = 1.0 / std::sqrt(dot(W.n, W.n) / (c.lever * c.lever) + dot(W.f, W.f));
    }
    if (!coupling || !c.coupling.is_linear())
      if (const double x = std::abs(residual[i]) * weight / c.lever; x > open) open = x;
    weight /= c.reference;
    for (int j = 0; j < stride; j += 4) four(row + j).x = Four{};
    double constant = -g[i];
    for (int j = 0; j < c.own_columns; ++j) {
      const EmbeddedLoop::Column& x = c.columns[static_cast<std::size_t>(j)];
      if (x.given) continue;  // in g
      if (!c.by_rates) {
        row[j] = weight * G[j] * x.scale;
      } else if (const int input = x.input < 0 && plain ? x.as : x.input; input >= 0) {
        row[input] = weight * G[j] * x.scale;
      } else if (G[j] != 0.0) {
        const EmbeddedLoop& other = e.loops[static_cast<std::size_t>(x.by)];
        const double *E = numbers + other.E + x.at * other.width, factor = weight * G[j];
        double* to = row + other.consumer_input;
        for (int t = 0; t < other.keep; ++t) to[t] += factor * E[t];
        const double known = G[j] * E[other.n];
        constant += known;
        if (const double size = std::abs(weight * known); size > k.size) k.size = size;
      }
    }
    row[columns] = weight * constant;
  }
  return open;
}

/// True: none of the first n numbers of a row is beyond `most`, or none at all.
CARDAN_INLINE bool is_within(const double* row, int n, double most) {
  auto within = Four{} == Four{};
  int j = 0;
  for (; j + 4 <= n; j += 4) within &= (four(row + j).x <= most) & (four(row + j).x >= -most);
  bool all = (within[0] & within[1] & within[2] & within[3]) != 0;
  for (; j < n; ++j) all = all && std::abs(row[j]) <= most;
  return all;
}

/// Complete pivoting over the first `searched` columns, rows of so many FOURS (0: any) and constants reduced until the pivots stand alone.
/// k.row_at, k.column_at: how they were exchanged. False: the rank is not that of the program; rows contradict each other, where they are
/// to be `consistent`; or, where not all columns were searched, others would be better pivots.
template <int FOURS>
static bool find_pivots(const EmbeddedLoop& c, EmbeddingWork& k, int columns, int searched, double open, bool consistent) {
  double* B = k.numbers.data() + c.B;
  int *row_at = k.row_at.data() + c.row, *column_at = k.column_at.data() + c.pivot;
  const int stride = FOURS > 0 ? 4 * FOURS : padded(columns + 1);
  if (c.chosen) {  // the rows of the start first
    int others = c.rank;
    for (int i = 0; i < c.rows; ++i) {
      int p = 0;
      while (p < c.rank && c.kept[static_cast<std::size_t>(p)] != i) ++p;
      row_at[p < c.rank ? p : others++] = i;
    }
  } else {
    for (int i = 0; i < c.rows; ++i) row_at[i] = i;
  }
  const int rows = c.chosen ? c.rank : c.rows;
  for (int j = 0; j < columns; ++j) column_at[j] = j;
  double smallest = k.smallest;
  int weakest = k.weakest;
  for (int i = 0; i < c.rows; ++i)
    if (const double x = std::abs(B[i * stride + columns]); x > k.size) k.size = x;
  for (int p = 0;; ++p) {
    int row = p, column = 0;
    double most = 0.0;
    const int among = p == c.rank ? columns : searched;
    for (int i = p; i < rows; ++i) {
      const double* candidates = B + row_at[i] * stride;  // zero where a column has its pivot
      for (int j = 0; j < among; ++j)
        if (const double x = std::abs(candidates[j]); x > most) most = x, row = i, column = j;
    }
    if (p == c.rank) {
      if (most > std::fmax(kNoPivot, std::fmin(kOpenRows * open, kMostOpenRows))) return false;
      break;
    }
    if (!(most > (c.implied ? kWeakPivot : kNoPivot))) return false;
    const int i0 = row_at[row];
    if (most < smallest) smallest = most, weakest = c.first + i0;
    row_at[row] = row_at[p], row_at[p] = i0;
    int at = p;
    while (column_at[at] != column) ++at;
    column_at[at] = column_at[p], column_at[p] = column;
    double* pivot = B + i0 * stride;
    set_row(pivot, 1.0 / pivot[column], pivot, stride);
    for (int i = c.by_rates ? 0 : p + 1; i < c.rows; ++i) {  // rates are wanted by themselves, of multipliers the rank
      if (i == p) continue;
      double* other = B + row_at[i] * stride;
      const double factor = other[column];
      if (factor == 0.0) continue;
      add_row(other, -factor, pivot, stride);
      other[column] = 0.0;
    }
  }
  for (int i = c.rank; consistent && i < rows; ++i)
    if (!(std::abs(B[row_at[i] * stride + columns]) <= (kContradicts + 1e3 * open) * k.size)) return false;
  for (int p = 0; searched < columns && p < c.rank; ++p)
    if (!is_within(B + row_at[p] * stride, columns, kSteepOwn)) return false;
  k.smallest = smallest, k.weakest = weakest;
  return true;
}
static inline bool find_pivots(const EmbeddedLoop& c, EmbeddingWork& k, int columns, int searched, double open, bool consistent) {
  switch (padded(columns + 1) / 4) {
    case 1:
      return find_pivots<1>(c, k, columns, searched, open, consistent);
    case 2:
      return find_pivots<2>(c, k, columns, searched, open, consistent);
    case 3:
      return find_pivots<3>(c, k, columns, searched, open, consistent);
    default:
      return find_pivots<0>(c, k, columns, searched, open, consistent);
  }
}

/// T <- T (1 - reflections), so that the inputs that later loops have hang on the first coordinates alone.
static inline void gather_needed(const EmbeddedLoop& c, double* T) {
  const int n = c.n, stride = c.width;
  for (int i = 0; i < c.keep; ++i) {
    double* row = T + (c.own + i) * stride;
    double norm = 0.0;
    for (int j = i; j < n; ++j) norm += row[j] * row[j];
    double beyond = 0.0;
    for (int j = i + 1; j < n; ++j) beyond = std::fmax(beyond, std::abs(row[j]));
    if (beyond == 0.0) continue;
    norm = std::sqrt(norm);
    const double alpha = row[i] > 0.0 ? -norm : norm, first = row[i] - alpha;
    const double factor = 1.0 / (norm * (norm + std::abs(row[i])));  // 2 / v* v
    row[i] = first;                                                  // v
    for (int r = 0; r < c.inputs; ++r) {
      double* t = T + r * stride;
      if (t == row) continue;
      double sum = 0.0;
      for (int j = i; j < n; ++j) sum += row[j] * t[j];
      sum *= factor;
      for (int j = i; j < n; ++j) t[j] -= sum * row[j];
    }
    row[i] = alpha;
    for (int j = i + 1; j < n; ++j) row[j] = 0.0;
  }
}

/// How the bodies of a loop move with its coordinates: Motions = U x + the last column.
static inline void move_bodies(const SweepModel& model, const EmbeddedLoop& c, Workspace<double>& ws, EmbeddingWork& k) {
  const int n = c.n;
  const double* E = k.numbers.data() + c.E;
  for (const EmbeddedLoop::PathBody& p : c.path) {
    if (p.motion < 0) continue;
    Motion<double>* U = k.U.data() + p.motion;
    const Motion<double>* inboard = p.of_inboard < 0 ? nullptr : k.U.data() + p.of_inboard;
    const SweepBody& b = model.bodies[p.body];
    if (is_axis(b.kind) && b.kind != BodyKernel::rotor) {
      const AxisBody& axis = model.axis_bodies[p.body];
      for_axis(
          b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
            const double cosine = ws.cosines[axis.angle], sine = ws.sines[axis.angle];
            const double* rate = E + p.column * c.width;
            for (int i = 0; i <= n; ++i) {
              U[i] = inboard ? motion_to_outboard<double, I, TILT>(axis, cosine, sine, inboard[i]) : Motion<double>{};
              at<I>(U[i].w) = at<I>(U[i].w) + rate[i];
            }
          });
      continue;
    }
    if (b.kind == BodyKernel::rotor) continue;
    for (int i = 0; i <= n; ++i) U[i] = inboard ? to_outboard(ws.X(p.body), inboard[i]) : Motion<double>{};
    for (int j = 0; j < p.n; ++j) {
      const Motion<double> H = hinge_column(model, ws, p.body, j);
      for (int i = 0; i <= n; ++i) U[i] += E[(p.column + j) * c.width + i] * H;
    }
  }
}

/// Everything of the loops before the sweeps. `given`: what G v' is to be, per row of the model; null: gamma_c. False: the rank has
/// changed, or rows contradict each other.
static inline bool embedding_kinematics(const SweepModel& model, const Embedding& e, Workspace<double>& ws, EmbeddingWork& k,
                                        const Inputs<double>& in, const RowsOfHinges& hinges, const double* given) {
  if (!find_ratios(e, k, in, given)) return false;
  double* numbers = k.numbers.data();
  std::size_t next_push = 0;              // they stand in the order of the loops
  auto next_rows = e.alike_rows.begin();  // likewise
  std::size_t with_rows = 0;              // so many loops have theirs
  k.size = 0.0, k.smallest = 1.0;
  for (double* x = numbers; x < numbers + e.n_zeroed; ++x) *x = 0.0;
  for (double& x : k.b) x = 0.0;
  for (double& x : k.modal) x = 0.0;
  for (Force<double>& f : k.Q) f = {};
  for (Force<double>& f : k.z) f = {};
  for (ArticulatedInertia<double>& P : k.P) P = {};
  for (std::size_t l = 0; l < e.loops.size(); ++l) {
    const EmbeddedLoop& c = e.loops[l];
    if (k.known[l] && !given) {
      move_bodies(model, c, ws, k);
      continue;
    }
    k.known[l] = 0;
    double *G = numbers + c.G, *g = k.g.data() + c.row, *residual = k.c.data() + c.row;
    const int columns = c.by_rates ? c.inputs : c.own_columns, n = c.n;
    if (c.closing == Closing::coupling) {
      double* gradient = k.gradients.data() + c.gradient;
      double extra = 0.0;
      residual[0] = 0.0;  // of a linear one nobody asks
      if (!c.coupling.is_linear()) c.coupling.at(in.q, in.v, gradient, residual[0], extra);
      g[0] = -extra, k.W[static_cast<std::size_t>(c.row)] = {};
      for (int j = 0; j < c.own_columns; ++j) {
        const EmbeddedLoop::Column& x = c.columns[static_cast<std::size_t>(j)];
        G[j] = x.term < 0 ? 0.0 : gradient[x.term];
        if (x.given && in.vdot) g[0] -= G[j] * in.vdot[x.v];
      }
    } else if (l >= with_rows) {
      while (next_rows != e.alike_rows.end() && (next_rows->first < static_cast<int>(l) || is_left_out(*next_rows))) ++next_rows;
      if (next_rows != e.alike_rows.end() && next_rows->first == static_cast<int>(l))
        geometric_rows(model, e, *next_rows, ws, k, in), with_rows = l + static_cast<std::size_t>(next_rows->n);
      else
        geometric_rows(model, c, ws, k, in, hinges);
    }
    if (c.drive >= 0 && in.drives) g[0] += in.drives[c.drive].acceleration, residual[0] -= in.drives[c.drive].more;
    if (given)
      for (int i = 0; i < c.rows; ++i) g[i] = given[c.first + i];
    const bool plain =
        std::ranges::all_of(c.taken, [&](const EmbeddedLoop::Taken& t) { return k.named[static_cast<std::size_t>(t.by)] != 0; });
    double open = scale_rows(e, c, k, columns, plain);
    bool named = c.by_own && plain;
    if (named && !find_pivots(c, k, columns, c.own, open, !given)) named = false, open = scale_rows(e, c, k, columns, plain);
    if (!named && !find_pivots(c, k, columns, columns, open, !given)) return false;
    k.named[l] = named;
    const int* row_at = k.row_at.data() + c.row;
    if (!c.by_rates) {
      for (int p = 0; p < n; ++p) k.b[static_cast<std::size_t>(c.x + p)] = g[row_at[p]];
      for (int p = 0; p < n; ++p) {
        double& sum = k.x[static_cast<std::size_t>(c.x + p)];
        sum = 0.0;
        for (int j = 0; j < c.own_columns; ++j) {
          const double entry = G[row_at[p] * c.own_columns + j] * c.columns[static_cast<std::size_t>(j)].scale;
          sum += entry * entry;
        }
      }
      for (; next_push < e.pushes.size() && &e.loops[static_cast<std::size_t>(e.pushes[next_push].loop)] == &c; ++next_push) {
        const Embedding::Push& push = e.pushes[next_push];
        const int at = push.sign > 0.0 ? c.from_at : c.to_at;
        static const PathState at_rest{Mat3<double>::identity(), {}, {}, {}, {}, {}};
        const auto state_at = [&](int i) -> const PathState& {
          return i < 0 ? at_rest : k.path[static_cast<std::size_t>(c.path[static_cast<std::size_t>(i)].state)];
        };
        const PathState& s = state_at(at);
        const PathState& to = state_at(c.to_at);
        const PathExit& exit_to = k.exits[c.to_at >= 0 ? static_cast<std::size_t>(c.to_at) : c.path.size() + 1];
        const Vec3<double> x = c.to_node >= 0 ? exit_to.x : c.to_at < 0 ? c.to.p : to.p + to.R * c.to.p;
        for (int p = 0; p < n; ++p) {
          const Force<double>& W = k.W[static_cast<std::size_t>(c.row + row_at[p])];
          const Force<double> f{push.sign * (W.n + cross(x - s.p, W.f)), push.sign * W.f};
          k.Q[static_cast<std::size_t>(push.own + p)] = {transpose_times(s.R, f.n), transpose_times(s.R, f.f)};
          if (push.modes < 0) continue;
          const PathExit& exit = k.exits[at >= 0 ? static_cast<std::size_t>(at) : c.path.size() + (push.sign > 0.0 ? 0 : 1)];
          const Vec3<double> turning = transpose_times(exit.Jl, transpose_times(s.R, push.sign * (W.n + cross(x - exit.x, W.f)))),
                             shift = transpose_times(s.R, f.f);
          const int m = model.bodies[push.body].n_modes;
          const double* shapes = exit.shapes->columns.data();
          double* out = k.modal.data() + push.modes + p * m;
          for (int j = 0; j < m; ++j, shapes += 6)
            out[j] =
                dot(Vec3<double>{shapes[0], shapes[1], shapes[2]}, turning) + dot(Vec3<double>{shapes[3], shapes[4], shapes[5]}, shift);
        }
      }
      continue;
    }
    // Inputs = T x + t.
    const double* B = numbers + c.B;
    double* T = numbers + c.T;
    int* column_at = k.column_at.data() + c.pivot;
    if (named) std::rotate(column_at + c.rank, column_at + c.own, column_at + columns);  // its own that are left come last
    const int stride = padded(columns + 1);
    for (int x = 0; x < columns * c.width; x += 4) four(T + x).x = Four{};
    for (int p = 0; p < c.rank; ++p) {
      const double* row = B + row_at[p] * stride;
      double* t = T + column_at[p] * c.width;
      for (int j = 0; j < n; ++j) t[j] = -row[column_at[c.rank + j]];
      t[n] = -row[columns];
    }
    for (int j = 0; j < n; ++j) T[column_at[c.rank + j] * c.width + j] = 1.0;
    if (!named && c.keep > 0 && c.keep < n) gather_needed(c, T);
    // Rates = E x + e.
    double* E = numbers + c.E;
    for (std::size_t j = 0; j < c.columns.size(); ++j, E += c.width) {
      const EmbeddedLoop::Column& x = c.columns[j];
      if (const int input = x.input < 0 && plain ? x.as : x.input; input >= 0 && !x.given) {
        set_row(E, x.scale, T + input * c.width, c.width);
        continue;
      }
      for (int i = 0; i < c.width; i += 4) four(E + i).x = Four{};
      if (x.given) continue;
      const EmbeddedLoop& other = e.loops[static_cast<std::size_t>(x.by)];
      const double* old = numbers + other.E + x.at * other.width;
      E[n] = old[other.n];
      for (int t = 0; t < other.keep; ++t) add_row(E, old[t], T + (other.consumer_input + t) * c.width, c.width);
    }
    k.known[l] = c.constant && !given;
    move_bodies(model, c, ws, k);
  }
  return true;
}

}  // namespace cardan::soa
