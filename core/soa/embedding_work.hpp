#pragma once
// Working memory of loops that are closed inside of the sweeps (core/model/embedding.hpp), one per workspace.
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/model/embedding.hpp"
#include "core/soa/workspace.hpp"

namespace cardan::soa {

/// `to` seen from `from`, axes of the node `from`.
struct RelativePlace {
  Mat3<double> R;
  Vec3<double> d, w, u;  // [m], [rad/s], [m/s]: u = d'
};
/// Rows of closures that a hinge type makes: W per row in the axes of `from`, c, and c'' - W* [w'; u'].
struct RowsOfHinges {
  void (*close)(void* context, int loop, const RelativePlace& place, Force<double>* W, double* c, double* extra) = nullptr;
  void* context = nullptr;
};

/// The rows of a hinge that turns about the unit vector a alone: two moments across a, and forces along the axes. Where components of a are
/// alike, rounding does not choose between them: rows that are found twice are the same.
CARDAN_INLINE void rows_across(const Vec3<double>& a, Force<double>* W) {
  constexpr double kAlike = 1e-6;
  const double x = a.x * a.x, y = a.y * a.y, z = a.z * a.z;
  Vec3<double> least{1, 0, 0};
  if (y < x - kAlike) least = {0, 1, 0};
  if (z < std::fmin(x, y) - kAlike) least = {0, 0, 1};
  const Vec3<double> across = cross(a, least), n = (1.0 / std::sqrt(dot(across, across))) * across;
  W[0] = {cross(n, a), {}}, W[1] = {n, {}};
  W[2] = {{}, {1, 0, 0}}, W[3] = {{}, {0, 1, 0}}, W[4] = {{}, {0, 0, 1}};
}

/// A body of a path relative to home at rest, axes and origin of home.
template <class T>
struct PathStateOf {
  Mat3<T> R;
  Vec3<T> p, w, v, alpha, a;  // [m], [rad/s], [m/s]; acceleration at v' = 0
};
using PathState = PathStateOf<double>;

/// A place by which a path leaves a body, where it deforms with it.
struct PathExit {
  const NodeShapes* shapes = nullptr;  // null: it does not
  Mat3<double> Jl;
  Vec3<double> rho, x;  // [m] in the body, from home in axes of home
};

/// A wheel of a transmission on its way: to its carrier Q and b, outward s.
struct PendingWheel {
  Force<double> Q;
  double b = 0.0, s = 0.0;
};

/// Where the bodies of hinges side by side stand in a workspace: cores of the bodies and of what is inboard of them, and z of both.
struct HingePlaces {
  HingePlaces(Workspace<double>& ws, const AlikeHinges& hinges) {
    for (int i = 0; i < AlikeHinges::kMost; ++i) {
      core[i] = &ws.core(hinges.body[i]), inboard[i] = &ws.core(hinges.parent[i]);
      z[i] = &ws.z(hinges.body[i]), z_inboard[i] = &ws.z(hinges.parent[i]);
    }
  }
  Core<double>*core[AlikeHinges::kMost], *inboard[AlikeHinges::kMost];
  Force<double>*z[AlikeHinges::kMost], *z_inboard[AlikeHinges::kMost];
};
/// Gears side by side: where they stand, and on their way out v' = nu - G* delta.
struct GearRecord {
  GearRecord(Workspace<double>& ws, const AlikeGears& gears) : places(ws, gears.hinges) {
    for (int i = 0; i < AlikeGears::kMost; ++i) load[i] = &ws.axis(gears.wheel[i]).load;
  }
  alignas(32) double G[6][AlikeGears::kMost] = {};
  double nu[AlikeGears::kMost] = {};
  HingePlaces places;
  const double* load[AlikeGears::kMost];
};
/// The same of geared chains, tip to base: v' = L^-* (nu - G* delta) with delta of the carrier, L of ones on its diagonal.
struct ChainRecord {
  ChainRecord(Workspace<double>& ws, const AlikeChains& chains) {
    for (const AlikeHinges& hinges : chains.hinges) places.emplace_back(ws, hinges);
  }
  alignas(32) double G[GearedChain::kMost][6][AlikeHinges::kMost] = {};
  double nu[GearedChain::kMost][AlikeHinges::kMost] = {}, L[GearedChain::kMost][GearedChain::kMost][AlikeHinges::kMost] = {};
  std::vector<HingePlaces> places;
};

/// Four numbers of a row, wherever they stand: packed, as clang forgets behind a reference what a vector type says of its alignment.
using Four [[gnu::vector_size(32)]] = double;
struct [[gnu::packed, gnu::may_alias]] FourOfRow {
  Four x;
};
CARDAN_INLINE FourOfRow& four(double* x) { return *reinterpret_cast<FourOfRow*>(x); }
CARDAN_INLINE const FourOfRow& four(const double* x) { return *reinterpret_cast<const FourOfRow*>(x); }
/// y += a x of rows of whole fours.
CARDAN_INLINE void add_row(double* y, double a, const double* x, int width) {
  for (int j = 0; j < width; j += 4) four(y + j).x += a * four(x + j).x;
}
/// y = a x.
CARDAN_INLINE void set_row(double* y, double a, const double* x, int width) {
  for (int j = 0; j < width; j += 4) four(y + j).x = a * four(x + j).x;
}

struct EmbeddingWork {
  EmbeddingWork(const Embedding& e, Workspace<double>& ws)
      : numbers(static_cast<std::size_t>(e.n_numbers)),
        b(static_cast<std::size_t>(e.n_x)),
        x(static_cast<std::size_t>(e.n_x)),
        g(static_cast<std::size_t>(e.n_rows)),
        c(static_cast<std::size_t>(e.n_rows)),
        Y(static_cast<std::size_t>(e.n_Y)),
        Q(static_cast<std::size_t>(e.n_Q)),
        W(static_cast<std::size_t>(e.n_rows)),
        z(static_cast<std::size_t>(e.n_carried)),
        U(static_cast<std::size_t>(e.n_U)),
        P(static_cast<std::size_t>(e.n_carried)),
        path(static_cast<std::size_t>(e.n_path)),
        modal(static_cast<std::size_t>(e.n_modal)),
        row_at(static_cast<std::size_t>(e.n_rows)),
        ratios(static_cast<std::size_t>(e.n_ratios)),
        pairs(static_cast<std::size_t>(e.n_pairs)),
        angles(static_cast<std::size_t>(e.n_angles)),
        rates(angles.size()),
        sines(angles.size()),
        cosines(angles.size()),
        wheels(e.wheels.size()),
        turns_known(e.transmissions.size()) {
    for (const AlikeGears& all : e.alike_gears) gears.emplace_back(ws, all);
    for (const AlikeChains& all : e.alike_chains) chains.emplace_back(ws, all);
    std::size_t most = 1, longest = 0;
    for (const EmbeddedLoop& loop : e.loops) longest = longest > loop.path.size() ? longest : loop.path.size();
    exits.resize(longest + 2);
    known.resize(e.loops.size());
    named.resize(e.loops.size());
    for (const EmbeddingStep& s : e.steps) {
      std::size_t n = 8;
      for (const PendingFlow& f : s.flows) n += static_cast<std::size_t>(e.loops[static_cast<std::size_t>(f.loop)].n) + 1;
      if (s.loop >= 0) n *= static_cast<std::size_t>(e.loops[static_cast<std::size_t>(s.loop)].n + 1);
      most = most > n ? most : n;
    }
    for (const Transmission& t : e.transmissions)
      for (const Transmission::Row& row : t.rows) most = std::max(most, t.steepest.size() + row.column.size());
    scratch.resize(8 * most > static_cast<std::size_t>(e.n_scratch) ? 8 * most : static_cast<std::size_t>(e.n_scratch));
    PU.resize(most);
    column_at.resize(static_cast<std::size_t>(e.n_pivots));
    for (const EmbeddedLoop& loop : e.loops)
      for (const CoupledRate& term : loop.coupling.terms) gradients.push_back(term.coefficient);
  }
  std::vector<double> numbers;    // A first; then per loop G, rows to eliminate, T | t, E | e
  std::vector<double> b, x;       // per coordinate: force, and acceleration (of multipliers: themselves); before, of multipliers: their
                                  // compliance by the inertia of the start
  std::vector<double> g, c;       // per row, in the order of Embedding::loops: gamma_c, residual of scaled rows
  std::vector<double> gradients;  // of couplings, term by term
  std::vector<double> Y;
  std::vector<Force<double>> Q, W, z;  // columns of pending coordinates; rows in axes of home, at the end `to`; what passes bodies
  std::vector<Motion<double>> U;
  std::vector<ArticulatedInertia<double>> P;
  std::vector<PathState> path;
  std::vector<PathExit> exits;      // of the bodies of the path of one loop, then of home: on the way to `from`, to `to`
  std::vector<std::uint8_t> known;  // per loop that is `constant`: T and E are those of gamma_c = 0
  std::vector<std::uint8_t> named;  // per loop: its pivots are rates of its own, what others know are coordinates of it as they are
  std::vector<double> modal;        // columns of pending coordinates on modes; after these were eliminated: L^-1 of them
  std::vector<int> row_at, column_at;
  // Of wheels that turn with hinges:
  std::vector<double> ratios, pairs;                  // Transmission::numbers, GearedHinge::A
  std::vector<double> angles, rates, sines, cosines;  // of couplings that are not linear: Transmission::Row::angles
  std::vector<PendingWheel> wheels;
  std::vector<GearRecord> gears;
  std::vector<ChainRecord> chains;
  std::vector<std::uint8_t> turns_known;  // per transmission that is `constant`
  std::vector<double> scratch;
  std::vector<Force<double>> PU;
  double size = 0.0;      // of the largest term of scaled gamma_c
  double smallest = 1.0;  // pivot of scaled rows, and its row: how far the mechanism is from a singular posture
  int weakest = 0;
};

}  // namespace cardan::soa
