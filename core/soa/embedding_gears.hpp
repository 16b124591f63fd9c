#pragma once
// Wheels that turn with hinges, in the sweeps (core/model/gears.hpp; docs/mathematics/loops.md, 4): one beside its hinge, and those of
// transmissions, which are coordinates of the bodies between their outermost hinge and their carrier.
#include <cmath>

#include "core/soa/embedding_work.hpp"
#include "core/soa/kernels_axis.hpp"
#include "core/soa/sincos.hpp"

namespace cardan::soa {

/// Phi P Phi* of a body that turns about an axis of its own: as P+ in inward_axis, with the row of the axis.
template <int I, Tilt TILT>
CARDAN_INLINE ArticulatedInertia<double> inertia_to_inboard(const AxisBody& b, double c, double s, ArticulatedInertia<double> P) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  turn<I>(P.J, c, s);
  turn<I>(P.B, c, s);
  turn<I>(P.M, c, s);
  const double lj = b.l[0], lk = b.l[1];
  const double mii = entry<I, I>(P.M), mij = entry<I, J>(P.M), mik = entry<I, K>(P.M), mjj = entry<J, J>(P.M), mjk = entry<J, K>(P.M),
               mkk = entry<K, K>(P.M);
  const double bii = entry<I, I>(P.B), bij = entry<I, J>(P.B), bik = entry<I, K>(P.B), bji = entry<J, I>(P.B), bki = entry<K, I>(P.B);
  const double cij = bij + (lj * mjk - lk * mjj), cik = bik + (lj * mkk - lk * mjk);
  const double cji = bji + lk * mii, cjj = entry<J, J>(P.B) + lk * mij, cjk = entry<J, K>(P.B) + lk * mik;
  const double cki = bki - lj * mii, ckj = entry<K, J>(P.B) - lj * mij, ckk = entry<K, K>(P.B) - lj * mik;
  ArticulatedInertia<double> Q;
  entry<I, I>(Q.B) = bii + (lj * mik - lk * mij), entry<I, J>(Q.B) = cij, entry<I, K>(Q.B) = cik;
  entry<J, I>(Q.B) = cji, entry<J, J>(Q.B) = cjj, entry<J, K>(Q.B) = cjk;
  entry<K, I>(Q.B) = cki, entry<K, J>(Q.B) = ckj, entry<K, K>(Q.B) = ckk;
  entry<I, I>(Q.J) = entry<I, I>(P.J) + (lj * (cik + bik) - lk * (cij + bij));
  entry<I, J>(Q.J) = entry<I, J>(P.J) + (lj * cjk + lk * (bii - cjj));
  entry<I, K>(Q.J) = entry<I, K>(P.J) + (lj * (ckk - bii) - lk * ckj);
  entry<J, J>(Q.J) = entry<J, J>(P.J) + lk * (cji + bji);
  entry<K, K>(Q.J) = entry<K, K>(P.J) - lj * (cki + bki);
  entry<J, K>(Q.J) = entry<J, K>(P.J) - lj * cji + lk * bki;
  Q.M = P.M;
  if constexpr (TILT != Tilt::none) {
    tilt<TILT, double>(b, Q.J);
    tilt<TILT, double>(b, Q.B);
    tilt<TILT, double>(b, Q.M);
  }
  return Q;
}

/// Copies number by number: what was stored narrow is not loaded wide, which would wait for the stores.
CARDAN_INLINE void set_apart(Force<double>& to, const Force<double>& f) {
  to.n.x = f.n.x, to.n.y = f.n.y, to.n.z = f.n.z;
  to.f.x = f.f.x, to.f.y = f.f.y, to.f.z = f.f.z;
}
CARDAN_INLINE Force<double> apart(const Force<double>& f) { return {{f.n.x, f.n.y, f.n.z}, {f.f.x, f.f.y, f.f.z}}; }

/// What G v' of a gear is to be: as `given` says, else by its drive.
static inline double wanted_of(const Gear& gear, const Inputs<double>& in, const double* given) {
  return given ? given[gear.row] : gear.drive >= 0 && in.drives ? in.drives[gear.drive].acceleration : 0.0;
}

/// A hinge with the wheel that turns with it about its axis, v'_w = r v' + t (u = +-e_i; r and v_w with that sign): a moment along the axis
/// is the same on the carrier and on the body, so that D = P_ii + r^2 Ja, V = P e_i + r Ja e_i, and what the carrier feels of both is
/// P + Ja e_i e_i* - V D^-1 V*, z + V nu + Ja t e_i + Ja v_w (w x e_i), shifted as that of any body. AxisRecord: nu, and all of G = V D^-1.
CARDAN_INLINE bool take_gear(const SweepModel& model, const Gear& gear, Workspace<double>& ws, const Inputs<double>& in,
                             const double* given) {
  const AxisBody& b = model.axis_bodies[gear.body];
  Core<double>& core = ws.core(gear.body);
  AxisRecord<double>& record = ws.axis(gear.body);
  const double Ja = gear.J_axial, lag = gear.sense * Ja * gear.per_slope * wanted_of(gear, in, given);
  const double moment = gear.sense * (ws.axis(gear.wheel).load + (in.tau ? in.tau[gear.v] : 0.0)) - lag;
  return for_axis(
      b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
        constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
        ArticulatedInertia<double> P = core.P;
        const double D = entry<I, I>(P.J) + gear.reflected, size = P.J.xx + P.J.yy + P.J.zz;
        if (!(D > kPivotLimit * size)) {
          ws.breakdown = {gear.body, 0, D, kPivotLimit * size};
          return false;
        }
        const double inverse = 1.0 / D;
        Force<double> V;
        at<I>(V.n) = entry<I, I>(P.J) + gear.coupled, at<J>(V.n) = entry<I, J>(P.J), at<K>(V.n) = entry<I, K>(P.J);
        V.f = {entry<I, 0>(P.B), entry<I, 1>(P.B), entry<I, 2>(P.B)};
        const Force<double> G = inverse * V;
        Force<double> z = apart(ws.z(gear.body));
        const double tau = in.tau ? in.tau[b.v] : 0.0, spin = gear.sense * Ja * in.v[gear.v];
        const double eps = tau - at<I>(z.n) + gear.ratio * moment - gear.coupled * at<I>(core.gamma.w);
        record.nu = inverse * eps;
        set_apart(record.G, G);
        entry<I, I>(P.J) += Ja;
        subtract_outer(P, V, G);
        z += eps * G;
        at<I>(z.n) += lag;
        at<J>(z.n) += spin * at<K>(core.w);
        at<K>(z.n) -= spin * at<J>(core.w);
        const double c = ws.cosines[b.angle], s = ws.sines[b.angle];
        ws.core(b.parent).P += inertia_to_inboard<I, TILT>(b, c, s, P);
        ws.z(b.parent) += force_to_inboard<double, I, TILT>(b, c, s, z);
        return true;
      });
}
CARDAN_INLINE void gear_outward(const SweepModel& model, const Gear& gear, Workspace<double>& ws, const Inputs<double>& in,
                                const double* given, double* vdot) {
  const AxisBody& b = model.axis_bodies[gear.body];
  const AxisRecord<double>& record = ws.axis(gear.body);
  for_axis(
      b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
        Motion<double> d = motion_to_outboard<double, I, TILT>(b, ws.cosines[b.angle], ws.sines[b.angle], ws.core(b.parent).delta);
        const double rate = record.nu - dot(d.w, record.G.n) - dot(d.v, record.G.f);
        at<I>(d.w) += rate;
        ws.core(gear.body).delta = d;
        vdot[b.v] = rate;
        vdot[gear.v] = gear.sense * gear.ratio * rate + gear.per_slope * wanted_of(gear, in, given);
      });
}

static bool take_gears(const SweepModel& model, const Gear* begin, const Gear* end, Workspace<double>& ws, const Inputs<double>& in,
                       const double* given) {
  for (const Gear* gear = begin; gear < end; ++gear)
    if (!take_gear(model, *gear, ws, in, given)) return false;
  return true;
}
static void gears_outward(const SweepModel& model, const Gear* begin, const Gear* end, Workspace<double>& ws, const Inputs<double>& in,
                          const double* given, double* vdot) {
  for (const Gear* gear = end; gear > begin;) gear_outward(model, *--gear, ws, in, given, vdot);
}

/// Angles of the sines and cosines of a coupling, and their rates.
static inline void angles_of(const Coupling& c, const Sinusoids& sinusoids, const double* q, const double* v, double* x, double* rate) {
  static_assert(Sinusoids::kSide == 4);
  const double *a = sinusoids.numbers.data(), *end = a + sinusoids.numbers.size();
  for (; a < end; x += 4, rate += 4) {
    a += 8;
    Four angle{}, speed{};
    for (const CoupledRate& term : c.terms) angle += q[term.q] * four(a), speed += v[term.v] * four(a), a += 4;
    four(x) = angle, four(rate) = speed;
  }
}

/// What c'' has without v', and the gradient, as Coupling::at: of sines, cosines and rates as angles_of() has them. Slopes by the angles
/// take the place of the sines.
static inline double slopes_of(const Coupling& c, const Sinusoids& sinusoids, const Inputs<double>& in, double* sine, const double* cosine,
                               const double* rate, double* gradient) {
  const std::size_t terms = c.terms.size(), block = 4 * (2 + terms);
  double extra = 0.0;
  for (std::size_t i = 0; i < terms; ++i) gradient[i] = c.terms[i].coefficient;
  for (const int f : sinusoids.others) {
    const Coupling::Function& function = c.functions[static_cast<std::size_t>(f)];
    double x = function.phase, speed = 0.0;
    for (const Coupling::Function::Argument& u : function.of) {
      const CoupledRate& term = c.terms[static_cast<std::size_t>(u.term)];
      x += u.a * in.q[term.q], speed += u.a * in.v[term.v];
    }
    const SmoothFunction::Jet F = function.F.at(x);
    extra += F.curvature * speed * speed;
    for (const Coupling::Function::Argument& u : function.of) gradient[static_cast<std::size_t>(u.term)] += F.slope * u.a;
  }
  const double *begin = sinusoids.numbers.data(), *end = begin + sinusoids.numbers.size();
  if (begin == end) return extra;
  const auto sum = [](const Four& x) { return (x[0] + x[2]) + (x[1] + x[3]); };
  Four curved{};
  double* slope = sine;
  for (const double* S = begin; S < end; S += block, slope += 4, cosine += 4, rate += 4) {
    const Four s = four(slope), k = four(cosine), speed = four(rate);
    curved += (four(S) * s + four(S + 4) * k) * speed * speed;
    four(slope) = four(S) * k - four(S + 4) * s;
  }
  for (std::size_t t = 0; t < terms; ++t) {
    Four part{};
    slope = sine;
    for (const double* a = begin + 8 + 4 * t; a < end; a += block, slope += 4) part += four(slope) * four(a);
    gradient[t] += sum(part);
  }
  return extra - sum(curved);
}

/// R and t of a transmission of N wheels (0: any number): with G_w and G_h its slopes on wheels and hinges, R = -G_w^-1 G_h,
/// t = G_w^-1 (what G v' is to be). False: wheels near a dead centre of their hinges.
template <int N>
static bool find_ratios(const Transmission& t, EmbeddingWork& k, const Inputs<double>& in, const double* given) {
  constexpr int kMost = N > 0 ? N : GearedHinge::kMost;
  const int n = N > 0 ? N : static_cast<int>(t.wheels.size()), along = static_cast<int>(t.way.size());
  double *R = k.ratios.data() + t.numbers, *bias = R + n * along, *inverse = bias + n;
  double slopes[kMost * kMost], wanted[kMost];
  double *hinges = k.scratch.data(), *gradient = hinges + n * along;  // n x along; per term
  for (int i = 0; i < n; ++i) {
    const Transmission::Row& row = t.rows[static_cast<std::size_t>(i)];
    const double extra = slopes_of(row.coupling, row.sinusoids, in, k.sines.data() + row.angles, k.cosines.data() + row.angles,
                                   k.rates.data() + row.angles, gradient);
    for (int j = 0; j < n; ++j) slopes[i * n + j] = 0.0, inverse[i * n + j] = i == j ? 1.0 : 0.0;
    for (int j = 0; j < along; ++j) hinges[i * along + j] = 0.0;
    for (std::size_t j = 0; j < row.column.size(); ++j) {
      const int column = row.column[j];
      (column < n ? slopes[i * n + column] : hinges[i * along + column - n]) += gradient[j];
    }
    wanted[i] = given ? given[row.row] : (row.drive >= 0 && in.drives ? in.drives[row.drive].acceleration : 0.0) - extra;
  }
  for (int p = 0; p < n; ++p) {
    int best = p;
    for (int i = p + 1; i < n; ++i)
      if (std::abs(slopes[i * n + p]) > std::abs(slopes[best * n + p])) best = i;
    for (int j = 0; best != p && j < n; ++j) {
      const double slope = slopes[p * n + j], entry = inverse[p * n + j];
      slopes[p * n + j] = slopes[best * n + j], inverse[p * n + j] = inverse[best * n + j];
      slopes[best * n + j] = slope, inverse[best * n + j] = entry;
    }
    const double scale = 1.0 / slopes[p * n + p];
    for (int j = 0; j < n; ++j) slopes[p * n + j] *= scale, inverse[p * n + j] *= scale;
    for (int i = 0; i < n; ++i) {
      if (i == p) continue;
      const double factor = slopes[i * n + p];
      for (int j = 0; j < n; ++j) slopes[i * n + j] -= factor * slopes[p * n + j], inverse[i * n + j] -= factor * inverse[p * n + j];
    }
  }
  bool far = true;
  for (int i = 0; i < n; ++i) {
    bias[i] = 0.0;
    for (int l = 0; l < n; ++l) bias[i] += inverse[i * n + l] * wanted[l];
    for (int j = 0; j < along; ++j) {
      double sum = 0.0;
      for (int l = 0; l < n; ++l) sum -= inverse[i * n + l] * hinges[l * along + j];
      R[i * along + j] = sum;
      far = far && std::abs(sum) <= t.steepest[static_cast<std::size_t>(i * along + j)];
    }
  }
  return far;
}
/// Many at once, whatever the options of the file are (core/CMakeLists.txt).
#ifndef __clang__
[[gnu::optimize("tree-vectorize")]]
#endif
static void
sines_of_couplings(EmbeddingWork& k) {
  sine_cosine(k.angles.data(), k.sines.data(), k.cosines.data(), k.angles.size());
}
static inline bool find_ratios(const Embedding& e, EmbeddingWork& k, const Inputs<double>& in, const double* given) {
  if (!k.angles.empty()) {
    for (const Transmission& t : e.transmissions)
      for (const Transmission::Row& row : t.rows)
        angles_of(row.coupling, row.sinusoids, in.q, in.v, k.angles.data() + row.angles, k.rates.data() + row.angles);
    sines_of_couplings(k);
  }
  for (std::size_t i = 0; i < e.transmissions.size(); ++i) {
    if (k.turns_known[i] && !given) continue;
    const Transmission& t = e.transmissions[i];
    const std::size_t n = t.wheels.size();
    if (!(n == 1 ? find_ratios<1>(t, k, in, given) : n == 2 ? find_ratios<2>(t, k, in, given) : find_ratios<0>(t, k, in, given)))
      return false;
    k.turns_known[i] = e.transmissions[i].constant && !given;
  }
  return true;
}

/// P times a unit rate about axis I.
template <int I>
CARDAN_INLINE Force<double> turning_column(const ArticulatedInertia<double>& P) {
  if constexpr (I == 0)
    return {{P.J.xx, P.J.xy, P.J.xz}, {P.B.xx, P.B.xy, P.B.xz}};
  else if constexpr (I == 1)
    return {{P.J.xy, P.J.yy, P.J.yz}, {P.B.yx, P.B.yy, P.B.yz}};
  else
    return {{P.J.xz, P.J.yz, P.J.zz}, {P.B.zx, P.B.zy, P.B.zz}};
}

/// What a wheel lacks where its rate is zero: Ja u* gamma - tau; taken from its carrier, which has its inertia.
static inline double take_moment(const TurningWheel& wheel, Workspace<double>& ws, const Inputs<double>& in) {
  const double tau = in.tau ? in.tau[wheel.v] : 0.0;
  if (wheel.on_ground) {
    const Vec3<double>& own = ws.z(wheel.body).n;
    return (wheel.on_ground == 1 ? own.x : wheel.on_ground == 2 ? own.y : own.z) - tau;
  }
  const Core<double>& carrier = ws.core(wheel.carrier);
  const double moment = wheel.J_axial * dot(wheel.u, carrier.gamma.w) - ws.axis(wheel.body).load - tau;
  ws.z(wheel.carrier).n += (wheel.J_axial * in.v[wheel.v]) * cross(carrier.w, wheel.u) - moment * wheel.u;
  return moment;
}

/// delta of a wheel that is a body on the ground.
static inline void turn_on_ground(const TurningWheel& wheel, double rate, Workspace<double>& ws) {
  Motion<double>& d = ws.core(wheel.body).delta;
  d = {};
  (wheel.on_ground == 1 ? d.w.x : wheel.on_ground == 2 ? d.w.y : d.w.z) = rate;
}

/// M hinges of a chain from a carrier and the wheels on it that turn with them, v'_w = R v' + t. With the composite inertia P of the chain
/// at the carrier, F_i = Phi P H_i*, M_ij = H_i Phi P H_j* and of each wheel b = (what it lacks) + Ja t:
///     D = M + R* Ja R,   F += u Ja R,   eps = tau - H z - R* b,   v' = D^-1 (eps - F* delta)
///     P_A += P + u Ja u* - F D^-1 F*,   z_A += z + u b + F D^-1 eps
/// D = L d L*, the outermost hinge first.
template <int M>
static bool take_chain(const SweepModel& model, const Embedding& e, const GearedChain& chain, ChainRecord& record, Workspace<double>& ws,
                       EmbeddingWork& k, const Inputs<double>& in) {
  Force<double> F[M];
  double D[M][M], eps[M], size[M];
  ArticulatedInertia<double> P = ws.core(chain.hinges[0]).P;
  Force<double> z = apart(ws.z(chain.hinges[0]));
  for (int x = 0; x < M; ++x) {
    const AxisBody& b = model.axis_bodies[chain.hinges[static_cast<std::size_t>(x)]];
    const double cosine = ws.cosines[b.angle], sine = ws.sines[b.angle], tau = in.tau ? in.tau[b.v] : 0.0;
    for_axis(
        b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          F[x] = turning_column<I>(P);
          for (int y = 0; y <= x; ++y) D[x][y] = at<I>(F[y].n);
          eps[x] = tau - at<I>(z.n), size[x] = P.J.xx + P.J.yy + P.J.zz;
          P = inertia_to_inboard<I, TILT>(b, cosine, sine, P);
          z = force_to_inboard<double, I, TILT>(b, cosine, sine, z);
          for (int y = 0; y <= x; ++y) F[y] = force_to_inboard<double, I, TILT>(b, cosine, sine, F[y]);
        });
    P += ws.core(b.parent).P;  // in the end of the carrier
    if (x + 1 < M) z += ws.z(b.parent);
  }
  for (const GearedChain::Wheel& turns : chain.wheels) {
    const TurningWheel& wheel = e.wheels[static_cast<std::size_t>(turns.wheel)];
    const Vec3<double>& u = wheel.u;
    const double Ja = wheel.J_axial, bias = take_moment(wheel, ws, in) + Ja * k.ratios[static_cast<std::size_t>(wheel.t)];
    double R[M];
    for (int x = 0; x < M; ++x) {
      R[x] = turns.ratio[x] < 0 ? 0.0 : k.ratios[static_cast<std::size_t>(turns.ratio[x])];
      eps[x] -= R[x] * bias;
      for (int y = 0; y <= x; ++y) D[x][y] += Ja * R[x] * R[y];
      F[x].n += (Ja * R[x]) * u;
    }
    P.J.xx += Ja * u.x * u.x, P.J.yy += Ja * u.y * u.y, P.J.zz += Ja * u.z * u.z;
    P.J.xy += Ja * u.x * u.y, P.J.xz += Ja * u.x * u.z, P.J.yz += Ja * u.y * u.z;
    z.n += bias * u;
  }
  for (int x = 0; x < M; ++x) {
    for (int y = 0; y < x; ++y) {
      double* L = record.L[x];
      L[y] = D[x][y] / D[y][y];
      F[x] -= L[y] * F[y], eps[x] -= L[y] * eps[y];
      for (int i = x; i < M; ++i) D[i][x] -= L[y] * D[i][y];
    }
    if (!(D[x][x] > kPivotLimit * size[x])) {
      ws.breakdown = {chain.hinges[static_cast<std::size_t>(x)], 0, D[x][x], kPivotLimit * size[x]};
      return false;
    }
    const double inverse = 1.0 / D[x][x];
    const Force<double> G = inverse * F[x];
    record.nu[x] = inverse * eps[x];
    set_apart(record.G[x], G);
    subtract_outer(P, F[x], G);
    z += eps[x] * G;
  }
  ws.core(chain.carrier).P = P;
  ws.z(chain.carrier) += z;
  return true;
}
static inline bool take_chain(const SweepModel& model, const Embedding& e, int number, Workspace<double>& ws, EmbeddingWork& k,
                              const Inputs<double>& in) {
  const GearedChain& chain = e.chains[static_cast<std::size_t>(number)];
  ChainRecord& record = k.chains[static_cast<std::size_t>(number)];
  switch (chain.hinges.size()) {
    case 1:
      return take_chain<1>(model, e, chain, record, ws, k, in);
    case 2:
      return take_chain<2>(model, e, chain, record, ws, k, in);
    default:
      return take_chain<3>(model, e, chain, record, ws, k, in);
  }
}

/// v' of its hinges, delta of its bodies, and the rates of its wheels.
static inline void chain_outward(const SweepModel& model, const Embedding& e, int number, Workspace<double>& ws, EmbeddingWork& k,
                                 double* vdot) {
  const GearedChain& chain = e.chains[static_cast<std::size_t>(number)];
  const ChainRecord& record = k.chains[static_cast<std::size_t>(number)];
  const int m = static_cast<int>(chain.hinges.size());
  double rates[GearedChain::kMost];
  Motion<double> d = ws.core(chain.carrier).delta;
  for (int x = m - 1; x >= 0; --x) {
    rates[x] = record.nu[x] - dot(d, record.G[x]);
    for (int y = x + 1; y < m; ++y) rates[x] -= record.L[y][x] * rates[y];
  }
  for (int x = m - 1; x >= 0; --x) {
    const AxisBody& b = model.axis_bodies[chain.hinges[static_cast<std::size_t>(x)]];
    for_axis(
        b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          d = motion_to_outboard<double, I, TILT>(b, ws.cosines[b.angle], ws.sines[b.angle], d);
          at<I>(d.w) += rates[x];
        });
    ws.core(chain.hinges[static_cast<std::size_t>(x)]).delta = d;
    vdot[b.v] = rates[x];
  }
  for (const GearedChain::Wheel& turns : chain.wheels) {
    const TurningWheel& wheel = e.wheels[static_cast<std::size_t>(turns.wheel)];
    double rate = k.ratios[static_cast<std::size_t>(wheel.t)];
    for (int x = 0; x < m; ++x)
      if (turns.ratio[x] >= 0) rate += k.ratios[static_cast<std::size_t>(turns.ratio[x])] * rates[x];
    vdot[wheel.v] = rate;
    if (wheel.on_ground) turn_on_ground(wheel, rate, ws);
  }
}

/// A hinge that N wheels (0: any number) turn with, s of each on what is inboard of the hinge, s + R v' on its body. With H = e_i, and of
/// the wheels Q, A, b as of coordinates of a loop on this body:
///     c = H Q + A R,   D = H P H* + R* (H Q + c),   V = P H* + Q R,   nu = (tau - H z - R* b) / D
///     P -= V V* / D,   Q -= V c* / D,   A -= c c* / D,   z += V nu,   b += c nu
/// On the carrier s = u* delta: P += Q u* + u Q* + u A u*, z += u b, for what ends there; others stay.
template <int N>
static bool take_geared(const SweepModel& model, const Embedding& e, const GearedHinge& hinge, Workspace<double>& ws, EmbeddingWork& k,
                        const Inputs<double>& in) {
  constexpr int kMost = N > 0 ? N : GearedHinge::kMost;
  const int n = N > 0 ? N : static_cast<int>(hinge.turns.size());
  const AxisBody& b = model.axis_bodies[hinge.body];
  AxisRecord<double>& record = ws.axis(hinge.body);
  Force<double> Q[kMost];
  double A[kMost * kMost], R[kMost], bias[kMost], c[kMost];
  for (int i = 0; i < n; ++i) {
    const GearedHinge::Turn& turn = hinge.turns[static_cast<std::size_t>(i)];
    PendingWheel& pending = k.wheels[static_cast<std::size_t>(turn.wheel)];
    R[i] = k.ratios[static_cast<std::size_t>(turn.ratio)];
    for (int j = 0; j < n; ++j) {
      const int from = hinge.pairs[static_cast<std::size_t>(i * n + j)];
      A[i * n + j] = from < 0 ? 0.0 : k.pairs[static_cast<std::size_t>(from)];
    }
    if (turn.begins) {
      const TurningWheel& wheel = e.wheels[static_cast<std::size_t>(turn.wheel)];
      A[i * n + i] = wheel.J_axial, Q[i] = {};
      bias[i] = take_moment(wheel, ws, in) + wheel.J_axial * k.ratios[static_cast<std::size_t>(wheel.t)];
    } else {
      Q[i] = apart(pending.Q), bias[i] = pending.b;
    }
  }
  return for_axis(
      b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
        ArticulatedInertia<double> P = ws.core(hinge.body).P;
        Force<double> V, z = apart(ws.z(hinge.body));
        const double p = entry<I, I>(P.J), size = P.J.xx + P.J.yy + P.J.zz;
        at<I>(V.n) = p, at<(I + 1) % 3>(V.n) = entry<I, (I + 1) % 3>(P.J), at<(I + 2) % 3>(V.n) = entry<I, (I + 2) % 3>(P.J);
        V.f = {entry<I, 0>(P.B), entry<I, 1>(P.B), entry<I, 2>(P.B)};
        double D = p, eps = (in.tau ? in.tau[b.v] : 0.0) - at<I>(z.n);
        for (int i = 0; i < n; ++i) {
          const double h = at<I>(Q[i].n);
          c[i] = h;
          for (int j = 0; j < n; ++j) c[i] += A[i * n + j] * R[j];
          D += R[i] * (h + c[i]);
          V += R[i] * Q[i];
          eps -= R[i] * bias[i];
        }
        if (!(D > kPivotLimit * size)) {
          ws.breakdown = {hinge.body, 0, D, kPivotLimit * size};
          return false;
        }
        const double inverse = 1.0 / D, nu = inverse * eps;
        const Force<double> G = inverse * V;
        record.nu = nu;
        set_apart(record.G, G);
        subtract_outer(P, V, G);
        z += eps * G;
        const double cosine = ws.cosines[b.angle], sine = ws.sines[b.angle];
        P = inertia_to_inboard<I, TILT>(b, cosine, sine, P);
        z = force_to_inboard<double, I, TILT>(b, cosine, sine, z);
        double *kept = k.pairs.data() + hinge.A, *taken = kept + n * n;
        for (int i = 0; i < n; ++i) {
          taken[i] = inverse * c[i];
          for (int j = 0; j <= i; ++j) A[i * n + j] = A[j * n + i] = kept[i * n + j] = kept[j * n + i] = A[i * n + j] - c[i] * taken[j];
          Q[i] = force_to_inboard<double, I, TILT>(b, cosine, sine, Q[i] - c[i] * G);
          bias[i] += c[i] * nu;
        }
        for (int i = 0; i < n; ++i) {
          const GearedHinge::Turn& turn = hinge.turns[static_cast<std::size_t>(i)];
          if (!turn.ends) continue;
          const Vec3<double> u = e.wheels[static_cast<std::size_t>(turn.wheel)].u;
          Force<double> half = Q[i];
          half.n += (0.5 * A[i * n + i]) * u;
          for (int j = 0; j < n; ++j) {
            const GearedHinge::Turn& other = hinge.turns[static_cast<std::size_t>(j)];
            if (other.ends && j < i) half.n += A[i * n + j] * e.wheels[static_cast<std::size_t>(other.wheel)].u;
            if (!other.ends) Q[j].n += A[i * n + j] * u;
          }
          const Vec3<double>&m = half.n, &f = half.f;
          P.J.xx += 2.0 * m.x * u.x, P.J.yy += 2.0 * m.y * u.y, P.J.zz += 2.0 * m.z * u.z;
          P.J.xy += m.x * u.y + m.y * u.x, P.J.xz += m.x * u.z + m.z * u.x, P.J.yz += m.y * u.z + m.z * u.y;
          P.B.xx += u.x * f.x, P.B.xy += u.x * f.y, P.B.xz += u.x * f.z;
          P.B.yx += u.y * f.x, P.B.yy += u.y * f.y, P.B.yz += u.y * f.z;
          P.B.zx += u.z * f.x, P.B.zy += u.z * f.y, P.B.zz += u.z * f.z;
          z.n += bias[i] * u;
        }
        for (int i = 0; i < n; ++i) {
          PendingWheel& pending = k.wheels[static_cast<std::size_t>(hinge.turns[static_cast<std::size_t>(i)].wheel)];
          set_apart(pending.Q, Q[i]), pending.b = bias[i];
        }
        ws.core(b.parent).P += P;
        ws.z(b.parent) += z;
        return true;
      });
}
static inline bool take_geared(const SweepModel& model, const Embedding& e, const GearedHinge& hinge, Workspace<double>& ws,
                               EmbeddingWork& k, const Inputs<double>& in) {
  switch (hinge.turns.size()) {
    case 1:
      return take_geared<1>(model, e, hinge, ws, k, in);
    case 2:
      return take_geared<2>(model, e, hinge, ws, k, in);
    default:
      return take_geared<0>(model, e, hinge, ws, k, in);
  }
}

/// v' = nu - (V* delta + c* s) / D, s on with R v', and the wheels' own.
static inline void geared_outward(const SweepModel& model, const Embedding& e, const GearedHinge& hinge, Workspace<double>& ws,
                                  EmbeddingWork& k, double* vdot) {
  const AxisBody& b = model.axis_bodies[hinge.body];
  const AxisRecord<double>& record = ws.axis(hinge.body);
  const std::size_t n = hinge.turns.size();
  const double* taken = k.pairs.data() + hinge.A + n * n;
  double less = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const GearedHinge::Turn& turn = hinge.turns[i];
    PendingWheel& pending = k.wheels[static_cast<std::size_t>(turn.wheel)];
    if (turn.ends) {
      const TurningWheel& wheel = e.wheels[static_cast<std::size_t>(turn.wheel)];
      pending.s = dot(wheel.u, ws.core(b.parent).delta.w);
      vdot[wheel.v] = k.ratios[static_cast<std::size_t>(wheel.t)];
    }
    less += taken[i] * pending.s;
  }
  for_axis(
      b.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
        Motion<double> d = motion_to_outboard<double, I, TILT>(b, ws.cosines[b.angle], ws.sines[b.angle], ws.core(b.parent).delta);
        const double rate = record.nu - dot(d, record.G) - less;
        at<I>(d.w) += rate;
        ws.core(hinge.body).delta = d;
        vdot[b.v] = rate;
      });
  for (const GearedHinge::Turn& turn : hinge.turns) {
    const TurningWheel& wheel = e.wheels[static_cast<std::size_t>(turn.wheel)];
    const double more = k.ratios[static_cast<std::size_t>(turn.ratio)] * vdot[b.v];
    k.wheels[static_cast<std::size_t>(turn.wheel)].s += more;
    vdot[wheel.v] += more;
    if (turn.begins && wheel.on_ground) turn_on_ground(wheel, vdot[wheel.v], ws);
  }
}

}  // namespace cardan::soa
