#pragma once
// Wheels that turn with hinges, in the sweeps (core/model/gears.hpp; docs/mathematics/loops.md, 4): one beside its hinge, and those of
// transmissions, which are coordinates of the bodies between their outermost hinge and their carrier.
#include <cmath>

#include "core/soa/embedding_side.hpp"
#include "core/soa/sincos.hpp"

namespace cardan::soa {

/// Phi P Phi* of a body that turns about an axis of its own: as P+ in inward_axis, with the row of the axis.
template <int I, Tilt TILT, class T, class Body>
CARDAN_INLINE ArticulatedInertia<T> inertia_to_inboard(const Body& b, const T& c, const T& s, ArticulatedInertia<T> P) {
  constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
  turn<I>(P.J, c, s);
  turn<I>(P.B, c, s);
  turn<I>(P.M, c, s);
  const T lj(b.l[0]), lk(b.l[1]);
  const T mii = entry<I, I>(P.M), mij = entry<I, J>(P.M), mik = entry<I, K>(P.M), mjj = entry<J, J>(P.M), mjk = entry<J, K>(P.M),
          mkk = entry<K, K>(P.M);
  const T bii = entry<I, I>(P.B), bij = entry<I, J>(P.B), bik = entry<I, K>(P.B), bji = entry<J, I>(P.B), bki = entry<K, I>(P.B);
  const T cij = bij + (lj * mjk - lk * mjj), cik = bik + (lj * mkk - lk * mjk);
  const T cji = bji + lk * mii, cjj = entry<J, J>(P.B) + lk * mij, cjk = entry<J, K>(P.B) + lk * mik;
  const T cki = bki - lj * mii, ckj = entry<K, J>(P.B) - lj * mij, ckk = entry<K, K>(P.B) - lj * mik;
  ArticulatedInertia<T> Q;
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
    tilt<TILT, T>(b, Q.J);
    tilt<TILT, T>(b, Q.B);
    tilt<TILT, T>(b, Q.M);
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
static inline double wanted_of(const AlikeGears& gears, int i, const Inputs<double>& in, const double* given) {
  return given ? given[gears.row[i]] : gears.drive[i] >= 0 && in.drives ? in.drives[gears.drive[i]].acceleration : 0.0;
}
template <class T>
CARDAN_INLINE T wanted_of(const AlikeGears& gears, const Inputs<double>& in, const double* given) {
  if (!given && !gears.driven) return T(0.0);
  return each<T>([&](int i) { return wanted_of(gears, i, in, given); });
}

/// Hinges each with the wheel that turns with it about its axis, v'_w = r v' + t (u = +-e_i; r and v_w with that sign): a moment along the
/// axis is the same on the carrier and on the body, so that D = P_ii + r^2 Ja, V = P e_i + r Ja e_i, and what the carrier feels of both is
/// P + Ja e_i e_i* - V D^-1 V*, z + V nu + Ja t e_i + Ja v_w (w x e_i), shifted as that of any body. T: a number of each.
template <class T>
static bool take_gears(const AlikeGears& gears, GearRecord& record, Workspace<double>& ws, const Inputs<double>& in, const double* given) {
  const AlikeHinges& hinges = gears.hinges;
  // Everything is read before anything is written: for all that the compiler knows it is written over.
  const HingePlaces& places = record.places;
  const Places<T> P_to = P_of<T>(places.inboard), z_to = force_of<T>(places.z_inboard);
  const T c = cosine_of<T>(ws, hinges), s = sine_of<T>(ws, hinges);
  const T sense = side<T>(gears.sense), Ja = side<T>(gears.J_axial),
          lag = sense * Ja * side<T>(gears.per_slope) * wanted_of<T>(gears, in, given);
  T moment = each<T>([&](int i) { return *record.load[i]; }), tau(0.0);
  if (in.tau) {
    moment = moment + each<T>([&](int i) { return in.tau[gears.v[i]]; });
    tau = each<T>([&](int i) { return in.tau[hinges.v[i]]; });
  }
  tau = tau + side<T>(gears.ratio) * (sense * moment - lag);
  const T spin = sense * Ja * each<T>([&](int i) { return in.v[gears.v[i]]; });
  return for_axis(
      hinges.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
        constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
        const auto of_body = [&](auto number) __attribute__((always_inline)) {
          return each<T>([&](int i) { return number(*places.core[i]); });
        };
        const T gamma = of_body([](const Core<double>& body) { return at<I>(body.gamma.w); });
        const T wj = of_body([](const Core<double>& body) { return at<J>(body.w); });
        const T wk = of_body([](const Core<double>& body) { return at<K>(body.w); });
        const T coupled = side<T>(gears.coupled);
        const HingesAside<T> b(hinges);
        ArticulatedInertia<T> P;
        Force<T> z;
        take_from(P_of<T>(places.core), P), take_from(force_of<T>(places.z), z);
        const T D = entry<I, I>(P.J) + side<T>(gears.reflected), limit = T(kPivotLimit) * (P.J.xx + P.J.yy + P.J.zz);
        if (!(D > limit)) {
          break_down(ws, hinges, D, limit);
          return false;
        }
        const T inverse = T(1.0) / D, eps = tau - at<I>(z.n) - coupled * gamma;
        Force<T> V;
        at<I>(V.n) = entry<I, I>(P.J) + coupled, at<J>(V.n) = entry<I, J>(P.J), at<K>(V.n) = entry<I, K>(P.J);
        V.f = {entry<I, 0>(P.B), entry<I, 1>(P.B), entry<I, 2>(P.B)};
        const Force<T> G = inverse * V;
        set_side(record.nu, inverse * eps);
        set_aside(record.G, G);
        entry<I, I>(P.J) = entry<I, I>(P.J) + Ja;
        subtract_outer(P, V, G);
        add_to(P_to, inertia_to_inboard<I, TILT>(b, c, s, P));
        z += eps * G;
        at<I>(z.n) = at<I>(z.n) + lag, at<J>(z.n) = at<J>(z.n) + spin * wk, at<K>(z.n) = at<K>(z.n) - spin * wj;
        add_to(z_to, force_to_inboard<T, I, TILT>(b, c, s, z));
        return true;
      });
}
template <class T>
static void gears_outward(const AlikeGears& gears, const GearRecord& record, Workspace<double>& ws, const Inputs<double>& in,
                          const double* given, double* vdot) {
  const AlikeHinges& hinges = gears.hinges;
  const T wheel = side<T>(gears.per_slope) * wanted_of<T>(gears, in, given);
  for_axis(
      hinges.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
        const HingesAside<T> b(hinges);
        Motion<T> d;
        take_from(delta_of<T>(record.places.inboard), d);
        d = motion_to_outboard<T, I, TILT>(b, cosine_of<T>(ws, hinges), sine_of<T>(ws, hinges), d);
        const T rate = side<T>(record.nu) - dot(d, from_aside<T>(record.G));
        at<I>(d.w) = at<I>(d.w) + rate;
        set_at(delta_of<T>(record.places.core), d);
        const T of_wheel = side<T>(gears.sense) * side<T>(gears.ratio) * rate + wheel;
        for (int i = 0; i < kWidth<T>; ++i) vdot[hinges.v[i]] = lane(rate, i), vdot[gears.v[i]] = lane(of_wheel, i);
      });
}

static bool take_gears(const Embedding& e, int begin, int end, Workspace<double>& ws, EmbeddingWork& k, const Inputs<double>& in,
                       const double* given) {
  for (int i = begin; i < end; ++i) {
    const AlikeGears& gears = e.alike_gears[static_cast<std::size_t>(i)];
    GearRecord& record = k.gears[static_cast<std::size_t>(i)];
    if (is_left_out(gears)) continue;
    if (!side_by_side(gears.n, [&]<class T>() { return take_gears<T>(gears, record, ws, in, given); })) return false;
  }
  return true;
}
static void gears_outward(const Embedding& e, int begin, int end, Workspace<double>& ws, const EmbeddingWork& k, const Inputs<double>& in,
                          const double* given, double* vdot) {
  for (int i = end; i-- > begin;) {
    const AlikeGears& gears = e.alike_gears[static_cast<std::size_t>(i)];
    const GearRecord& record = k.gears[static_cast<std::size_t>(i)];
    if (is_left_out(gears)) continue;
    side_by_side(gears.n, [&]<class T>() { gears_outward<T>(gears, record, ws, in, given, vdot); });
  }
}

/// visit<N>() with the number of terms; 0: any number.
template <class Visit>
CARDAN_INLINE auto for_terms(std::size_t terms, const Visit& visit) {
  return terms == 2 ? visit.template operator()<2>() : terms == 3 ? visit.template operator()<3>() : visit.template operator()<0>();
}
/// Angles of the sines and cosines of a coupling, and their rates.
template <int N>
CARDAN_INLINE void angles_of(const Coupling& c, const Sinusoids& sinusoids, const double* q, const double* v, double* x, double* rate) {
  static_assert(Sinusoids::kSide == 4);
  const double *a = sinusoids.numbers.data(), *end = a + sinusoids.numbers.size();
  const CoupledRate* terms = c.terms.data();
  const int n = N > 0 ? N : static_cast<int>(c.terms.size());
  double at[N > 0 ? N : 1], speeds[N > 0 ? N : 1];  // read once: for all that the compiler knows, x may stand among them
  for (int t = 0; t < N; ++t) at[t] = q[terms[t].q], speeds[t] = v[terms[t].v];
  for (; a < end; x += 4, rate += 4) {
    a += 8;
    Four angle{}, speed{};
    for (int t = 0; t < n; ++t, a += 4) {
      angle += (N > 0 ? at[t] : q[terms[t].q]) * four(a).x;
      speed += (N > 0 ? speeds[t] : v[terms[t].v]) * four(a).x;
    }
    four(x).x = angle, four(rate).x = speed;
  }
}

/// Sums of the numbers of each, side by side.
CARDAN_INLINE Lanes<4> sums_of(const Four& a, const Four& b, const Four& c, const Four& d) {
  const Lanes<4>::Pack packs[4] = {a, b, c, d};
  Lanes<4> x(packs[0]), y(packs[1]), z(packs[2]), w(packs[3]);
  transpose(x, y, z, w);
  return (x + z) + (y + w);
}

/// What c'' has without v', and the gradient, as Coupling::at: of sines, cosines and rates as angles_of() has them.
template <int N>
CARDAN_INLINE double slopes_of(const Coupling& c, const Sinusoids& sinusoids, const Inputs<double>& in, const double* sine,
                               const double* cosine, const double* rate, double* gradient) {
  const std::size_t terms = N > 0 ? N : c.terms.size(), block = 4 * (2 + terms);
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
  for (std::size_t first = 0; first < terms; first += 3) {  // three terms at a time
    Four curved{}, part[3] = {};
    const std::size_t few = N > 0 ? N : std::min<std::size_t>(terms - first, 3);
    std::size_t at = 0;
    for (const double* S = begin; S < end; S += block, at += 4) {
      const Four s = four(sine + at).x, k = four(cosine + at).x, speed = four(rate + at).x;
      curved += (four(S).x * s + four(S + 4).x * k) * speed * speed;
      const Four slope = four(S).x * k - four(S + 4).x * s;
      for (std::size_t t = 0; t < few; ++t) part[t] += slope * four(S + 8 + 4 * (first + t)).x;
    }
    const Lanes<4> sums = sums_of(part[0], part[1], part[2], curved);
    for (std::size_t t = 0; t < few; ++t) gradient[first + t] += sums.x[t];
    if (first == 0) extra -= sums.x[3];
  }
  return extra;
}

/// B = A^-1, row by row; a singular one has no finite numbers.
template <int N>
CARDAN_INLINE void invert(int n, double* A, double* B) {
  if constexpr (N == 1) {
    B[0] = 1.0 / A[0];
    return;
  }
  if constexpr (N == 2) {
    const double inverse = 1.0 / (A[0] * A[3] - A[1] * A[2]);
    B[0] = inverse * A[3], B[1] = -inverse * A[1], B[2] = -inverse * A[2], B[3] = inverse * A[0];
    return;
  }
  for (int i = 0; i < n * n; ++i) B[i] = i % (n + 1) == 0 ? 1.0 : 0.0;
  for (int p = 0; p < n; ++p) {
    int best = p;
    for (int i = p + 1; i < n; ++i)
      if (std::abs(A[i * n + p]) > std::abs(A[best * n + p])) best = i;
    for (int j = 0; best != p && j < n; ++j) std::swap(A[p * n + j], A[best * n + j]), std::swap(B[p * n + j], B[best * n + j]);
    const double scale = 1.0 / A[p * n + p];
    for (int j = 0; j < n; ++j) A[p * n + j] *= scale, B[p * n + j] *= scale;
    for (int i = 0; i < n; ++i) {
      if (i == p) continue;
      const double factor = A[i * n + p];
      for (int j = 0; j < n; ++j) A[i * n + j] -= factor * A[p * n + j], B[i * n + j] -= factor * B[p * n + j];
    }
  }
}

/// R and t of a transmission of N wheels (0: any number): with G_w and G_h its slopes on wheels and hinges, R = -G_w^-1 G_h,
/// t = G_w^-1 (what G v' is to be). False: wheels near a dead centre of their hinges.
template <int N>
static bool find_ratios(const Transmission& t, EmbeddingWork& k, const Inputs<double>& in, const double* given) {
  constexpr int kMost = N > 0 ? N : GearedHinge::kMost;
  const int n = N > 0 ? N : static_cast<int>(t.wheels.size()), along = static_cast<int>(t.way.size());
  double *R = k.ratios.data() + t.numbers, *bias = R + n * along, *inverse = bias + n;
  double slopes[kMost * kMost] = {}, wanted[kMost];
  double *hinges = k.scratch.data(), *gradient = hinges + n * along;  // n x along; per term
  for (int i = 0; i < n * along; ++i) hinges[i] = 0.0;
  for (int i = 0; i < n; ++i) {
    const Transmission::Row& row = t.rows[static_cast<std::size_t>(i)];
    const double extra = for_terms(
        row.column.size(), [&]<int TERMS>() __attribute__((always_inline)) {
          return slopes_of<TERMS>(row.coupling, row.sinusoids, in, k.sines.data() + row.angles, k.cosines.data() + row.angles,
                                  k.rates.data() + row.angles, gradient);
        });
    for (std::size_t j = 0; j < row.column.size(); ++j) {
      const int column = row.column[j];
      (column < n ? slopes[i * n + column] : hinges[i * along + column - n]) += gradient[j];
    }
    wanted[i] = given ? given[row.row] : (row.drive >= 0 && in.drives ? in.drives[row.drive].acceleration : 0.0) - extra;
  }
  invert<N>(n, slopes, inverse);
  bool far = true;
  for (int i = 0; i < n; ++i) {
    double sum = 0.0;
    for (int l = 0; l < n; ++l) sum += inverse[i * n + l] * wanted[l];
    bias[i] = sum;
    for (int j = 0; j < along; ++j) {
      sum = 0.0;
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
        for_terms(
            row.column.size(), [&]<int TERMS>() __attribute__((always_inline)) {
              angles_of<TERMS>(row.coupling, row.sinusoids, in.q, in.v, k.angles.data() + row.angles, k.rates.data() + row.angles);
            });
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
template <int I, class T>
CARDAN_INLINE Force<T> turning_column(const ArticulatedInertia<T>& P) {
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
/// D = L d L*, the outermost hinge first. T: a number of each chain.
template <int M, class T>
static bool take_chains(const Embedding& e, const AlikeChains& chains, ChainRecord& record, Workspace<double>& ws, EmbeddingWork& k,
                        const Inputs<double>& in) {
  Force<T> F[M];
  T D[M][M], eps[M], limit[M];
  const AlikeHinges* hinges = chains.hinges.data();
  const HingePlaces* places = record.places.data();
  ArticulatedInertia<T> P, more_P;
  Force<T> z, more_z;
  take_from(P_of<T>(places->core), P), take_from(force_of<T>(places->z), z);
  for (int x = 0; x < M; ++x, ++hinges, ++places) {
    const T c = cosine_of<T>(ws, *hinges), s = sine_of<T>(ws, *hinges);
    const T tau = in.tau ? each<T>([&](int i) { return in.tau[hinges->v[i]]; }) : T(0.0);
    for_axis(
        hinges->kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          const HingesAside<T> b(*hinges);
          F[x] = turning_column<I>(P);
          for (int y = 0; y <= x; ++y) D[x][y] = at<I>(F[y].n);
          eps[x] = tau - at<I>(z.n), limit[x] = T(kPivotLimit) * (P.J.xx + P.J.yy + P.J.zz);
          P = inertia_to_inboard<I, TILT>(b, c, s, P);
          z = force_to_inboard<T, I, TILT>(b, c, s, z);
          for (int y = 0; y <= x; ++y) F[y] = force_to_inboard<T, I, TILT>(b, c, s, F[y]);
        });
    if (x + 1 == M) break;
    take_from(P_of<T>(places->inboard), more_P), take_from(force_of<T>(places->z_inboard), more_z);
    P += more_P, z += more_z;
  }
  const auto of_carrier = [&](auto number) __attribute__((always_inline)) {
    return each<T>([&](int i) { return number(*places->inboard[i]); });
  };
  const Vec3<T> w{of_carrier([](const Core<double>& A) { return A.w.x; }), of_carrier([](const Core<double>& A) { return A.w.y; }),
                  of_carrier([](const Core<double>& A) { return A.w.z; })};
  const Vec3<T> gamma{of_carrier([](const Core<double>& A) { return A.gamma.w.x; }),
                      of_carrier([](const Core<double>& A) { return A.gamma.w.y; }),
                      of_carrier([](const Core<double>& A) { return A.gamma.w.z; })};
  for (const AlikeChains::Wheels& wheels : chains.wheels) {
    const auto ratio = [&](int at) { return at < 0 ? 0.0 : k.ratios[static_cast<std::size_t>(at)]; };
    const Vec3<T> u{side<T>(wheels.u[0]), side<T>(wheels.u[1]), side<T>(wheels.u[2])};
    const T Ja = side<T>(wheels.J_axial), more = Ja * each<T>([&](int i) { return ratio(wheels.t[i]); });
    T bias;
    if (chains.on_ground) {
      bias = more + each<T>([&](int i) { return take_moment(e.wheels[static_cast<std::size_t>(wheels.wheel[i])], ws, in); });
      z.n += bias * u;
    } else {
      T moment = each<T>([&](int i) { return ws.axis(wheels.body[i]).load; });
      if (in.tau) moment = moment + each<T>([&](int i) { return in.tau[wheels.v[i]]; });
      bias = more + Ja * dot(u, gamma) - moment;
      z.n += Ja * each<T>([&](int i) { return in.v[wheels.v[i]]; }) * cross(w, u) + more * u;
    }
    const Vec3<T> Ju = Ja * u;
    T R[M];
    for (int x = 0; x < M; ++x) {
      R[x] = each<T>([&](int i) { return ratio(wheels.ratio[x][i]); });
      eps[x] = eps[x] - R[x] * bias;
      for (int y = 0; y <= x; ++y) D[x][y] = D[x][y] + Ja * R[x] * R[y];
      F[x].n += R[x] * Ju;
    }
    P.J.xx = P.J.xx + Ju.x * u.x, P.J.yy = P.J.yy + Ju.y * u.y, P.J.zz = P.J.zz + Ju.z * u.z;
    P.J.xy = P.J.xy + Ju.x * u.y, P.J.xz = P.J.xz + Ju.x * u.z, P.J.yz = P.J.yz + Ju.y * u.z;
  }
  for (int x = 0; x < M; ++x) {
    for (int y = 0; y < x; ++y) {
      const T L = D[x][y] / D[y][y];
      set_side(record.L[x][y], L);
      F[x] -= L * F[y], eps[x] = eps[x] - L * eps[y];
      for (int i = x; i < M; ++i) D[i][x] = D[i][x] - L * D[i][y];
    }
    if (!(D[x][x] > limit[x])) {
      break_down(ws, chains.hinges[static_cast<std::size_t>(x)], D[x][x], limit[x]);
      return false;
    }
    const T inverse = T(1.0) / D[x][x];
    const Force<T> G = inverse * F[x];
    set_side(record.nu[x], inverse * eps[x]);
    set_aside(record.G[x], G);
    subtract_outer(P, F[x], G);
    z += eps[x] * G;
  }
  add_to(P_of<T>(places->inboard), P), add_to(force_of<T>(places->z_inboard), z);
  return true;
}

/// v' of its hinges, delta of its bodies, and the rates of its wheels.
template <int M, class T>
static void chains_outward(const Embedding& e, const AlikeChains& chains, const ChainRecord& record, Workspace<double>& ws,
                           const EmbeddingWork& k, double* vdot) {
  T rates[M];
  const AlikeHinges* hinges = chains.hinges.data();
  Motion<T> d;
  take_from(delta_of<T>(record.places[M - 1].inboard), d);
  for (int x = M - 1; x >= 0; --x) {
    rates[x] = side<T>(record.nu[x]) - dot(d, from_aside<T>(record.G[x]));
    for (int y = x + 1; y < M; ++y) rates[x] = rates[x] - side<T>(record.L[y][x]) * rates[y];
  }
  for (int x = M - 1; x >= 0; --x) {
    const AlikeHinges& h = hinges[x];
    for_axis(
        h.kind, [&]<int I, Tilt TILT>() __attribute__((always_inline)) {
          const HingesAside<T> b(h);
          d = motion_to_outboard<T, I, TILT>(b, cosine_of<T>(ws, h), sine_of<T>(ws, h), d);
          at<I>(d.w) = at<I>(d.w) + rates[x];
        });
    set_at(delta_of<T>(record.places[static_cast<std::size_t>(x)].core), d);
    for (int i = 0; i < kWidth<T>; ++i) vdot[h.v[i]] = lane(rates[x], i);
  }
  for (const AlikeChains::Wheels& wheels : chains.wheels)
    for (int i = 0; i < kWidth<T>; ++i) {
      double rate = k.ratios[static_cast<std::size_t>(wheels.t[i])];
      for (int x = 0; x < M; ++x)
        if (wheels.ratio[x][i] >= 0) rate += k.ratios[static_cast<std::size_t>(wheels.ratio[x][i])] * lane(rates[x], i);
      vdot[wheels.v[i]] = rate;
      if (const TurningWheel& wheel = e.wheels[static_cast<std::size_t>(wheels.wheel[i])]; wheel.on_ground) turn_on_ground(wheel, rate, ws);
    }
}

/// visit<M, T>() of chains of M hinges with numbers of so many lanes.
template <class Visit>
CARDAN_INLINE auto for_chains(const AlikeChains& chains, const Visit& visit) {
  return side_by_side(chains.n, [&]<class T>() {
    switch (chains.hinges.size()) {
      case 1:
        return visit.template operator()<1, T>();
      case 2:
        return visit.template operator()<2, T>();
      default:
        return visit.template operator()<3, T>();
    }
  });
}
static inline bool take_chains(const Embedding& e, int begin, int end, Workspace<double>& ws, EmbeddingWork& k, const Inputs<double>& in) {
  for (int i = begin; i < end; ++i) {
    const AlikeChains& chains = e.alike_chains[static_cast<std::size_t>(i)];
    if (is_left_out(chains)) continue;
    if (!for_chains(chains,
                    [&]<int M, class T>() { return take_chains<M, T>(e, chains, k.chains[static_cast<std::size_t>(i)], ws, k, in); }))
      return false;
  }
  return true;
}
static inline void chains_outward(const Embedding& e, int begin, int end, Workspace<double>& ws, const EmbeddingWork& k, double* vdot) {
  for (int i = end; i-- > begin;) {
    const AlikeChains& chains = e.alike_chains[static_cast<std::size_t>(i)];
    if (is_left_out(chains)) continue;
    for_chains(chains, [&]<int M, class T>() { chains_outward<M, T>(e, chains, k.chains[static_cast<std::size_t>(i)], ws, k, vdot); });
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
