#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

#include "core/model/embedding_stages.hpp"

namespace cardan::embedding_stages {
namespace {

/// Rank of the rows of one loop after another, each beside those before it.
class Ranks {
 public:
  /// `dependent`: scaled pivots below are none (Loops::dependent).
  Ranks(const std::vector<double>& B, int rows, int columns, double dependent)
      : B_(B), rows_(rows), columns_(columns), dependent_(dependent) {}
  /// `kept`: the rows that count, of these n.
  int take(int first, int n, std::vector<int>* kept = nullptr) {
    int rank = 0;
    std::vector<std::uint8_t> used(at(n));
    for (int p = 0; p < n; ++p) {
      int row = -1, column = -1;
      double most = dependent_;
      for (int i = 0; i < n; ++i)
        for (int j = 0; !used[at(i)] && j < columns_; ++j)
          if (const double x = std::abs(b(first + i, j)); x > most) most = x, row = first + i, column = j;
      if (row < 0) break;
      used[at(row - first)] = 1, ++rank;
      if (kept) kept->push_back(row - first);
      for (int i = 0; i < rows_; ++i) {
        if (i == row || b(i, column) == 0.0) continue;
        const double factor = b(i, column) / b(row, column);
        for (int j = 0; j < columns_; ++j) b(i, j) -= factor * b(row, j);
        b(i, column) = 0.0;
      }
    }
    return rank;
  }

 private:
  double& b(int i, int j) { return B_[at(i) * at(columns_) + at(j)]; }
  std::vector<double> B_;
  int rows_, columns_;
  double dependent_;
};

class Order {
 public:
  Order(const Ways& ways, const ByRates& by_rates, const Wheels& wheels, Embedding& e)
      : ways_(ways),
        by_rates_(by_rates),
        e_(e),
        ranks_(ways.rows, ways.model.loops.rows, ways.model.nv, ways.model.loops.dependent),
        done_(wheels.taken) {
    owner_.assign(ways.model.bodies.size(), -1);
    by_.assign(at(ways.model.nv), -1), column_.assign(at(ways.model.nv), -1);
  }

  std::vector<int> all() {
    std::vector<int> homes(ways_.home);
    std::ranges::sort(homes, std::greater<>());
    homes.erase(std::unique(homes.begin(), homes.end()), homes.end());
    for (const int home : homes)
      for (int next = next_of(home); next >= 0; next = next_of(home)) {
        done_[at(next)] = 1;
        EmbeddedLoop c = begun(next);
        if (c.by_rates)
          take_up(c);
        else
          push(c);
        e_.loops.push_back(std::move(c));
      }
    for (EmbeddedLoop& c : e_.loops) c.implied = implied_ && c.by_rates;
    return std::move(owner_);
  }

 private:
  /// Of those with this home, the one with the fewest inputs. -1: all are done.
  int next_of(int home) const {
    int next = -1, least = 0;
    for (std::size_t l = 0; l < done_.size(); ++l) {
      if (done_[l] || ways_.home[l] != home) continue;
      const int inputs = by_rates_[l] ? inputs_of(l) : 0;
      if (next < 0 || inputs < least) next = static_cast<int>(l), least = inputs;
    }
    return next;
  }
  int inputs_of(std::size_t l) const {
    int inputs = 0;
    std::set<int> taken;
    for (const int k : ways_.hinges[l]) {
      const SweepBody& b = ways_.body(k);
      for (int j = 0; owner_[at(k)] < 0 && j < b.nv; ++j) inputs += !ways_.is_given(b.v + j);
      for (int j = 0; j < b.nv; ++j)
        if (const int by = by_[at(b.v + j)]; by >= 0 && taken.insert(by).second) inputs += e_.loops[at(by)].keep;
    }
    return inputs;
  }

  /// What a loop has however it is closed.
  EmbeddedLoop begun(int l) {
    const Model& m = ways_.model;
    const Loop& loop = ways_.loop(l);
    EmbeddedLoop c;
    c.loop = l, c.by_rates = by_rates_[at(l)] != 0, c.home = ways_.home[at(l)];
    c.closing = loop.closing, c.first = loop.first;
    c.length = loop.length, c.lever = loop.lever, c.reference = loop.reference;
    c.coupling = loop.coupling, c.drive = loop.drive;
    if (c.closing == Closing::hinge && loop.hinge->shape == CARDAN_SHAPE_ROTATION) {
      double u[3], pitch;
      loop.hinge->axis(loop.packed.data(), u, &pitch);
      c.turns = true, c.axis = {u[0], u[1], u[2]};
    }
    c.gradient = e_.n_gradients, e_.n_gradients += static_cast<int>(loop.coupling.terms.size());
    const auto place_of = [&](const LoopEnd& end) { return end.node >= 0 ? m.nodes[at(end.node)].shapes.pose : end.pose; };
    c.from = place_of(loop.from), c.to = place_of(loop.to);
    c.after_modes = ways_.meets[at(l)];
    std::vector<int> kept;
    c.rows = loop.rows, c.rank = ranks_.take(loop.first, loop.rows, &kept);
    const auto begin = ways_.rows.begin() + loop.first * m.nv;
    Ranks alone({begin, begin + loop.rows * m.nv}, loop.rows, m.nv, m.loops.dependent);
    if (alone.take(0, loop.rows) > c.rank) {
      if (c.by_rates)
        implied_ = true;
      else
        c.kept = std::move(kept), c.chosen = e_.chosen = true;
    }
    if (loop.closing == Closing::coupling)
      find_coupled(c);
    else
      find_path(c);
    for (EmbeddedLoop::Column& x : c.columns) x.given = ways_.is_given(x.v);
    c.own_columns = static_cast<int>(c.columns.size());
    return c;
  }

  void find_coupled(EmbeddedLoop& c) const {
    for (const int k : ways_.hinges[at(c.loop)]) {
      const SweepBody& b = ways_.body(k);
      EmbeddedLoop::PathBody p;
      p.body = k, p.column = static_cast<int>(c.columns.size()), p.n = b.nv;
      if (const auto on = std::ranges::find(c.path, b.parent, &EmbeddedLoop::PathBody::body); on != c.path.end())
        p.inboard = static_cast<int>(on - c.path.begin());
      for (int j = 0; j < b.nv; ++j) {
        const std::vector<CoupledRate>& terms = c.coupling.terms;
        const auto term = std::ranges::find(terms, b.v + j, &CoupledRate::v);
        c.columns.push_back({b.v + j, -1, -1, -1, term == terms.end() ? -1 : static_cast<int>(term - terms.begin())});
      }
      c.path.push_back(p);
    }
  }
  void find_path(EmbeddedLoop& c) const {
    const Loop& loop = ways_.loop(c.loop);
    for (const std::vector<int>* path : {&loop.from_path, &loop.to_path}) {
      int inboard = -1;
      for (std::size_t i = 0; i < path->size(); ++i) {
        const int k = (*path)[i];
        const SweepBody& b = ways_.body(k);
        EmbeddedLoop::PathBody p;
        p.body = k, p.inboard = inboard, p.column = static_cast<int>(c.columns.size()), p.n = b.nv;
        p.sign = path == &loop.from_path ? -1.0 : 1.0;
        p.shifts = ways_.shifts(k);
        for (int j = 0; j < b.nv; ++j) c.columns.push_back({b.v + j});
        // Where it deforms: at its pnode, at the onode of what comes next, at the end.
        const LoopEnd& end = path == &loop.from_path ? loop.from : loop.to;
        const bool moves = ways_.deforms(b.pnode) || (i + 1 < path->size() ? ways_.body((*path)[i + 1]).onode >= 0 : ways_.deforms(end));
        if (b.n_modes > 0 && moves) p.modes = modes(b, c);
        inboard = static_cast<int>(c.path.size());
        c.path.push_back(p);
      }
      (path == &loop.from_path ? c.from_at : c.to_at) = inboard;
    }
    if (c.after_modes) c.home_modes = modes(ways_.body(c.home), c);
    if (ways_.deforms(loop.from)) c.from_node = loop.from.node;
    if (ways_.deforms(loop.to)) c.to_node = loop.to.node;
  }
  static int modes(const SweepBody& b, EmbeddedLoop& c) {
    const int column = static_cast<int>(c.columns.size());
    for (int j = 0; j < b.n_modes; ++j) c.columns.push_back({b.etadot + j});
    c.deforms = true;
    return column;
  }

  /// By multipliers in the sweep.
  void push(EmbeddedLoop& c) const {
    c.n = c.rank;
    for (EmbeddedLoop::Column& x : c.columns) x.scale = x.given ? 0.0 : ways_.model.loops.column_scale[at(x.v)];
  }

  /// By rates: its inputs are rates that nobody had, and what is left of others.
  void take_up(EmbeddedLoop& c) {
    const int self = static_cast<int>(e_.loops.size());
    std::set<int> taken;
    for (EmbeddedLoop::Column& x : c.columns) {
      const auto v = at(x.v);
      if (x.given) continue;
      if (owner_[at(ways_.body_of[v])] < 0)
        x.input = c.inputs++;
      else
        x.by = by_[v], x.at = column_[v], taken.insert(by_[v]);
    }
    for (const int k : ways_.hinges[at(c.loop)])
      if (owner_[at(k)] < 0) owner_[at(k)] = self;
    for (const int b : taken) {
      EmbeddedLoop& other = e_.loops[at(b)];
      other.consumer = self, other.consumer_input = c.inputs;
      c.taken.push_back({b, c.inputs, other.keep});
      c.inputs += other.keep;
    }
    c.constant = c.closing == Closing::coupling && c.coupling.is_linear() && c.drive < 0 &&
                 std::ranges::none_of(c.columns, &EmbeddedLoop::Column::given) &&
                 std::ranges::all_of(taken, [&](int b) { return e_.loops[at(b)].constant; });
    c.n = c.inputs - c.rank;
    sort_inputs(c, needed_of(c, taken));
    for (EmbeddedLoop::Column& x : c.columns)
      if (x.by >= 0) x.as = input_of(e_.loops[at(x.by)], x.at);
    c.keep = std::min(c.needed, c.n);
    for (std::size_t i = 0; i < c.columns.size(); ++i)
      if (!c.columns[i].given) by_[at(c.columns[i].v)] = self, column_[at(c.columns[i].v)] = static_cast<int>(i);
    for (EmbeddedLoop::Column& x : c.columns) x.scale = ways_.model.loops.column_scale[at(x.v)];
  }

  /// Inputs that later loops have; rates of theirs that this loop takes from others become columns of it.
  std::set<int> needed_of(EmbeddedLoop& c, const std::set<int>& taken) const {
    std::set<int> later;  // rates
    for (std::size_t l = 0; l < done_.size(); ++l)
      if (!done_[l])
        for (const int k : ways_.hinges[l])
          for (int j = 0; j < ways_.body(k).nv; ++j)
            if (const int v = ways_.body(k).v + j; !ways_.is_given(v)) later.insert(v);
    std::set<int> needed;
    for (const EmbeddedLoop::Column& x : c.columns)
      if (x.input >= 0 && later.contains(x.v)) needed.insert(x.input);
    for (const int v : later) {
      if (by_[at(v)] < 0 || !taken.contains(by_[at(v)])) continue;
      for (const EmbeddedLoop::Taken& t : c.taken)
        if (t.by == by_[at(v)])
          for (int i = 0; i < t.n; ++i) needed.insert(t.input + i);
      if (std::ranges::find(c.columns, v, &EmbeddedLoop::Column::v) == c.columns.end())
        c.columns.push_back({v, -1, by_[at(v)], column_[at(v)]});
    }
    return needed;
  }

  /// Inputs of a loop: those that it alone has, those that later loops have, the others.
  void sort_inputs(EmbeddedLoop& c, const std::set<int>& needed) {
    std::vector<int> rank(at(c.inputs), 2), to(at(c.inputs));
    for (const EmbeddedLoop::Column& x : c.columns)
      if (x.input >= 0) rank[at(x.input)] = 0;
    for (const int i : needed) rank[at(i)] = 1;
    int next = 0;
    for (int r = 0; r < 3; ++r)
      for (std::size_t i = 0; i < rank.size(); ++i)
        if (rank[i] == r) to[i] = next++;
    c.own = static_cast<int>(std::ranges::count(rank, 0)), c.needed = static_cast<int>(needed.size());
    for (EmbeddedLoop::Column& x : c.columns)
      if (x.input >= 0) x.input = to[at(x.input)];
    for (EmbeddedLoop::Taken& t : c.taken)  // all of one alike
      if (t.n > 0) e_.loops[at(t.by)].consumer_input = t.input = to[at(t.input)];
    if (c.own == c.inputs || c.own < c.rank) return;
    if (!std::ranges::all_of(c.taken, [&](const EmbeddedLoop::Taken& t) { return e_.loops[at(t.by)].by_own; })) return;
    std::vector<double> own;
    for (int i = 0; i < c.rows; ++i)
      for (const EmbeddedLoop::Column& x : c.columns)
        if (x.input >= 0 && x.input < c.own) own.push_back(ways_.rows[at(c.first + i) * at(ways_.model.nv) + at(x.v)]);
    c.by_own = Ranks(own, c.rows, c.own, ways_.model.loops.dependent).take(0, c.rows) == c.rank;
  }

  /// Which input of the loop after `c` a column of `c` is, where its coordinates are its inputs beside its own ones. -1: none.
  static int input_of(const EmbeddedLoop& c, int column) {
    const EmbeddedLoop::Column& x = c.columns[at(column)];
    const int coordinate = (x.input >= 0 ? x.input : x.as) - c.own;
    return c.by_own && coordinate >= 0 && coordinate < c.keep ? c.consumer_input + coordinate : -1;
  }

  const Ways& ways_;
  const ByRates& by_rates_;
  Embedding& e_;
  Ranks ranks_;
  bool implied_ = false;
  std::vector<std::uint8_t> done_;  // per loop
  std::vector<int> owner_;          // per body
  std::vector<int> by_, column_;    // per rate: in whose coordinates it is expressed last, and which column of that it is
};

}  // namespace

std::vector<int> order_loops(const Ways& ways, const ByRates& by_rates, const Wheels& wheels, Embedding& e) {
  return Order(ways, by_rates, wheels, e).all();
}

}  // namespace cardan::embedding_stages
