#include "core/model/embed_loops.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "core/model/embedding_stages.hpp"

namespace cardan {
namespace {

using namespace embedding_stages;

constexpr int kLongLoop = 6;        // free rates of a loop: beyond, eliminating them together loses digits that one by one keeps
constexpr double kUnlike = 10.0;    // scaled slopes of a coupling
constexpr double kWorth = 0.75;     // of the operations by rates, where loops share hinges: rates keep more digits
constexpr double kSafer = 1.25;     // ... of one loop of several free rates: multipliers keep more
constexpr std::size_t kTried = 64;  // sets whose two forms are compared by count

Embedding write_program(const Ways& ways, const ByRates& by_rates) {
  Avoided avoided(ways.model);
  while (true) {
    Embedding e;
    const Wheels wheels = place_wheels(ways, by_rates, avoided, e);
    const std::vector<int> owner = order_loops(ways, by_rates, wheels, e);
    const Branches branches = find_branches(ways, owner, avoided, e);
    place_numbers(ways, owner, branches, e);
    if (!write_steps(ways, wheels, owner, branches, avoided, e)) continue;
    place_side_by_side(ways.model, e);
    return e;
  }
}

/// Loops that share hinges, or modes of a body.
std::vector<LoopSet> sets_of(const Ways& ways) {
  const std::size_t n = ways.home.size(), bodies = ways.model.bodies.size();
  std::vector<int> of(n), on(2 * bodies, -1);  // hinges, then modes
  std::iota(of.begin(), of.end(), 0);
  const auto root = [&](int l) {
    while (of[at(l)] != l) l = of[at(l)];
    return l;
  };
  for (std::size_t l = 0; l < n; ++l) {
    const auto join = [&](int& first) {
      if (first < 0) {
        first = static_cast<int>(l);
      } else {
        const int a = root(first), b = root(static_cast<int>(l));
        of[at(std::max(a, b))] = std::min(a, b);
      }
    };
    for (const int k : ways.hinges[l]) join(on[at(k)]), join(on[bodies + at(k)]);
    if (ways.meets[l]) join(on[bodies + at(ways.home[l])]);
  }
  std::map<int, LoopSet> by_root;
  for (std::size_t l = 0; l < n; ++l) by_root[root(static_cast<int>(l))].loops.push_back(static_cast<int>(l));
  std::vector<LoopSet> out;
  for (auto& [first, set] : by_root) {
    for (const int l : set.loops)
      if (set.why.empty()) set.why = ways.modes_on_the_way(l);
    out.push_back(std::move(set));
  }
  return out;
}

int path_rates(const Ways& ways, int l) {
  int n = 0;
  for (const int k : ways.hinges[at(l)]) n += ways.body(k).nv;
  return n;
}
bool has_wheel(const Ways& ways, int l) {
  return std::ranges::any_of(ways.hinges[at(l)], [&](int k) { return ways.body(k).kind == BodyKernel::rotor; });
}
/// A coupling of rates that are much unlike, in the root of their energy: what is light accelerates without it so much more than with it
/// that multipliers lose digits.
bool has_light_rates(const Ways& ways, int l) {
  double most = 0.0, least = HUGE_VAL;
  for (const CoupledRate& term : ways.loop(l).coupling.terms)
    if (const double slope = std::abs(ways.rows[at(ways.loop(l).first) * at(ways.model.nv) + at(term.v)]); slope > 0.0)
      most = std::max(most, slope), least = std::min(least, slope);
  return most > kUnlike * least;
}

/// Why wheels do what a coupling asks for, per loop; null: they do not.
std::vector<const char*> turned_by_wheels(const Ways& ways, const Embedding& e) {
  std::vector<const char*> why(ways.home.size(), nullptr);
  for (std::size_t l = 0; l < why.size(); ++l)
    if (std::ranges::find(e.gears, ways.model.loops.all[l].first, &Gear::row) != e.gears.end())
      why[l] = "a wheel geared to a hinge beside it";
  for (const Transmission& t : e.transmissions)
    for (const Transmission::Row& row : t.rows) why[at(row.loop)] = "wheels that turn with hinges outboard of their carrier";
  return why;
}

}  // namespace

Embedding embed_loops(const Model& model, const std::vector<double>& scaled_rows, bool without_inertia, std::vector<LoopSet>& sets) {
  const Ways ways(model, scaled_rows);
  sets = sets_of(ways);
  ByRates by_rates(model.loops.all.size(), 1);
  std::size_t tried = 0;
  const auto light = [&](int l) { return has_wheel(ways, l) || has_light_rates(ways, l); };
  /// By multipliers where that takes fewer operations than so much of those by rates.
  const auto try_multipliers = [&](const LoopSet& set, double worth) {
    const long rates = write_program(ways, by_rates).flops;
    for (const int i : set.loops) by_rates[at(i)] = 0;
    const bool fewer = static_cast<double>(write_program(ways, by_rates).flops) < worth * static_cast<double>(rates);
    for (const int i : set.loops) by_rates[at(i)] = !fewer;
  };
  for (LoopSet& set : sets) {
    set.form = "rates";
    const int l = set.loops[0];
    const int left = path_rates(ways, l) - model.loops.all[at(l)].rows;
    if (!set.why.empty()) {  // modes on the way
      for (const int i : set.loops) by_rates[at(i)] = 0;
    } else if (without_inertia) {  // hinges that multipliers would have eliminated may have none of their own
      set.why = "the open tree has a direction without inertia";
    } else if (set.loops.size() > 1) {
      set.why = "they share hinges";
      if (std::ranges::none_of(set.loops, light) && tried++ < kTried) try_multipliers(set, kWorth);
    } else if (has_wheel(ways, l)) {
      set.why = "a wheel behind a gear";
    } else if (left > kLongLoop) {
      by_rates[at(l)] = 0;
      set.why = "a long way";
    } else if (left > 1 && !light(l) && tried++ < kTried) {
      try_multipliers(set, kSafer);
    }
    if (!by_rates[at(l)]) set.form = "multipliers in the sweep";
  }
  Embedding embedding = write_program(ways, by_rates);
  const std::vector<const char*> turned = turned_by_wheels(ways, embedding);
  for (LoopSet& set : sets)
    if (const char* why = turned[at(set.loops[0])]) set.why = why;
  return embedding;
}

Embedding embed_loops(const Model& model, const std::vector<double>& scaled_rows, const std::vector<std::uint8_t>& by_rates) {
  return write_program(Ways(model, scaled_rows), by_rates);
}

}  // namespace cardan
