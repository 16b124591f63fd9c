#pragma once
// Inward and outward with pending coordinates of loops (docs/mathematics/loops.md, 4): items, hinges that they cross, homes.
#include "core/soa/embedding_gears.hpp"
#include "core/soa/embedding_kinematics.hpp"
#include "core/soa/kernels.hpp"
#include "core/soa/kernels_acceleration.hpp"

namespace cardan::soa {

/// visit(inertia, force): how what is on body k is seen from its inboard body.
template <class Visit>
CARDAN_INLINE void with_way_inboard(const SweepModel& model, Workspace<double>& ws, int k, const Visit& visit) {
  const SweepBody& body = model.bodies[k];
  if (is_axis(body.kind)) {
    const AxisBody& b = model.axis_bodies[k];
    const double c = ws.cosines[b.angle], s = ws.sines[b.angle];
    for_axis(
        body.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          visit([&](const ArticulatedInertia<double>& P) { return inertia_to_inboard<I, TILT>(b, c, s, P); },
                [&](const Force<double>& f) { return force_to_inboard<double, I, TILT>(b, c, s, f); });
        });
  } else {
    const Pose<double>& X = ws.X(k);
    visit([&](const ArticulatedInertia<double>& P) { return to_inboard(X, P); }, [&](const Force<double>& f) { return to_inboard(X, f); });
  }
}

/// A body whose hinge rates a loop has taken up: its own inertia and what is assembled on it move by U with the coordinates.
static inline void take_item(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws,
                             EmbeddingWork& k, const Inputs<double>& in) {
  const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(step.loop)];
  const int n = c.n;
  const SweepBody& body = model.bodies[step.body];
  const Core<double>& core = ws.core(step.body);
  const Motion<double>* U = k.U.data() + step.motion;
  Force<double>* Q = k.Q.data();
  Force<double>* PU = k.PU.data();
  double *A = k.numbers.data() + c.A, *b = k.b.data() + c.x;
  const double* E = k.numbers.data() + c.E + step.column * c.width;
  for (int i = 0; i <= n; ++i) PU[i] = core.P * U[i];
  Force<double> z = ws.z(step.body) + PU[n];
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) A[i * c.width + j] += dot(U[i], PU[j]);
    b[i] += dot(U[i], z);
  }
  if (in.tau)
    for (int j = 0; j < body.nv; ++j)
      for (int i = 0; i < n; ++i) b[i] -= E[j * c.width + i] * in.tau[body.v + j];
  const std::size_t flows = step.flows.size();
  for (std::size_t f = 0; f < flows; ++f) {
    const PendingFlow& flow = step.flows[f];
    if (flow.own < 0) continue;
    const Force<double>* own = Q + flow.own;
    if (f == 0) {
      for (int i = 0; i < n; ++i) {
        for (int j = 0; j <= i; ++j) A[i * c.width + j] += dot(U[i], own[j]) + dot(U[j], own[i]);
        b[i] += dot(U[n], own[i]);
      }
      continue;
    }
    const EmbeddedLoop& other = e.loops[static_cast<std::size_t>(flow.loop)];
    const CoordinateBlock& block = step.blocks[f];
    for (int j = 0; j < other.n; ++j) {
      for (int i = 0; i < n; ++i) k.numbers[static_cast<std::size_t>(block.at + i * block.down + j * block.across)] += dot(U[i], own[j]);
      k.b[static_cast<std::size_t>(other.x + j)] += dot(U[n], own[j]);
    }
  }
  if (body.parent == 0) return;
  with_way_inboard(
      model, ws, step.body, [&](const auto& inertia, const auto& force) __attribute__((always_inline)) {
        ArticulatedInertia<double> P = core.P;
        if (step.carried >= 0) P += k.P[static_cast<std::size_t>(step.carried)], z += k.z[static_cast<std::size_t>(step.carried)];
        ArticulatedInertia<double>& to_P = step.to_carried ? k.P[static_cast<std::size_t>(step.carried_to)] : ws.core(body.parent).P;
        Force<double>& to_z = step.to_carried ? k.z[static_cast<std::size_t>(step.carried_to)] : ws.z(body.parent);
        to_P += inertia(P);
        to_z += force(z);
        for (std::size_t f = 0; f < flows; ++f) {
          const PendingFlow& flow = step.flows[f];
          const int width = e.loops[static_cast<std::size_t>(flow.loop)].n;
          for (int i = 0; i < width; ++i) {
            Force<double> q = f == 0 ? PU[i] : Force<double>{};
            if (flow.own >= 0) q += Q[flow.own + i];
            if (flow.carried >= 0) q += Q[flow.carried + i];
            Q[flow.to + i] += force(q);
          }
        }
      });
}

/// P times a unit rate about axis I.
template <int I>
CARDAN_INLINE Force<double> turning_column(const RigidInertia<double>& M) {
  const Vec3<double>& h = M.h;
  if constexpr (I == 0)
    return {{M.J.xx, M.J.xy, M.J.xz}, {0.0, -h.z, h.y}};
  else if constexpr (I == 1)
    return {{M.J.xy, M.J.yy, M.J.yz}, {h.z, 0.0, -h.x}};
  else
    return {{M.J.xz, M.J.yz, M.J.zz}, {-h.y, h.x, 0.0}};
}

// What a chain is assembled of: inertia as that of its bodies, or ten numbers where all of them are rigid by themselves.
CARDAN_INLINE void own_inertia(const Core<double>& body, ArticulatedInertia<double>& P) { P = body.P; }
CARDAN_INLINE void own_inertia(const Core<double>& body, RigidInertia<double>& M) {
  const Mat3<double>& B = body.P.B;  // h~
  M = {body.P.M.xx, {B.zy, B.xz, B.yx}, body.P.J};
}
CARDAN_INLINE ArticulatedInertia<double> articulated(const ArticulatedInertia<double>& P) { return P; }
template <int I, Tilt TILT>
CARDAN_INLINE RigidInertia<double> inertia_to_inboard(const AxisBody& b, double c, double s, const RigidInertia<double>& M) {
  return inertia_to_inboard<double, I, TILT>(b, c, s, M);
}
/// About another point, l = p_AB, axes kept: J - h~ l~ - l~ h~ - m l~ l~, h + m l.
CARDAN_INLINE RigidInertia<double> shift(const Vec3<double>& l, const RigidInertia<double>& M) {
  const Vec3<double> h = M.h + M.m * l, g = M.h + h;  // the terms are those of l and g: symmetric in both
  Sym3<double> J = M.J;
  const double xx = l.x * g.x, yy = l.y * g.y, zz = l.z * g.z;
  J.xx += yy + zz, J.yy += xx + zz, J.zz += xx + yy;
  J.xy -= M.m * l.x * l.y + l.x * M.h.y + l.y * M.h.x;
  J.xz -= M.m * l.x * l.z + l.x * M.h.z + l.z * M.h.x;
  J.yz -= M.m * l.y * l.z + l.y * M.h.z + l.z * M.h.y;
  return {M.m, h, J};
}

/// What a chain of RATES hinge rates adds by the coordinates of its loop, rates = E x + e: A += E* M E, b += E* (h + M e), Q += F E,
/// z += F e. M: kBranchRates numbers a row; h: H* z - tau of each rate; Q null: its base is the ground.
template <int RATES>
static void move_branch(const EmbeddedLoop& c, const double* const* E, const double* M, const double* h, const Force<double>* F,
                        Force<double>& z, EmbeddingWork& k, Force<double>* Q) {
  constexpr int kMost = EmbeddingStep::kBranchRates;
  const int n = c.n, width = c.width;
  double *A = k.numbers.data() + c.A, *b = k.b.data() + c.x, *moves = k.scratch.data();  // M E, M e
  for (int j = 0; j < width; j += 4)
    for (int x = 0; x < RATES; ++x) {
      Four sum = M[x * kMost] * four(E[0] + j).x;
      for (int y = 1; y < RATES; ++y) sum += M[x * kMost + y] * four(E[y] + j).x;
      four(moves + x * width + j).x = sum;
    }
  double left[RATES];
  for (int x = 0; x < RATES; ++x) left[x] = h[x] + moves[x * width + n];
  for (int i = 0; i < n; ++i) {
    double bias = 0.0;
    for (int x = 0; x < RATES; ++x) bias += E[x][i] * left[x];
    b[i] += bias;
    for (int j = 0; j <= i; j += 4) {
      Four sum = E[0][i] * four(moves + j).x;
      for (int x = 1; x < RATES; ++x) sum += E[x][i] * four(moves + x * width + j).x;
      four(A + i * width + j).x += sum;
    }
  }
  if (!Q) return;
  for (int x = 0; x < RATES; ++x) z += E[x][n] * F[x];
  for (int i = 0; i < n; ++i) {
    Force<double> q = Q[i];
    for (int x = 0; x < RATES; ++x) q += E[x][i] * F[x];
    Q[i] = q;
  }
}

/// A chain of bodies whose hinge rates one loop has taken up: by its hinge rates, the composite inertia P, their mass matrix M and the
/// forces F that they make at the base; then by the coordinates of the loop, rates = E x + e: A += E* M E, b += E* (h* z - tau + M e),
/// Q += F E, z += F e.
template <class Inertia>
static void take_branch(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws, EmbeddingWork& k,
                        const Inputs<double>& in) {
  constexpr int kMost = EmbeddingStep::kBranchRates;
  const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(step.loop)];
  Force<double> F[kMost];
  double M[kMost][kMost], b[kMost];
  const double* E[kMost];
  int rates = 0;
  Inertia P;
  Force<double> z;
  for (const EmbeddingStep::BranchBody& at_body : step.branch) {
    const SweepBody& body = model.bodies[at_body.body];
    const Core<double>& core = ws.core(at_body.body);
    Inertia own;
    own_inertia(core, own);
    if (rates == 0)
      P = own, z = ws.z(at_body.body);
    else
      P = P + own, z += ws.z(at_body.body);
    const double* row = k.numbers.data() + c.E + at_body.column * c.width;
    const bool last = body.parent == 0;
    /// h(force): H* of it, rate by rate; column(): P H.
    const auto add = [&](const Force<double>& column, const auto& h, double tau) __attribute__((always_inline)) {
      F[rates] = column, E[rates] = row;
      for (int x = 0; x <= rates; ++x) M[rates][x] = M[x][rates] = h(F[x]);
      b[rates] = h(z) - tau;
      ++rates, row += c.width;
    };
    const auto tau_of = [&](int j) { return in.tau ? in.tau[body.v + j] : 0.0; };
    if (is_axis(body.kind)) {
      const AxisBody& axis = model.axis_bodies[at_body.body];
      const double cosine = ws.cosines[axis.angle], sine = ws.sines[axis.angle];
      for_axis(
          body.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
            add(
                turning_column<I>(P), [](const Force<double>& f) { return at<I>(f.n); }, tau_of(0));
            if (last) return;
            P = inertia_to_inboard<I, TILT>(axis, cosine, sine, P);
            z = force_to_inboard<double, I, TILT>(axis, cosine, sine, z);
            for (int x = 0; x < rates; ++x) F[x] = force_to_inboard<double, I, TILT>(axis, cosine, sine, F[x]);
          });
    } else {
      for (int j = 0; j < body.nv; ++j) {
        const Motion<double> H = hinge_column(model, ws, at_body.body, j);
        add(
            P * H, [&](const Force<double>& f) { return dot(H, f); }, tau_of(j));
      }
      if (last) break;
      const Pose<double>& X = ws.X(at_body.body);
      if (at_body.shifts) {
        P = shift(X.p, P), z.n += cross(X.p, z.f);
        for (int x = 0; x < rates; ++x) F[x].n += cross(X.p, F[x].f);
        continue;
      }
      P = to_inboard(X, P), z = to_inboard(X, z);
      for (int x = 0; x < rates; ++x) F[x] = to_inboard(X, F[x]);
    }
  }
  const int base = model.bodies[step.body].parent;
  if (base > 0) ws.core(base).P += articulated(P);
  Force<double>* Q = base > 0 ? k.Q.data() + step.flows[0].to : nullptr;
  const auto take = [&]<int RATES>() __attribute__((always_inline)) { move_branch<RATES>(c, E, M[0], b, F, z, k, Q); };
  switch (rates) {
    case 2:
      take.template operator()<2>();
      break;
    case 3:
      take.template operator()<3>();
      break;
    case 4:
      take.template operator()<4>();
      break;
    case 5:
      take.template operator()<5>();
      break;
    default:
      take.template operator()<6>();
      break;
  }
  if (base > 0) ws.z(base) += z;
}

/// A rotor behind a gear, folded into its carrier but for its spin.
static inline void take_wheel(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws,
                              EmbeddingWork& k, const Inputs<double>& in) {
  const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(step.loop)];
  const int n = c.n;
  const AxisBody& wheel = model.axis_bodies[step.body];
  Core<double>& carrier = ws.core(wheel.parent);
  const Vec3<double> u = rotor_axis<double>(wheel);
  const double* E = k.numbers.data() + c.E + step.column * c.width;
  double *A = k.numbers.data() + c.A, *b = k.b.data() + c.x;
  const double Ja = wheel.J_axial;
  AxisRecord<double>& record = ws.axis(step.body);
  record.nu = record.load + (in.tau ? in.tau[wheel.v] : 0.0);
  const double moment = Ja * (dot(u, carrier.gamma.w) + E[n]) - record.nu;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) A[i * c.width + j] += Ja * E[i] * E[j];
    b[i] += E[i] * moment;
  }
  ws.z(wheel.parent).n += (Ja * in.v[wheel.v]) * cross(carrier.w, u) + (Ja * E[n]) * u;
  Sym3<double>& J = carrier.P.J;
  J.xx += Ja * u.x * u.x, J.yy += Ja * u.y * u.y, J.zz += Ja * u.z * u.z;
  J.xy += Ja * u.x * u.y, J.xz += Ja * u.x * u.z, J.yz += Ja * u.y * u.z;
  if (step.flows[0].to < 0) return;
  for (int i = 0; i < n; ++i) k.Q[static_cast<std::size_t>(step.flows[0].to + i)].n += (Ja * E[i]) * u;
}

/// A -= V* Y: columns of N numbers (0: of n), flow after flow.
template <int N>
static void subtract_products(const Embedding& e, const EmbeddingStep& step, EmbeddingWork& k, const double* V, const double* Y, int n) {
  const std::size_t flows = step.flows.size();
  const int length = N > 0 ? N : n;
  for (std::size_t f = 0; f < flows; ++f) {
    const int na = e.loops[static_cast<std::size_t>(step.flows[f].loop)].n;
    const double* y = Y;
    for (std::size_t h = f; h < flows; ++h) {
      const int nb = e.loops[static_cast<std::size_t>(step.flows[h].loop)].n;
      const CoordinateBlock& block = step.blocks[f * flows + h];
      for (int i = 0; i < na; ++i) {
        const double *v = V + i * length, *other = y;
        double* entry = k.numbers.data() + block.at + i * block.down;
        for (int j = 0; j < (h == f ? i + 1 : nb); ++j, other += length, entry += block.across) {
          double sum = 0.0;
          for (int l = 0; l < (N > 0 ? N : length); ++l) sum += v[l] * other[l];
          *entry -= sum;
        }
      }
      y += nb * length;
    }
    V += na * length, Y += na * length;
  }
}
/// The same for a hinge of nv rates.
static inline void subtract_products_of_hinge(const Embedding& e, const EmbeddingStep& step, EmbeddingWork& k, const double* V,
                                              const double* Y, int nv) {
  if (nv == 1)
    subtract_products<1>(e, step, k, V, Y, 1);
  else if (nv == 2)
    subtract_products<2>(e, step, k, V, Y, 2);
  else if (nv == 3)
    subtract_products<3>(e, step, k, V, Y, 3);
  else
    subtract_products<0>(e, step, k, V, Y, nv);
}

/// The modes of a body of a general kernel, with coordinates on it: V = Q_e - C* Q, then A -= V* P_ee^-1 V, b += V* nu_e, Q -= P_re P_ee^-1
/// V; P_ee = L D L* is factored, and L^-1 V stays for the way back. False: Workspace::breakdown.
static inline bool take_modes(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws,
                              EmbeddingWork& k, const Inputs<double>& in) {
  Modal<double>& modal = *ws.modal_of(step.body);
  if (!inertia_without_modes(model, ws, step.body, modal)) return false;
  const Force<double> z_r = bias_without_modes(model, ws, in, step.body, modal);
  ws.z(step.body) = z_r;
  const int m = model.bodies[step.body].n_modes;
  if (m == 0) return true;
  int total = 0;
  for (const PendingFlow& flow : step.flows) total += e.loops[static_cast<std::size_t>(flow.loop)].n;
  double *V = k.scratch.data(), *Y = V + total * m;
  for (const PendingFlow& flow : step.flows) {
    const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(flow.loop)];
    for (int i = 0; i < c.n; ++i, V += m, Y += m) {
      Force<double>& q = k.Q[static_cast<std::size_t>(flow.own + i)];
      double* v = k.modal.data() + flow.own_modes + i * m;
      for (int j = 0; modal.C && j < m; ++j) v[j] -= dot(motion_column(modal.C, j), q);
      double sum = 0.0;
      for (int j = 0; j < m; ++j) {
        subtract_multiple(v, modal.P_ee + m * j, v[j], j + 1, m);
        V[j] = v[j], Y[j] = modal.P_ee[m * j + j] * v[j];
        sum += Y[j] * modal.nu[j];
        q -= Y[j] * force_column(modal.U, j);
      }
      k.b[static_cast<std::size_t>(c.x + i)] += sum;
    }
  }
  subtract_products<0>(e, step, k, k.scratch.data(), k.scratch.data() + total * m, m);
  return true;
}

/// Its hinge, likewise, and P, z, Q on their way to the inboard body and to its modes.
template <int NV>
static bool pass_hinge(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws, EmbeddingWork& k,
                       const Inputs<double>& in) {
  const SweepBody& body = model.bodies[step.body];
  if (!inertia_through_hinge<double, NV>(model, ws, step.body)) return false;
  const Force<double> z_r = ws.z(step.body);
  bias_through_hinge<double, NV>(model, ws, in, step.body, z_r);
  const Hinge<double, NV>& hinge = ws.hinge<NV>(step.body);
  const ModalNode<double>* node = ws.modal<NV>(step.body).node;
  double *V = k.scratch.data(), *Y = k.Y.data() + step.Y;
  for (std::size_t f = 0; f < step.flows.size(); ++f) {
    const PendingFlow& flow = step.flows[f];
    const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(flow.loop)];
    for (int i = 0; i < c.n; ++i) {
      Force<double> q = k.Q[static_cast<std::size_t>(flow.own + i)];
      if constexpr (NV > 0) {
        for (int j = 0; j < NV; ++j) V[j] = dot(hinge.H[j], q);
        for (const EmbeddingStep::Couple& couple : step.couples)
          if (couple.flow == static_cast<int>(f)) V[couple.component] -= k.gradients[static_cast<std::size_t>(couple.gradient)];
        for (int j = 0; body.has_prescribed && j < NV; ++j)
          if (model.prescribed[body.v + j]) V[j] = 0.0;
        for (int j = 0; j < NV; ++j) Y[j] = V[j];
        solve_hinge<double, NV>(hinge, Y);
        double sum = 0.0;
        for (int j = 0; j < NV; ++j) sum += V[j] * hinge.nu[j], q -= V[j] * hinge.G[j];
        k.b[static_cast<std::size_t>(c.x + i)] += sum;
        V += NV, Y += NV;
      }
      if (flow.to < 0) continue;
      const Force<double> at_inboard = to_inboard(ws.X(step.body), q);
      k.Q[static_cast<std::size_t>(flow.to + i)] += at_inboard;
      if (flow.to_modes < 0) continue;
      double y[6];
      on_node(*node, at_inboard, y);
      add_to_modes(model.shapes[body.onode].columns.data(), y, body.n_parent_modes,
                   k.modal.data() + flow.to_modes + i * body.n_parent_modes);
    }
  }
  if constexpr (NV > 0) subtract_products<NV>(e, step, k, k.scratch.data(), k.Y.data() + step.Y, NV);
  return true;
}

/// What an eliminated hinge does to pending coordinates on its body: Y = D^-1 V, V = H Q + C, then A -= V* Y, b += V* nu, Q -= G V.
/// visit(Y, V, Q) makes Y from V.
static inline void cross_hinge(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws,
                               EmbeddingWork& k) {
  const SweepBody& body = model.bodies[step.body];
  const int nv = body.kind == BodyKernel::free ? 6 : body.nv;
  const bool free = body.kind == BodyKernel::free;
  double *Y = k.Y.data() + step.Y, *V = k.scratch.data();  // column by column, nv each
  double nu[6] = {};
  double* V0 = V;
  int column = 0;
  const auto solve = [&](const double* v, double* y) {
    for (int i = 0; i < nv; ++i) y[i] = v[i];
    if (free) {
      const double* L = ws.free(step.body).L;
      for (int i = 1; i < 6; ++i)
        for (int j = 0; j < i; ++j) y[i] -= L[i * (i + 1) / 2 + j] * y[j];
      for (int i = 0; i < 6; ++i) y[i] *= L[i * (i + 1) / 2 + i];
      for (int i = 4; i >= 0; --i)
        for (int j = i + 1; j < 6; ++j) y[i] -= L[j * (j + 1) / 2 + i] * y[j];
    } else if (is_axis(body.kind)) {
      y[0] = body.kind == BodyKernel::rotor ? y[0] / model.axis_bodies[step.body].J_axial : y[0] * ws.axis(step.body).inverse_D;
    } else {
      with_hinge_size<double>(nv, [&]<int NV>() {
        if constexpr (NV == 1)
          y[0] /= ws.template hinge<1>(step.body).L[0];
        else if constexpr (NV > 1)
          solve_hinge<double, NV>(ws.template hinge<NV>(step.body), y);
      });
    }
  };
  if (free) {
    const FreeRecord<double>& record = ws.free(step.body);
    const Force<double>& z = record.z;
    const double eps[6] = {record.tau[0] - z.n.x, record.tau[1] - z.n.y, record.tau[2] - z.n.z,
                           record.tau[3] - z.f.x, record.tau[4] - z.f.y, record.tau[5] - z.f.z};
    solve(eps, nu);
  } else if (body.kind == BodyKernel::rotor) {
    const AxisBody& wheel = model.axis_bodies[step.body];
    nu[0] = ws.axis(step.body).nu / wheel.J_axial - dot(rotor_axis<double>(wheel), ws.core(wheel.parent).gamma.w);
  } else if (is_axis(body.kind)) {
    nu[0] = ws.axis(step.body).nu;
  } else {
    with_hinge_size<double>(nv, [&]<int NV>() {
      for (int j = 0; j < NV; ++j) nu[j] = ws.template hinge<NV>(step.body).nu[j];
    });
  }
  for (std::size_t f = 0; f < step.flows.size(); ++f) {
    const PendingFlow& flow = step.flows[f];
    const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(flow.loop)];
    for (int i = 0; i < c.n; ++i, ++column) {
      const Force<double>& q = k.Q[static_cast<std::size_t>(flow.own + i)];
      double* v = V0 + column * nv;
      if (free) {
        v[0] = q.n.x, v[1] = q.n.y, v[2] = q.n.z, v[3] = q.f.x, v[4] = q.f.y, v[5] = q.f.z;
      } else {
        for (int j = 0; j < nv; ++j) v[j] = dot(hinge_column(model, ws, step.body, j), q);
        for (const EmbeddingStep::Couple& couple : step.couples)
          if (couple.flow == static_cast<int>(f)) v[couple.component] -= k.gradients[static_cast<std::size_t>(couple.gradient)];
      }
      solve(v, Y + column * nv);
      double sum = 0.0;
      for (int j = 0; j < nv; ++j) sum += v[j] * nu[j];
      k.b[static_cast<std::size_t>(c.x + i)] += sum;
    }
  }
  subtract_products_of_hinge(e, step, k, V0, Y, nv);
  if (body.parent == 0 || free) return;
  if (body.kind == BodyKernel::rotor) {  // on its carrier: what the reaction of the wheel does not take
    const AxisBody& wheel = model.axis_bodies[step.body];
    column = 0;
    for (const PendingFlow& flow : step.flows)
      for (int i = 0; i < e.loops[static_cast<std::size_t>(flow.loop)].n; ++i, ++column)
        k.Q[static_cast<std::size_t>(flow.to + i)].n -= V0[column] * rotor_axis<double>(wheel);
    return;
  }
  with_way_inboard(
      model, ws, step.body, [&](const auto&, const auto& force) __attribute__((always_inline)) {
        int at_column = 0;
        for (const PendingFlow& flow : step.flows)
          for (int i = 0; i < e.loops[static_cast<std::size_t>(flow.loop)].n; ++i, ++at_column) {
            Force<double> q = k.Q[static_cast<std::size_t>(flow.own + i)];
            const double* v = V0 + at_column * nv;
            if (is_axis(body.kind)) {
              Force<double> G = ws.axis(step.body).G;
              const Vec3<double> axis = model.bodies[step.body].axis;
              G.n = {axis.x != 0.0 ? 1.0 : G.n.x, axis.y != 0.0 ? 1.0 : G.n.y, axis.z != 0.0 ? 1.0 : G.n.z};  // not stored
              q -= v[0] * G;
            } else {
              with_hinge_size<double>(nv, [&]<int NV>() {
                for (int j = 0; j < NV; ++j) q -= v[j] * ws.template hinge<NV>(step.body).G[j];
              });
            }
            k.Q[static_cast<std::size_t>(flow.to + i)] += force(q);
          }
      });
}

/// The coordinates of a loop at home: those that nobody needs are eliminated, those that a later loop has become its.
static inline bool close_at_home(const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws, EmbeddingWork& k) {
  const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(step.loop)];
  const int n = c.n, keep = c.keep, out = n - keep, down = c.width;
  double *A = k.numbers.data() + c.A, *b = k.b.data() + c.x;
  const std::size_t flows = static_cast<std::size_t>(step.coupled), all = step.flows.size();
  const bool ground = step.body == 0;
  ArticulatedInertia<double>& P = step.after_modes ? ws.modal_of(step.body)->P_r : ws.core(step.body).P;
  Force<double>& z = ws.z(step.body);
  Force<double>* Q = ground ? nullptr : k.Q.data() + step.flows[0].own;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < i; ++j) A[j * down + i] = A[i * down + j];
  const double sign = c.by_rates ? 1.0 : -1.0;
  const auto entry_of = [&](std::size_t f, std::size_t h, int i, int j) -> double& {
    const CoordinateBlock& block = step.blocks[f * all + h];
    return k.numbers[static_cast<std::size_t>(block.at + i * block.down + j * block.across)];
  };
  if (out > 0) {
    // Cholesky factor in place of what is eliminated, one over its diagonal, and L^-1 of its rows: Q, what is kept, other loops, b.
    int width = keep + 1;
    for (std::size_t f = 1; f < flows; ++f) width += e.loops[static_cast<std::size_t>(step.flows[f].loop)].n;
    double* rows = k.scratch.data();
    Force<double>* half = k.PU.data();
    for (int i = 0; i < out; ++i) {
      double* row = rows + i * width;
      int x = 0;
      for (int j = 0; j < keep; ++j) row[x++] = A[(keep + i) * down + j];
      for (std::size_t f = 1; f < flows; ++f) {
        const CoordinateBlock& block = step.blocks[f];
        const double* entry = k.numbers.data() + block.at + (keep + i) * block.down;
        const int nb = e.loops[static_cast<std::size_t>(step.flows[f].loop)].n;
        for (int j = 0; j < nb; ++j, entry += block.across) row[x++] = *entry;
      }
      row[x] = b[keep + i];
      if (!ground) half[i] = Q[keep + i];
      double* L = A + (keep + i) * down + keep;
      const double diagonal = sign * L[i];
      double pivot = diagonal;
      for (int j = 0; j < i; ++j) {
        const double* Lj = A + (keep + j) * down + keep;
        double sum = sign * L[j];
        for (int l = 0; l < j; ++l) sum -= L[l] * Lj[l];
        L[j] = sum * Lj[j];
        pivot -= L[j] * L[j];
      }
      const double limit = c.by_rates ? kPivotLimit * diagonal : kWeakCompliance * k.x[static_cast<std::size_t>(c.x + i)];
      if (!(pivot > limit)) {
        ws.breakdown = {step.body > 0 ? step.body : 1, -1, pivot, limit, c.first};
        return false;
      }
      const double inverse = L[i] = 1.0 / std::sqrt(pivot);
      for (int j = 0; j < i; ++j) {
        const double* other = rows + j * width;
        for (int l = 0; l < width; ++l) row[l] -= L[j] * other[l];
        if (!ground) half[i] -= L[j] * half[j];
      }
      for (int l = 0; l < width; ++l) row[l] *= inverse;
      if (!ground) half[i] = inverse * half[i];
    }
    for (int i = 0; i < out; ++i) {
      const double* row = rows + i * width;
      const double right = row[width - 1];
      if (!ground) {
        const Force<double> signed_half = sign * half[i];
        subtract_outer(P, signed_half, half[i]);
        z -= right * signed_half;
      }
      int x0 = 0;
      for (std::size_t f = 0; f < flows; ++f) {
        const int na = f == 0 ? keep : e.loops[static_cast<std::size_t>(step.flows[f].loop)].n;
        double* bf = f == 0 ? b : k.b.data() + e.loops[static_cast<std::size_t>(step.flows[f].loop)].x;
        Force<double>* Qf = ground ? nullptr : k.Q.data() + step.flows[f].own;
        for (int a = 0; a < na; ++a) {
          const double factor = sign * row[x0 + a];
          if (factor == 0.0) continue;
          bf[a] -= factor * right;
          if (!ground) Qf[a] -= factor * half[i];
          const double* y = row + x0;
          for (std::size_t h = f; h < flows; ++h) {
            const int nb = h == 0 ? keep : e.loops[static_cast<std::size_t>(step.flows[h].loop)].n;
            const CoordinateBlock& block = step.blocks[f * all + h];
            double* entry = k.numbers.data() + block.at + a * block.down;
            for (int j = 0; j < (h == f ? a + 1 : nb); ++j, entry += block.across) *entry -= factor * y[j];
            y += nb;
          }
        }
        x0 += na;
      }
    }
    for (int i = 0; i < keep; ++i)
      for (int j = 0; j < i; ++j) A[j * down + i] = A[i * down + j];
  }
  if (keep == 0) return true;
  const EmbeddedLoop& o = e.loops[static_cast<std::size_t>(c.consumer)];
  const double* T = k.numbers.data() + o.T + c.consumer_input * o.width;  // keep rows
  const int stride = o.width;
  std::size_t of = 1;
  while (step.flows[of].loop != c.consumer) ++of;
  const bool coupled = of < flows;  // with who takes them up
  double* bo = k.b.data() + o.x;
  if (k.named[static_cast<std::size_t>(c.consumer)]) {
    // T of ones: the coordinates have other names.
    const int to = c.consumer_input - o.own;
    double* Ao = k.numbers.data() + o.A + to * (o.width + 1);
    for (int i = 0; i < keep; ++i) {
      bo[to + i] += b[i];
      for (int j = 0; j <= i; ++j) Ao[i * o.width + j] += A[i * down + j];
      for (int x = 0; coupled && x < o.n; ++x) {
        const double entry = entry_of(0, of, i, x);
        entry_of(of, of, std::max(to + i, x), std::min(to + i, x)) += x == to + i ? 2.0 * entry : entry;
      }
      for (std::size_t f = 1; f < flows; ++f) {
        if (f == of) continue;
        const int nf = e.loops[static_cast<std::size_t>(step.flows[f].loop)].n;
        for (int j = 0; j < nf; ++j) entry_of(of, f, to + i, j) += entry_of(0, f, i, j);
      }
      if (!ground) k.Q[static_cast<std::size_t>(step.flows[of].own + to + i)] += Q[i];
    }
    return true;
  }
  // S = A_kk T + A_ko, per row of what is kept.
  double* S = k.scratch.data();
  for (int i = 0; i < keep; ++i) {
    double bias = b[i];
    for (int j = 0; j < keep; ++j) bias += A[i * down + j] * T[j * stride + o.n];
    for (int x = 0; x < o.n; ++x) {
      double sum = 0.0;
      for (int j = 0; j < keep; ++j) sum += A[i * down + j] * T[j * stride + x];
      S[i * o.n + x] = sum;
      bo[x] += T[i * stride + x] * bias;
    }
  }
  for (int x = 0; x < o.n; ++x) {
    for (int y = 0; y <= x; ++y) {
      double sum = 0.0;
      for (int i = 0; i < keep; ++i) {
        sum += T[i * stride + x] * S[i * o.n + y];
        if (coupled) sum += T[i * stride + x] * entry_of(0, of, i, y) + entry_of(0, of, i, x) * T[i * stride + y];
      }
      entry_of(of, of, x, y) += sum;
    }
    for (int i = 0; coupled && i < keep; ++i) bo[x] += entry_of(0, of, i, x) * T[i * stride + o.n];
  }
  for (std::size_t f = 1; f < flows; ++f) {
    if (f == of) continue;
    const EmbeddedLoop& other = e.loops[static_cast<std::size_t>(step.flows[f].loop)];
    for (int j = 0; j < other.n; ++j) {
      for (int x = 0; x < o.n; ++x) {
        double sum = 0.0;
        for (int i = 0; i < keep; ++i) sum += T[i * stride + x] * entry_of(0, f, i, j);
        entry_of(of, f, x, j) += sum;
      }
      for (int i = 0; i < keep; ++i) k.b[static_cast<std::size_t>(other.x + j)] += entry_of(0, f, i, j) * T[i * stride + o.n];
    }
  }
  if (ground) return true;
  Force<double>* Qo = k.Q.data() + step.flows[of].own;
  for (int i = 0; i < keep; ++i) {
    z += T[i * stride + o.n] * Q[i];
    for (int x = 0; x < o.n; ++x) Qo[x] += T[i * stride + x] * Q[i];
  }
  return true;
}

/// Tip to base. False: Workspace::breakdown.
static inline bool embedding_inward(const SweepModel& model, const Embedding& e, const Sweeps<double>& S, Workspace<double>& ws,
                                    EmbeddingWork& k, const Inputs<double>& in, const double* given) {
  for (const EmbeddingStep& step : e.steps) {
    switch (step.kind) {
      case EmbeddingStep::Kind::gear:
        if (!take_gears(e, step.begin, step.end, ws, k, in, given)) return false;
        break;
      case EmbeddingStep::Kind::chain:
        if (!take_chains(e, step.begin, step.end, ws, k, in)) return false;
        break;
      case EmbeddingStep::Kind::geared:
        for (int i = step.begin; i < step.end; ++i)
          if (!take_geared(model, e, e.geared[static_cast<std::size_t>(i)], ws, k, in)) return false;
        break;
      case EmbeddingStep::Kind::sweep:
      case EmbeddingStep::Kind::cross: {
        const Run run{step.begin, step.end, model.runs[step.run].kind, model.runs[step.run].prescribed};
        S.inward(model, ws, in, run, {});
        if (ws.breakdown.body != 0) return false;
        if (step.kind == EmbeddingStep::Kind::cross) cross_hinge(model, e, step, ws, k);
        break;
      }
      case EmbeddingStep::Kind::item:
        take_item(model, e, step, ws, k, in);
        break;
      case EmbeddingStep::Kind::branch:
        if (step.rigid)
          take_branch<RigidInertia<double>>(model, e, step, ws, k, in);
        else
          take_branch<ArticulatedInertia<double>>(model, e, step, ws, k, in);
        break;
      case EmbeddingStep::Kind::wheel:
        take_wheel(model, e, step, ws, k, in);
        break;
      case EmbeddingStep::Kind::modes:
        if (!take_modes(model, e, step, ws, k, in)) return false;
        break;
      case EmbeddingStep::Kind::hinge: {
        bool passed = false;
        with_hinge_size<double>(model.bodies[step.body].nv, [&]<int NV>() { passed = pass_hinge<NV>(model, e, step, ws, k, in); });
        if (!passed) return false;
        break;
      }
      case EmbeddingStep::Kind::close:
        if (!close_at_home(e, step, ws, k)) return false;
        break;
    }
  }
  return true;
}

/// What an eliminated hinge has of pending coordinates, once they are known.
static inline void uncross_hinge(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws,
                                 EmbeddingWork& k, const Inputs<double>& in, double* vdot) {
  const SweepBody& body = model.bodies[step.body];
  const bool free = body.kind == BodyKernel::free;
  const int nv = free ? 6 : body.nv;
  double less[6] = {};
  const double* Y = k.Y.data() + step.Y;
  for (const PendingFlow& flow : step.flows) {
    const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(flow.loop)];
    for (int i = 0; i < c.n; ++i, Y += nv)
      for (int j = 0; j < nv; ++j) less[j] += Y[j] * k.x[static_cast<std::size_t>(c.x + i)];
  }
  Core<double>& core = ws.core(step.body);
  double* out = vdot + body.v;
  if (free) {
    const Motion<double> d{{less[0], less[1], less[2]}, {less[3], less[4], less[5]}};
    core.delta -= d;
    const Vec3<double> linear = body.shape == CARDAN_SHAPE_FREE ? free_rotation(body, in.q) * d.v : d.v;
    out[0] -= d.w.x, out[1] -= d.w.y, out[2] -= d.w.z;
    out[3] -= linear.x, out[4] -= linear.y, out[5] -= linear.z;
    return;
  }
  for (int j = 0; j < nv; ++j) {
    out[j] -= less[j];
    if (body.kind != BodyKernel::rotor) core.delta -= less[j] * hinge_column(model, ws, step.body, j);
  }
}

/// The hinge of a body of a general kernel, and its modes, once the coordinates on it are known.
template <int NV>
static void pass_hinge_outward(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws,
                               EmbeddingWork& k, const Inputs<double>& in, double* vdot) {
  if constexpr (NV > 0) {
    Hinge<double, NV>& hinge = ws.hinge<NV>(step.body);
    const double* Y = k.Y.data() + step.Y;
    for (const PendingFlow& flow : step.flows) {
      const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(flow.loop)];
      for (int i = 0; i < c.n; ++i, Y += NV)
        for (int j = 0; j < NV; ++j) hinge.nu[j] -= Y[j] * k.x[static_cast<std::size_t>(c.x + i)];
    }
  }
  acceleration_through_hinge<double, NV>(model, ws, in, vdot, step.body);
}
static inline void modes_outward(const SweepModel& model, const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws,
                                 EmbeddingWork& k, const Inputs<double>& in, double* vdot) {
  Modal<double>& modal = *ws.modal_of(step.body);
  const int m = model.bodies[step.body].n_modes;
  for (const PendingFlow& flow : step.flows) {
    const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(flow.loop)];
    for (int i = 0; m > 0 && i < c.n; ++i)
      subtract_multiple(modal.nu, k.modal.data() + flow.own_modes + i * m, k.x[static_cast<std::size_t>(c.x + i)], 0, m);
  }
  acceleration_with_modes(model, ws, in, vdot, step.body, modal);
}

/// The rates of a body that a loop has taken up, its coordinates being known, and delta of the body.
static inline void item_outward(const SweepModel& model, const EmbeddedLoop& c, int k_body, int column, bool shifts, Workspace<double>& ws,
                                const EmbeddingWork& k, const Inputs<double>& in, double* vdot) {
  const SweepBody& body = model.bodies[k_body];
  const double *E = k.numbers.data() + c.E + column * c.width, *x = k.x.data() + c.x;
  double* out = vdot + body.v;
  for (int j = 0; j < body.nv; ++j, E += c.width) {
    double sum = E[c.n];
    for (int i = 0; i < c.n; ++i) sum += E[i] * x[i];
    out[j] = sum;
  }
  if (body.kind == BodyKernel::rotor) return;
  Core<double>& core = ws.core(k_body);
  const Motion<double>& inboard = ws.core(body.parent).delta;
  if (is_axis(body.kind)) {
    const AxisBody& b = model.axis_bodies[k_body];
    for_axis(
        body.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          Motion<double> d = motion_to_outboard<double, I, TILT>(b, ws.cosines[b.angle], ws.sines[b.angle], inboard);
          at<I>(d.w) = at<I>(d.w) + out[0];
          core.delta = d;
        });
    return;
  }
  if (shifts) {
    core.delta = {inboard.w, inboard.v + cross(inboard.w, ws.X(k_body).p) + out[0] * body.axis};
    return;
  }
  Motion<double> d = to_outboard(ws.X(k_body), inboard);
  for (int j = 0; j < body.nv; ++j) d += out[j] * hinge_column(model, ws, k_body, j);
  core.delta = d;
  for (int j = 0; body.has_prescribed && j < body.nv; ++j)
    if (model.prescribed[body.v + j]) out[j] = in.vdot[body.v + j];  // inside gamma_b
}

/// The coordinates of a loop, delta of its home being known.
CARDAN_INLINE void solve_at_home(const Embedding& e, const EmbeddingStep& step, Workspace<double>& ws, EmbeddingWork& k) {
  const EmbeddedLoop& c = e.loops[static_cast<std::size_t>(step.loop)];
  const int n = c.n, keep = c.keep;
  double* x = k.x.data() + c.x;
  const double *A = k.numbers.data() + c.A, *b = k.b.data() + c.x;
  if (keep > 0) {
    const EmbeddedLoop& o = e.loops[static_cast<std::size_t>(c.consumer)];
    const double *T = k.numbers.data() + o.T + c.consumer_input * o.width, *xo = k.x.data() + o.x;
    const bool named = k.named[static_cast<std::size_t>(c.consumer)] != 0;
    for (int i = 0; named && i < keep; ++i) x[i] = xo[c.consumer_input - o.own + i];
    for (int i = 0; !named && i < keep; ++i, T += o.width) {
      x[i] = T[o.n];
      for (int j = 0; j < o.n; ++j) x[i] += T[j] * xo[j];
    }
  }
  const double sign = c.by_rates ? 1.0 : -1.0;
  for (int i = keep; i < n; ++i) {
    double right = b[i];
    for (int j = 0; j < keep; ++j) right += A[i * c.width + j] * x[j];
    for (std::size_t f = 1; f < static_cast<std::size_t>(step.coupled); ++f) {
      const EmbeddedLoop& other = e.loops[static_cast<std::size_t>(step.flows[f].loop)];
      const CoordinateBlock& block = step.blocks[f];
      const double *entry = k.numbers.data() + block.at + i * block.down, *of_other = k.x.data() + other.x;
      for (int j = 0; j < other.n; ++j, entry += block.across) right += *entry * of_other[j];
    }
    if (step.body > 0) right += dot(ws.core(step.body).delta, k.Q[static_cast<std::size_t>(step.flows[0].own + i)]);
    x[i] = -sign * right;
    for (int j = keep; j < i; ++j) x[i] -= A[i * c.width + j] * x[j];
    x[i] *= A[i * c.width + i];
  }
  for (int i = n - 1; i >= keep; --i) {
    for (int j = i + 1; j < n; ++j) x[i] -= A[j * c.width + i] * x[j];
    x[i] *= A[i * c.width + i];
  }
}

/// Base to tip.
static inline void embedding_outward(const SweepModel& model, const Embedding& e, const Sweeps<double>& S, Workspace<double>& ws,
                                     EmbeddingWork& k, const Inputs<double>& in, const double* given, double* vdot) {
  for (auto at_step = e.steps.rbegin(); at_step != e.steps.rend(); ++at_step) {
    const EmbeddingStep& step = *at_step;
    switch (step.kind) {
      case EmbeddingStep::Kind::gear:
        gears_outward(e, step.begin, step.end, ws, k, in, given, vdot);
        break;
      case EmbeddingStep::Kind::chain:
        chains_outward(e, step.begin, step.end, ws, k, vdot);
        break;
      case EmbeddingStep::Kind::geared:
        for (int i = step.end; i-- > step.begin;) geared_outward(model, e, e.geared[static_cast<std::size_t>(i)], ws, k, vdot);
        break;
      case EmbeddingStep::Kind::sweep:
      case EmbeddingStep::Kind::cross: {
        const Run run{step.begin, step.end, model.runs[step.run].kind, model.runs[step.run].prescribed};
        S.acceleration(model, ws, in, run, vdot);
        if (step.kind == EmbeddingStep::Kind::cross) uncross_hinge(model, e, step, ws, k, in, vdot);
        break;
      }
      case EmbeddingStep::Kind::item:
      case EmbeddingStep::Kind::wheel:
        item_outward(model, e.loops[static_cast<std::size_t>(step.loop)], step.body, step.column, false, ws, k, in, vdot);
        break;
      case EmbeddingStep::Kind::branch:
        for (auto b = step.branch.rbegin(); b != step.branch.rend(); ++b)
          item_outward(model, e.loops[static_cast<std::size_t>(step.loop)], b->body, b->column, b->shifts, ws, k, in, vdot);
        break;
      case EmbeddingStep::Kind::modes:
        modes_outward(model, e, step, ws, k, in, vdot);
        break;
      case EmbeddingStep::Kind::hinge:
        with_hinge_size<double>(model.bodies[step.body].nv, [&]<int NV>() { pass_hinge_outward<NV>(model, e, step, ws, k, in, vdot); });
        break;
      case EmbeddingStep::Kind::close:
        solve_at_home(e, step, ws, k);
        break;
    }
  }
}

/// v' of closed loops from poses, gamma_b, z and P of all bodies. 0: done; 1: the rank has changed or rows contradict each other, and
/// nothing was changed; 2: Workspace::breakdown.
static inline int embedding(const SweepModel& model, const Embedding& e, const Sweeps<double>& S, Workspace<double>& ws, EmbeddingWork& k,
                            const Inputs<double>& in, const RowsOfHinges& hinges, const double* given, double* vdot) {
  if (!embedding_kinematics(model, e, ws, k, in, hinges, given)) return 1;
  if (!embedding_inward(model, e, S, ws, k, in, given)) return 2;
  embedding_outward(model, e, S, ws, k, in, given, vdot);
  return 0;
}

}  // namespace cardan::soa
