#include <algorithm>

#include "core/model/embedding_stages.hpp"

namespace cardan::embedding_stages {

Branches find_branches(const Ways& ways, const std::vector<int>& owner, Avoided& avoided, const Embedding& e) {
  const std::size_t bodies = owner.size();
  Branches out{std::vector<int>(bodies, 0), std::vector<int>(bodies, -1), std::vector<int>(bodies, 0)};
  const auto is_rotor = [&](std::size_t k) { return ways.model.bodies[k].kind == BodyKernel::rotor; };
  for (std::size_t k = 1; k < bodies; ++k) {
    if (owner[k] < 0) continue;
    const EmbeddedLoop& c = e.loops[at(owner[k])];
    const int p = ways.model.bodies[k].parent;
    const bool passes = p != c.home && p > 0 && ways.stops[k] == 0 && owner[at(p)] >= 0 && !is_rotor(k) &&
                        std::ranges::find(c.path, p, &EmbeddedLoop::PathBody::body) != c.path.end();
    out.base[k] = passes ? out.base[at(p)] : p;
  }
  std::vector<int> rates(bodies, 0), carried(bodies, 0);
  for (std::size_t k = 1; k < bodies; ++k) {
    if (owner[k] < 0 || is_rotor(k)) continue;
    const auto p = at(ways.model.bodies[k].parent);
    const bool first = at(out.base[k]) == p;
    if (!first && (out.branch[p] < 0 || owner[p] != owner[k])) continue;
    const int b = out.branch[k] = first ? static_cast<int>(k) : out.branch[p];
    out.tip[at(b)] = static_cast<int>(k);
    rates[at(b)] += ways.model.bodies[k].nv;
    if (!first && ++carried[p] > 1) avoided.plain[at(b)] = 1;  // a fork
  }
  for (std::size_t k = 1; k < bodies; ++k)
    if (const int b = out.branch[k]; b >= 0) {
      const int n = rates[at(b)], most = std::min(EmbeddingStep::kBranchRates, e.loops[at(owner[k])].n);
      if (avoided.plain[at(b)] || n < 2 || n > most) out.branch[k] = -1;  // beyond, these are more columns than one by one
    }
  return out;
}

namespace {

/// Loops with the same home share what they have found of rigid bodies on their ways.
class SharedWays {
 public:
  SharedWays(const Model& model, int& n) : model_(model), n_(n), home_(model.bodies.size(), -1), state_(model.bodies.size(), 0) {}
  void place(EmbeddedLoop& c) {
    if (c.closing == Closing::coupling) return;
    for (EmbeddedLoop::PathBody& p : c.path) {
      const auto k = at(p.body);
      const bool rigid = !is_general(model_.bodies[k].kind) && (p.inboard < 0 || home_[at(c.path[at(p.inboard)].body)] == c.home);
      p.seen = rigid && home_[k] == c.home;
      p.state = p.seen ? state_[k] : n_++;
      if (rigid) home_[k] = c.home, state_[k] = p.state;
    }
  }

 private:
  const Model& model_;
  int& n_;                         // states so far
  std::vector<int> home_, state_;  // per body: the home of the last loop that has found its state, and where that stands
};

/// Operations of the way, columns, pivots, expressions and motions of a loop.
long flops_of(const EmbeddedLoop& c) {
  const int geometric = c.closing == Closing::coupling ? 0 : 1;
  const long found = std::ranges::count(c.path, false, &EmbeddedLoop::PathBody::seen);
  long flops = geometric * (100L * found + c.own_columns * (15 + 11L * c.rows) + 60);
  if (!c.by_rates) return flops;
  flops += 2L * c.rank * c.rows * (c.inputs + 1) + 2L * c.inputs * (c.n + 1) + std::ssize(c.columns) * (c.n + 1);
  for (const EmbeddedLoop::PathBody& p : c.path)
    if (p.motion >= 0) flops += (c.n + 1) * (36L + 12L * p.n);
  return flops;
}

}  // namespace

void place_numbers(const Ways& ways, const std::vector<int>& owner, const Branches& branches, Embedding& e) {
  const auto take = [&](int& begin, int n) { begin = e.n_numbers, e.n_numbers += n; };
  for (EmbeddedLoop& c : e.loops) c.width = padded(c.n + 1), take(c.A, c.n * c.width);
  SharedWays shared(ways.model, e.n_path);
  for (std::size_t i = 0; i < e.loops.size(); ++i) {
    EmbeddedLoop& c = e.loops[i];
    // Motions: of the bodies that a loop has taken up one by one, and of those that carry them as far as what they are assembled on.
    const auto wants = [&](auto&& self, EmbeddedLoop::PathBody& p) -> int {
      if (p.motion >= 0) return p.motion;
      if (ways.body(p.body).parent != branches.base[at(p.body)]) p.of_inboard = self(self, c.path[at(p.inboard)]);
      p.motion = e.n_U, e.n_U += c.n + 1;
      return p.motion;
    };
    for (EmbeddedLoop::PathBody& p : c.path)
      if (c.by_rates && owner[at(p.body)] == static_cast<int>(i) && branches.branch[at(p.body)] < 0) wants(wants, p);
    take(c.G, c.rows * c.own_columns), take(c.B, c.rows * padded((c.by_rates ? c.inputs : c.own_columns) + 1));
    if (c.by_rates) take(c.T, c.inputs * c.width), take(c.E, static_cast<int>(c.columns.size()) * c.width);
    c.x = e.n_x, e.n_x += c.n;
    c.row = e.n_rows, e.n_rows += c.rows;
    c.pivot = e.n_pivots, e.n_pivots += c.by_rates ? c.inputs : c.own_columns;
    shared.place(c);
    e.flops += flops_of(c);
  }
}

}  // namespace cardan::embedding_stages
