#include "core/model/gears.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/model/model.hpp"

namespace cardan {
namespace {

constexpr double kSteep = 100.0;      // of R in the root of the energy of rates: digits that a wheel near a dead centre of its hinges costs
constexpr double kSteepStart = 10.0;  // ... at the start
constexpr double kNoSlope = 1e-6;     // of the wheels of a transmission, relative to the largest of their rows

std::size_t place(int i) { return static_cast<std::size_t>(i); }

class Finder {
 public:
  Finder(const Model& model, const std::vector<double>& rows, const std::vector<std::vector<int>>& hinges)
      : m_(model), rows_(rows), hinges_(hinges), body_of_(place(model.nv)), carries_(model.bodies.size()) {
    for (std::size_t k = 1; k < m_.bodies.size(); ++k) {
      carries_[place(m_.bodies[k].parent)] = 1;
      for (int j = 0; j < m_.bodies[k].nv; ++j) body_of_[place(m_.bodies[k].v + j)] = static_cast<int>(k);
    }
  }

  /// Couplings that share a wheel, as one transmission.
  std::vector<Transmission> all(const std::vector<std::uint8_t>& may) const {
    std::vector<int> set(m_.loops.all.size(), -1);
    for (std::size_t l = 0; l < set.size(); ++l)
      if (may[l] && turns_wheels(m_.loops.all[l])) set[l] = static_cast<int>(l);
    for (std::size_t l = 0; l < set.size(); ++l)
      for (std::size_t other = 0; set[l] >= 0 && other < l; ++other)
        if (set[other] >= 0 && share_wheel(l, other)) {
          const int joined = set[l];
          std::ranges::replace(set, joined, set[other]);
        }
    std::vector<Transmission> out;
    for (std::size_t first = 0; first < set.size(); ++first) {
      if (set[first] != static_cast<int>(first)) continue;
      std::vector<int> loops;
      for (std::size_t l = first; l < set.size(); ++l)
        if (set[l] == set[first]) loops.push_back(static_cast<int>(l));
      if (Transmission t; make(loops, t)) out.push_back(std::move(t));
    }
    return out;
  }

  /// Other loops have one of its wheels or hinges, which none of `among` is.
  bool is_shared(const Transmission& t, const std::vector<Transmission>& among) const {
    const auto touches = [&](int l) {
      return std::ranges::any_of(hinges_[place(l)], [&](int k) {
        return std::ranges::find(t.wheels, k) != t.wheels.end() || std::ranges::find(t.way, k) != t.way.end();
      });
    };
    for (std::size_t l = 0; l < hinges_.size(); ++l) {
      const bool turns = std::ranges::any_of(among, [&](const Transmission& other) {
        return std::ranges::any_of(other.rows, [&](const Transmission::Row& row) { return row.loop == static_cast<int>(l); });
      });
      if (!turns && touches(static_cast<int>(l))) return true;
    }
    return false;
  }

 private:
  bool is_given(int v) const { return m_.has_prescribed() && m_.prescribed[place(v)]; }
  /// Nothing hangs on it, and its inertia about its axis is the same at any angle.
  bool is_wheel(int k) const {
    const SweepBody& b = m_.bodies[place(k)];
    return b.kind == BodyKernel::rotor || (is_axis(b.kind) && b.parent == 0 && !carries_[place(k)]);
  }
  bool turns_wheels(const Loop& loop) const {
    if (loop.closing != Closing::coupling) return false;
    const auto simple = [&](const CoupledRate& term) {
      return is_axis(m_.bodies[place(body_of_[place(term.v)])].kind) && !is_given(term.v);
    };
    return std::ranges::all_of(loop.coupling.terms, simple) &&
           std::ranges::any_of(loop.coupling.terms, [&](const CoupledRate& term) { return is_wheel(body_of_[place(term.v)]); });
  }
  bool share_wheel(std::size_t a, std::size_t b) const {
    return std::ranges::any_of(hinges_[a], [&](int k) { return is_wheel(k) && std::ranges::find(hinges_[b], k) != hinges_[b].end(); });
  }

  bool make(const std::vector<int>& loops, Transmission& t) const {
    int outermost = 0;
    bool linear = true;
    for (const int l : loops) {
      linear = linear && m_.loops.all[place(l)].coupling.is_linear() && m_.loops.all[place(l)].drive < 0;
      for (const int k : hinges_[place(l)])
        if (!is_wheel(k))
          outermost = std::max(outermost, k);
        else if (std::ranges::find(t.wheels, k) == t.wheels.end())
          t.wheels.push_back(k);
    }
    if (outermost == 0 || t.wheels.size() != loops.size() || t.wheels.size() > GearedHinge::kMost) return false;
    const int carrier = m_.bodies[place(t.wheels[0])].parent;
    if (std::ranges::any_of(t.wheels, [&](int k) { return m_.bodies[place(k)].parent != carrier; })) return false;
    for (int k = outermost; k != carrier; k = m_.bodies[place(k)].parent) {
      if (k == 0 || !is_axis(m_.bodies[place(k)].kind) || is_given(m_.bodies[place(k)].v)) return false;
      t.way.insert(t.way.begin(), k);
    }
    for (const int l : loops) {
      const Loop& loop = m_.loops.all[place(l)];
      Transmission::Row row{l, loop.first, loop.drive, loop.coupling, Sinusoids(loop.coupling), 0, {}};
      for (const CoupledRate& term : loop.coupling.terms) {
        const int k = body_of_[place(term.v)];
        const bool wheel = is_wheel(k);
        const std::vector<int>& among = wheel ? t.wheels : t.way;
        const auto found = std::ranges::find(among, k);
        if (found == among.end()) return false;  // on another branch
        row.column.push_back(static_cast<int>(found - among.begin()) + (wheel ? 0 : static_cast<int>(t.wheels.size())));
      }
      t.rows.push_back(std::move(row));
    }
    t.constant = linear;
    return follow(t);
  }

  /// The wheels follow the hinges at the start: their slopes are regular, and R is not steep.
  bool follow(Transmission& t) const {
    const auto n = t.wheels.size(), columns = n + t.way.size();
    const auto v = [&](std::size_t j) { return place(m_.bodies[place(j < n ? t.wheels[j] : t.way[j - n])].v); };
    std::vector<double> B(n * columns);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < columns; ++j) B[i * columns + j] = rows_[place(t.rows[i].row) * place(m_.nv) + v(j)];
    const bool linear = std::ranges::all_of(t.rows, [](const Transmission::Row& row) { return row.coupling.is_linear(); });
    for (std::size_t p = 0; p < n; ++p) {  // column by column: in the end the unit matrix beside -R
      std::size_t best = p;
      for (std::size_t i = p; i < n; ++i)
        if (std::abs(B[i * columns + p]) > std::abs(B[best * columns + p])) best = i;
      double most = 0.0;
      for (std::size_t j = 0; j < columns; ++j) most = std::max(most, std::abs(B[best * columns + j]));
      if (!(std::abs(B[best * columns + p]) > kNoSlope * most)) return false;
      if (best != p)
        std::swap_ranges(B.begin() + static_cast<std::ptrdiff_t>(p * columns), B.begin() + static_cast<std::ptrdiff_t>((p + 1) * columns),
                         B.begin() + static_cast<std::ptrdiff_t>(best * columns));
      const double inverse = 1.0 / B[p * columns + p];
      for (std::size_t j = 0; j < columns; ++j) B[p * columns + j] *= inverse;
      for (std::size_t i = 0; i < n; ++i) {
        const double factor = B[i * columns + p];
        for (std::size_t j = 0; i != p && j < columns; ++j) B[i * columns + j] -= factor * B[p * columns + j];
      }
    }
    t.steepest.assign(n * t.way.size(), HUGE_VAL);
    for (std::size_t i = 0; !linear && i < n; ++i)
      for (std::size_t j = 0; j < t.way.size(); ++j) {
        if (!(std::abs(B[i * columns + n + j]) < kSteepStart)) return false;
        t.steepest[i * t.way.size() + j] = kSteep * m_.loops.column_scale[v(i)] / m_.loops.column_scale[v(n + j)];
      }
    return true;
  }

  const Model& m_;
  const std::vector<double>& rows_;
  const std::vector<std::vector<int>>& hinges_;
  std::vector<int> body_of_;           // of a hinge rate
  std::vector<std::uint8_t> carries_;  // per body: something hangs on it
};

/// More wheels turn with one of its hinges than a hinge takes.
bool is_crowded(const Transmission& t, const std::vector<Transmission>& all) {
  return std::ranges::any_of(t.way, [&](int k) {
    std::size_t turns = 0;
    for (const Transmission& other : all)
      if (std::ranges::find(other.way, k) != other.way.end()) turns += other.wheels.size();
    return turns > GearedHinge::kMost;
  });
}

}  // namespace

Sinusoids::Sinusoids(const Coupling& coupling) : terms(static_cast<int>(coupling.terms.size())) {
  struct Sum {
    std::vector<double> a;
    double S = 0.0, C = 0.0;
  };
  std::vector<Sum> sums;
  for (std::size_t f = 0; f < coupling.functions.size(); ++f) {
    const Coupling::Function& function = coupling.functions[f];
    const bool sine = function.F.kind == SmoothFunction::Kind::sine;
    if (!sine && function.F.kind != SmoothFunction::Kind::cosine) {
      others.push_back(static_cast<int>(f));
      continue;
    }
    // sin(x + phase) = cos(phase) sin x + sin(phase) cos x, and so on; x and -x are one.
    const double along = function.F.numbers[0] * std::cos(function.phase), across = function.F.numbers[0] * std::sin(function.phase);
    Sum one{std::vector<double>(coupling.terms.size()), sine ? along : -across, sine ? across : along};
    for (const Coupling::Function::Argument& u : function.of) one.a[place(u.term)] += u.a;
    const auto first = std::ranges::find_if(one.a, [](double a) { return a != 0.0; });
    if (first == one.a.end()) continue;  // it does not change
    if (*first < 0.0) {
      one.S = -one.S;
      for (double& a : one.a) a = -a;
    }
    if (const auto same = std::ranges::find(sums, one.a, &Sum::a); same != sums.end())
      same->S += one.S, same->C += one.C;
    else
      sums.push_back(std::move(one));
  }
  const std::size_t block = kSide * (2 + coupling.terms.size());
  numbers.assign((sums.size() + kSide - 1) / kSide * block, 0.0);
  for (std::size_t i = 0; i < sums.size(); ++i) {
    double* to = numbers.data() + i / kSide * block + i % kSide;
    to[0] = sums[i].S, to[kSide] = sums[i].C;
    for (std::size_t t = 0; t < sums[i].a.size(); ++t) to[kSide * (2 + t)] = sums[i].a[t];
  }
}

void AlikeHinges::set(int i, const Model& model, int k) {
  const AxisBody& b = model.axis_bodies[place(k)];
  kind = b.kind;
  body[i] = k, parent[i] = b.parent, v[i] = b.v, angle[i] = b.angle;
  cos_alpha[i] = b.cos_alpha, sin_alpha[i] = b.sin_alpha, cos_beta[i] = b.cos_beta, sin_beta[i] = b.sin_beta;
  l[0][i] = b.l[0], l[1][i] = b.l[1];
}

std::vector<Transmission> find_transmissions(const Model& model, const std::vector<double>& scaled_rows,
                                             const std::vector<std::vector<int>>& hinges, const std::vector<std::uint8_t>& may) {
  const Finder finder(model, scaled_rows, hinges);
  std::vector<Transmission> all = finder.all(may);
  while (true) {
    const auto leaves = std::ranges::find_if(all, [&](const Transmission& t) { return finder.is_shared(t, all) || is_crowded(t, all); });
    if (leaves == all.end()) return all;
    all.erase(leaves);
  }
}

Vec3<double> axis_on_carrier(const Model& model, int body) {
  const SweepBody& b = model.bodies[place(body)];
  if (b.kind != BodyKernel::rotor) return b.O.R * b.axis;
  const double* u = model.axis_bodies[place(body)].u;
  return {u[0], u[1], u[2]};
}

}  // namespace cardan
