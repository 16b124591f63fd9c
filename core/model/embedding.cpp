#include "core/model/embedding.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <set>
#include <span>

#include "core/model/model.hpp"

namespace cardan {
namespace {

constexpr double kNoPivot = 1e-10;  // of scaled rows, as elsewhere (docs/mathematics/loops.md, 2)
constexpr int kLongLoop = 6;        // free rates of a loop: beyond, eliminating them together loses digits that one by one keeps
constexpr double kUnlike = 10.0;    // scaled slopes of a coupling
constexpr double kWorth = 0.75;     // of the operations by rates, where loops share hinges: rates keep more digits
constexpr double kSafer = 1.25;     // ... of one loop of several free rates: multipliers keep more
constexpr int kWheel = -2;          // of a transmission, among bodies
constexpr std::size_t kTried = 64;  // sets whose two forms are compared by count

template <class Int>
std::size_t at(Int i) {
  return static_cast<std::size_t>(i);
}

/// Rank of the rows of one loop after another, each beside those before it.
class Ranks {
 public:
  Ranks(const std::vector<double>& B, int rows, int columns) : B_(B), rows_(rows), columns_(columns) {}
  /// `kept`: the rows that count, of these n.
  int take(int first, int n, std::vector<int>* kept = nullptr) {
    int rank = 0;
    std::vector<std::uint8_t> used(at(n));
    for (int p = 0; p < n; ++p) {
      int row = -1, column = -1;
      double most = kNoPivot;
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
};

class Embedder {
 public:
  Embedder(const Model& model, const std::vector<double>& scaled_rows) : m_(model), rows_(scaled_rows) {
    const std::size_t bodies = m_.bodies.size();
    body_of_.assign(at(m_.nv), 0);
    for (std::size_t k = 1; k < bodies; ++k)
      for (int j = 0; j < m_.bodies[k].nv; ++j) body_of_[at(m_.bodies[k].v + j)] = static_cast<int>(k);
    stops_.assign(bodies, 0);
    crossed_.assign(m_.loops.all.size(), 0), plain_.assign(bodies, 0);
    hinges_.resize(m_.loops.all.size()), home_.resize(m_.loops.all.size()), meets_.resize(m_.loops.all.size());
    for (std::size_t l = 0; l < m_.loops.all.size(); ++l) {
      const Loop& loop = m_.loops.all[l];
      std::vector<int>& on = hinges_[l];
      home_[l] = loop.home;
      if (loop.closing == Closing::coupling) {
        for (const CoupledRate& term : loop.coupling.terms)
          if (const int k = body_of_[at(term.v)]; std::ranges::find(on, k) == on.end()) on.push_back(k);
        int home = m_.bodies[at(on[0])].parent;
        for (const int k : on) home = ancestor(home, m_.bodies[at(k)].parent);
        home_[l] = home;
      } else {
        on = loop.from_path;
        on.insert(on.end(), loop.to_path.begin(), loop.to_path.end());
      }
      std::ranges::sort(on);
      meets_[l] = meets_modes_of_home(static_cast<int>(l));
      if (loop.closing == Closing::coupling) stop_at_gaps(static_cast<int>(l));
    }
  }

  std::vector<LoopSet> sets() {
    const std::size_t n = m_.loops.all.size(), bodies = m_.bodies.size();
    std::vector<int> of(n), on(2 * bodies, -1);  // hinges, then modes
    std::iota(of.begin(), of.end(), 0);
    const auto root = [&](int l) {
      while (of[at(l)] != l) l = of[at(l)];
      return l;
    };
    for (std::size_t l = 0; l < n; ++l) {
      const auto join = [&](int& first) {
        if (first < 0)
          first = static_cast<int>(l);
        else {
          const int a = root(first), b = root(static_cast<int>(l));
          of[at(std::max(a, b))] = std::min(a, b);
        }
      };
      for (const int k : hinges_[l]) join(on[at(k)]), join(on[bodies + at(k)]);
      if (meets_[l]) join(on[bodies + at(home_[l])]);
    }
    std::map<int, LoopSet> by_root;
    for (std::size_t l = 0; l < n; ++l) by_root[root(static_cast<int>(l))].loops.push_back(static_cast<int>(l));
    std::vector<LoopSet> out;
    for (auto& [first, set] : by_root) out.push_back(std::move(set));
    return out;
  }

  /// Why the rates of a loop cannot be its coordinates: modes are on its way. Empty: they can.
  std::string modes_on_the_way(int l) const {
    const Loop& loop = m_.loops.all[at(l)];
    const auto name = [&](int k) { return m_.user[at(m_.owner[at(k)])].name; };
    for (const int k : hinges_[at(l)]) {
      const SweepBody& b = m_.bodies[at(k)];
      if (b.n_modes > 0) return fmt::format("{}: {} is flexible", loop.name, name(k));
      if (b.onode >= 0) return fmt::format("{}: {} hangs on a flexible body", loop.name, name(k));
    }
    if (meets_[at(l)]) return fmt::format("{}: {} is flexible", loop.name, name(home_[at(l)]));
    return {};
  }

  int path_rates(int l) const {
    int n = 0;
    for (const int k : hinges_[at(l)]) n += m_.bodies[at(k)].nv;
    return n;
  }
  bool has_wheel(int l) const {
    return std::ranges::any_of(hinges_[at(l)], [&](int k) { return m_.bodies[at(k)].kind == BodyKernel::rotor; });
  }
  /// A coupling of rates that are much unlike, in the root of their energy: what is light accelerates without it so much more than with it
  /// that multipliers lose digits.
  bool has_light_rates(int l) const {
    const Loop& loop = m_.loops.all[at(l)];
    double most = 0.0, least = HUGE_VAL;
    for (const CoupledRate& term : loop.coupling.terms)
      if (const double slope = std::abs(rows_[at(loop.first) * at(m_.nv) + at(term.v)]); slope > 0.0)
        most = std::max(most, slope), least = std::min(least, slope);
    return most > kUnlike * least;
  }

  /// by_rates: per loop.
  Embedding build(const std::vector<std::uint8_t>& by_rates) {
    while (true) {
      e_ = {};
      order(by_rates);
      find_branches();
      place_numbers();
      if (!write_steps()) continue;
      place_side_by_side();
      place_rows_side_by_side();
      return std::move(e_);
    }
  }

 private:
  bool deforms(int shapes) const { return shapes >= 0 && m_.shapes[at(shapes)].deforms(); }
  bool deforms(const LoopEnd& end) const { return end.node >= 0 && m_.nodes[at(end.node)].shapes.deforms(); }

  /// What a multiplier of a coupling does to a rate: whose, and where EmbeddingWork::gradients has by how much.
  struct Couple {
    int by, v, gradient;
  };

  /// The modes of home move one end against the other, or what moves them pushes these modes.
  bool meets_modes_of_home(int l) const {
    const Loop& loop = m_.loops.all[at(l)];
    const int home = home_[at(l)];
    if (m_.bodies[at(home)].n_modes == 0) return false;
    if (loop.closing != Closing::coupling &&
        ((loop.from.sweep == home && deforms(loop.from)) || (loop.to.sweep == home && deforms(loop.to))))
      return true;
    return std::ranges::any_of(hinges_[at(l)], [&](int k) {
      while (m_.bodies[at(k)].parent != home) k = m_.bodies[at(k)].parent;
      return m_.bodies[at(k)].onode >= 0;
    });
  }

  /// A coupling may leave out hinges on the way from those that it has to where they part. What another loop moves such a body by is then
  /// counted from its inboard body: coordinates of the coupling pass there, and are eliminated at home, where they must have all that is
  /// theirs.
  void stop_at_gaps(int l) {
    const auto has = [&](int k) { return k == home_[at(l)] || std::ranges::binary_search(hinges_[at(l)], k); };
    for (int k : hinges_[at(l)])
      for (; k != home_[at(l)]; k = m_.bodies[at(k)].parent)
        if (has(k) != has(m_.bodies[at(k)].parent)) stops_[at(k)] = 1;
  }

  int ancestor(int a, int b) const {
    while (a != b) (a > b ? a : b) = m_.bodies[at(std::max(a, b))].parent;
    return a;
  }
  int closed_as(int loop) const { return index_[at(loop)]; }

  // Kinematics: who takes up which rates, and what becomes of them.
  void order(const std::vector<std::uint8_t>& by_rates) {
    const std::size_t n = m_.loops.all.size();
    Ranks ranks(rows_, m_.loops.rows, m_.nv);
    owner_.assign(m_.bodies.size(), -1);
    std::vector<int> by(at(m_.nv), -1), column(at(m_.nv), -1);  // in whose coordinates a rate is expressed last
    std::vector<std::uint8_t> done(n);
    index_.assign(n, -1);
    mesh(by_rates, done);
    std::vector<int> homes(home_);
    std::ranges::sort(homes, std::greater<>());
    homes.erase(std::unique(homes.begin(), homes.end()), homes.end());
    const auto inputs_of = [&](std::size_t l) {
      int inputs = 0;
      std::set<int> taken;
      for (const int k : hinges_[l]) {
        for (int j = 0; owner_[at(k)] < 0 && j < m_.bodies[at(k)].nv; ++j) inputs += !is_given(m_.bodies[at(k)].v + j);
        for (int j = 0; j < m_.bodies[at(k)].nv; ++j)
          if (const int b = by[at(m_.bodies[at(k)].v + j)]; b >= 0 && taken.insert(b).second) inputs += e_.loops[at(b)].keep;
      }
      return inputs;
    };
    for (const int home : homes)
      while (true) {
        int next = -1, least = 0;
        for (std::size_t l = 0; l < n; ++l) {
          if (done[l] || home_[l] != home) continue;
          const int inputs = by_rates[l] ? inputs_of(l) : 0;
          if (next < 0 || inputs < least) next = static_cast<int>(l), least = inputs;
        }
        if (next < 0) break;
        done[at(next)] = 1;
        const Loop& loop = m_.loops.all[at(next)];
        EmbeddedLoop c;
        const int self = static_cast<int>(e_.loops.size());
        index_[at(next)] = self;
        c.loop = next, c.by_rates = by_rates[at(next)] != 0, c.home = home;
        c.closing = loop.closing, c.first = loop.first;
        c.length = loop.length, c.lever = loop.lever, c.reference = loop.reference;
        c.coupling = loop.coupling, c.drive = loop.drive;
        if (c.closing == Closing::hinge && loop.hinge->shape == CARDAN_SHAPE_ROTATION) {
          double u[3], pitch;
          loop.hinge->axis(loop.packed.data(), u, &pitch);
          c.turns = true, c.axis = {u[0], u[1], u[2]};
        }
        c.gradient = e_.n_gradients, e_.n_gradients += static_cast<int>(loop.coupling.terms.size());
        c.from = place_of(loop.from), c.to = place_of(loop.to);
        c.after_modes = meets_[at(next)];
        std::vector<int> kept;
        c.rows = loop.rows, c.rank = ranks.take(loop.first, loop.rows, &kept);
        find_path(loop, next, c);
        for (EmbeddedLoop::Column& x : c.columns) x.given = is_given(x.v);
        if (!c.by_rates) {
          c.n = c.rank;
          const auto begin = rows_.begin() + loop.first * m_.nv;
          Ranks alone({begin, begin + loop.rows * m_.nv}, loop.rows, m_.nv);
          if (alone.take(0, loop.rows) > c.rank) c.kept = kept, c.chosen = e_.chosen = true;
          c.own_columns = static_cast<int>(c.columns.size());
          for (EmbeddedLoop::Column& x : c.columns) x.scale = x.given ? 0.0 : m_.loops.column_scale[at(x.v)];
          e_.loops.push_back(std::move(c));
          continue;
        }
        // Inputs: rates that nobody had, and what is left of others.
        std::set<int> taken;
        for (EmbeddedLoop::Column& x : c.columns) {
          const auto v = at(x.v);
          if (x.given) continue;
          if (owner_[at(body_of_[v])] < 0)
            x.input = c.inputs++;
          else
            x.by = by[v], x.at = column[v], taken.insert(by[v]);
        }
        for (const int k : hinges_[at(next)])
          if (owner_[at(k)] < 0) owner_[at(k)] = self;
        for (const int b : taken) {
          EmbeddedLoop& other = e_.loops[at(b)];
          other.consumer = self, other.consumer_input = c.inputs;
          c.taken.push_back({b, c.inputs, other.keep});
          c.inputs += other.keep;
        }
        c.own_columns = static_cast<int>(c.columns.size());
        c.constant = loop.closing == Closing::coupling && loop.coupling.is_linear() && loop.drive < 0 &&
                     std::ranges::none_of(c.columns, &EmbeddedLoop::Column::given) &&
                     std::ranges::all_of(taken, [&](int b) { return e_.loops[at(b)].constant; });
        c.n = c.inputs - c.rank;
        std::set<int> later;  // rates
        for (std::size_t l = 0; l < n; ++l)
          if (!done[l])
            for (const int k : hinges_[l])
              for (int j = 0; j < m_.bodies[at(k)].nv; ++j)
                if (const int v = m_.bodies[at(k)].v + j; !is_given(v)) later.insert(v);
        std::set<int> needed;
        for (const EmbeddedLoop::Column& x : c.columns)
          if (x.input >= 0 && later.contains(x.v)) needed.insert(x.input);
        for (const int v : later) {
          if (by[at(v)] < 0 || !taken.contains(by[at(v)])) continue;
          for (const EmbeddedLoop::Taken& t : c.taken)
            if (t.by == by[at(v)])
              for (int i = 0; i < t.n; ++i) needed.insert(t.input + i);
          if (std::ranges::find(c.columns, v, &EmbeddedLoop::Column::v) == c.columns.end())
            c.columns.push_back({v, -1, by[at(v)], column[at(v)]});
        }
        sort_inputs(c, needed);
        for (EmbeddedLoop::Column& x : c.columns)
          if (x.by >= 0) x.as = input_of(e_.loops[at(x.by)], x.at);
        c.keep = std::min(c.needed, c.n);
        for (std::size_t i = 0; i < c.columns.size(); ++i)
          if (!c.columns[i].given) by[at(c.columns[i].v)] = self, column[at(c.columns[i].v)] = static_cast<int>(i);
        for (EmbeddedLoop::Column& x : c.columns) x.scale = m_.loops.column_scale[at(x.v)];
        e_.loops.push_back(std::move(c));
      }
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
        if (x.input >= 0 && x.input < c.own) own.push_back(rows_[at(c.first + i) * at(m_.nv) + at(x.v)]);
    c.by_own = Ranks(own, c.rows, c.own).take(0, c.rows) == c.rank;
  }

  /// Which input of the loop after `c` a column of `c` is, where its coordinates are its inputs beside its own ones. -1: none.
  static int input_of(const EmbeddedLoop& c, int column) {
    const EmbeddedLoop::Column& x = c.columns[at(column)];
    const int coordinate = (x.input >= 0 ? x.input : x.as) - c.own;
    return c.by_own && coordinate >= 0 && coordinate < c.keep ? c.consumer_input + coordinate : -1;
  }

  // Wheels that turn with hinges.
  void mesh(const std::vector<std::uint8_t>& by_rates, std::vector<std::uint8_t>& done) {
    std::vector<std::uint8_t> may(by_rates);
    for (std::size_t l = 0; l < may.size(); ++l) may[l] = may[l] && !crossed_[l];
    turning_.assign(m_.bodies.size(), {});
    gear_of_.assign(m_.bodies.size(), -1), geared_of_.assign(m_.bodies.size(), -1), chain_of_.assign(m_.bodies.size(), -1);
    std::vector<Transmission> all = find_transmissions(m_, rows_, hinges_, may);
    for (const Transmission& t : all)
      for (const Transmission::Row& row : t.rows) {
        done[at(row.loop)] = 1;
        for (const std::vector<int>* bodies : {&t.wheels, &t.way})
          for (const int k : *bodies) turning_[at(k)].push_back(row.loop);
      }
    for (Transmission& t : all)
      if (is_gear(t))
        e_.gears.push_back(gear_of(t));
      else
        e_.transmissions.push_back(std::move(t));
    std::ranges::sort(e_.gears, std::greater<>(), &Gear::body);
    for (std::size_t i = 0; i < e_.gears.size(); ++i)
      gear_of_[at(e_.gears[i].body)] = gear_of_[at(e_.gears[i].wheel)] = static_cast<int>(i);
    place_wheels();
  }
  /// One wheel beside its hinge, with axes along each other, and no other wheel turns with it.
  bool is_gear(const Transmission& t) const {
    if (t.wheels.size() != 1 || t.way.size() != 1 || !t.rows[0].coupling.is_linear() || turning_[at(t.way[0])].size() != 1) return false;
    if (m_.bodies[at(t.wheels[0])].kind != BodyKernel::rotor) return false;
    const Vec3<double> across = cardan::cross(axis_on_carrier(m_, t.way[0]), axis_on_carrier(m_, t.wheels[0]));
    return dot(across, across) < 1e-30;  // but for rounding
  }
  Gear gear_of(const Transmission& t) const {
    const Transmission::Row& row = t.rows[0];
    Gear gear;
    gear.body = t.way[0], gear.wheel = t.wheels[0];
    gear.row = row.row, gear.drive = row.drive;
    gear.sense = dot(axis_on_carrier(m_, gear.body), axis_on_carrier(m_, gear.wheel)) > 0.0 ? 1.0 : -1.0;
    double slopes[2] = {};  // of the wheel, of the hinge
    for (std::size_t i = 0; i < row.column.size(); ++i) slopes[row.column[i]] += row.coupling.terms[i].coefficient;
    gear.ratio = -gear.sense * slopes[1] / slopes[0], gear.per_slope = 1.0 / slopes[0];
    const AxisBody& wheel = m_.axis_bodies[at(gear.wheel)];
    gear.v = wheel.v, gear.J_axial = wheel.J_axial;
    gear.coupled = gear.ratio * wheel.J_axial, gear.reflected = gear.ratio * gear.coupled;
    return gear;
  }
  void place_wheels() {
    struct Way {
      std::size_t transmission;
      int last = -1, at = 0;  // the hinge before, index into Embedding::geared, and which of its turns
    };
    std::vector<Way> ways;
    std::set<int, std::greater<>> hinges;
    for (std::size_t i = 0; i < e_.transmissions.size(); ++i) {
      Transmission& t = e_.transmissions[i];
      const int n = static_cast<int>(t.wheels.size()), along = static_cast<int>(t.way.size());
      t.numbers = e_.n_ratios, e_.n_ratios += n * (along + 1 + n);
      for (Transmission::Row& row : t.rows) row.angles = e_.n_angles, e_.n_angles += row.sinusoids.angles();
      for (int w = 0; w < n; ++w) {
        const int k = t.wheels[at(w)];
        const SweepBody& b = m_.bodies[at(k)];
        const AxisBody& a = m_.axis_bodies[at(k)];
        TurningWheel wheel{k, b.parent, b.v, a.J_axial, {a.u[0], a.u[1], a.u[2]}, t.numbers + n * along + w, 0};
        if (b.kind != BodyKernel::rotor) {
          const int axis = b.axis.x != 0.0 ? 0 : b.axis.y != 0.0 ? 1 : 2;
          wheel.on_ground = 1 + axis, wheel.u = {};
          wheel.J_axial = axis == 0 ? b.M_sweep.J.xx : axis == 1 ? b.M_sweep.J.yy : b.M_sweep.J.zz;
        }
        e_.wheels.push_back(wheel);
        ways.push_back({i});
        geared_of_[at(k)] = kWheel;
      }
      hinges.insert(t.way.begin(), t.way.end());
    }
    place_chains();
    for (const int k : hinges) {
      if (chain_of_[at(k)] >= 0) continue;
      GearedHinge hinge;
      hinge.body = k;
      std::vector<Way> before;
      for (std::size_t w = 0; w < ways.size(); ++w) {
        const Transmission& t = e_.transmissions[ways[w].transmission];
        const auto on = std::ranges::find(t.way, k);
        if (on == t.way.end()) continue;
        const auto along = static_cast<int>(t.way.size()),
                   which = static_cast<int>(std::ranges::find(t.wheels, e_.wheels[w].body) - t.wheels.begin());
        hinge.turns.push_back(
            {static_cast<int>(w), t.numbers + which * along + static_cast<int>(on - t.way.begin()), k == t.way.back(), k == t.way.front()});
        before.push_back(ways[w]);
        ways[w].last = static_cast<int>(e_.geared.size()), ways[w].at = static_cast<int>(before.size()) - 1;
      }
      for (const Way& a : before)
        for (const Way& b : before) {
          if (a.last < 0 || a.last != b.last)
            hinge.pairs.push_back(-1);
          else
            hinge.pairs.push_back(e_.geared[at(a.last)].A + a.at * static_cast<int>(e_.geared[at(a.last)].turns.size()) + b.at);
        }
      const int n = static_cast<int>(hinge.turns.size());
      hinge.A = e_.n_pairs, e_.n_pairs += n * (n + 1);
      geared_of_[at(k)] = static_cast<int>(e_.geared.size());
      e_.geared.push_back(std::move(hinge));
    }
  }

  /// Transmissions that share hinges and have one carrier, of few hinges.
  void place_chains() {
    std::vector<std::uint8_t> done(e_.transmissions.size());
    for (std::size_t i = 0; i < done.size(); ++i) {
      if (done[i]) continue;
      std::vector<std::size_t> all{i};
      std::set<int, std::greater<>> hinges;
      std::size_t longest = 0;
      bool one = true;  // carrier
      done[i] = 1;
      for (std::size_t next = 0; next < all.size(); ++next) {
        const Transmission& t = e_.transmissions[all[next]];
        hinges.insert(t.way.begin(), t.way.end());
        longest = std::max(longest, t.way.size());
        one = one && m_.bodies[at(t.way[0])].parent == m_.bodies[at(e_.transmissions[i].way[0])].parent;
        for (std::size_t j = 0; j < done.size(); ++j)
          if (!done[j] && std::ranges::any_of(e_.transmissions[j].way, [&](int k) { return hinges.contains(k); }))
            done[j] = 1, all.push_back(j);
      }
      if (!one || hinges.size() != longest || hinges.size() > GearedChain::kMost) continue;
      GearedChain chain;
      chain.hinges.assign(hinges.begin(), hinges.end());
      chain.carrier = m_.bodies[at(chain.hinges.back())].parent;
      for (const std::size_t j : all) {
        const Transmission& t = e_.transmissions[j];
        for (std::size_t w = 0; w < t.wheels.size(); ++w) {
          GearedChain::Wheel wheel;
          wheel.wheel = static_cast<int>(std::ranges::find(e_.wheels, t.wheels[w], &TurningWheel::body) - e_.wheels.begin());
          for (std::size_t h = 0; h < t.way.size(); ++h) {
            const auto on = std::ranges::find(chain.hinges, t.way[h]) - chain.hinges.begin();
            wheel.ratio[on] = t.numbers + static_cast<int>(w * t.way.size() + h);
          }
          chain.wheels.push_back(wheel);
        }
      }
      for (const int k : chain.hinges) chain_of_[at(k)] = static_cast<int>(e_.chains.size());
      e_.chains.push_back(std::move(chain));
    }
  }

  bool is_given(int v) const { return m_.has_prescribed() && m_.prescribed[at(v)]; }
  Pose<double> place_of(const LoopEnd& end) const { return end.node >= 0 ? m_.nodes[at(end.node)].shapes.pose : end.pose; }

  void find_path(const Loop& loop, int l, EmbeddedLoop& c) const {
    if (loop.closing == Closing::coupling) {
      for (const int k : hinges_[at(l)]) {
        const SweepBody& b = m_.bodies[at(k)];
        EmbeddedLoop::PathBody p;
        p.body = k, p.column = static_cast<int>(c.columns.size()), p.n = b.nv;
        if (const auto on = std::ranges::find(c.path, b.parent, &EmbeddedLoop::PathBody::body); on != c.path.end())
          p.inboard = static_cast<int>(on - c.path.begin());
        for (int j = 0; j < b.nv; ++j) {
          const std::vector<CoupledRate>& terms = loop.coupling.terms;
          const auto term = std::ranges::find(terms, b.v + j, &CoupledRate::v);
          c.columns.push_back({b.v + j, -1, -1, -1, term == terms.end() ? -1 : static_cast<int>(term - terms.begin())});
        }
        c.path.push_back(p);
      }
      return;
    }
    for (const std::vector<int>* path : {&loop.from_path, &loop.to_path}) {
      int inboard = -1;
      for (std::size_t i = 0; i < path->size(); ++i) {
        const int k = (*path)[i];
        const SweepBody& b = m_.bodies[at(k)];
        EmbeddedLoop::PathBody p;
        p.body = k, p.inboard = inboard, p.column = static_cast<int>(c.columns.size()), p.n = b.nv;
        p.sign = path == &loop.from_path ? -1.0 : 1.0;
        p.shifts = shifts(b);
        for (int j = 0; j < b.nv; ++j) c.columns.push_back({b.v + j});
        // Where it deforms: at its pnode, at the onode of what comes next, at the end.
        const LoopEnd& end = path == &loop.from_path ? loop.from : loop.to;
        const bool moves = deforms(b.pnode) || (i + 1 < path->size() ? m_.bodies[at((*path)[i + 1])].onode >= 0 : deforms(end));
        if (b.n_modes > 0 && moves) p.modes = modes(b, c);
        inboard = static_cast<int>(c.path.size());
        c.path.push_back(p);
      }
      (path == &loop.from_path ? c.from_at : c.to_at) = inboard;
    }
    if (c.after_modes) c.home_modes = modes(m_.bodies[at(c.home)], c);
    if (deforms(loop.from)) c.from_node = loop.from.node;
    if (deforms(loop.to)) c.to_node = loop.to.node;
  }
  /// A slide with the axes of the inboard body.
  static bool shifts(const SweepBody& b) {
    const Mat3<double>& R = b.O.R;
    return b.kind == BodyKernel::slide && R.xx == 1.0 && R.yy == 1.0 && R.zz == 1.0 && R.xy == 0.0 && R.xz == 0.0 && R.yx == 0.0 &&
           R.yz == 0.0 && R.zx == 0.0 && R.zy == 0.0;
  }
  static int modes(const SweepBody& b, EmbeddedLoop& c) {
    const int column = static_cast<int>(c.columns.size());
    for (int j = 0; j < b.n_modes; ++j) c.columns.push_back({b.etadot + j});
    c.deforms = true;
    return column;
  }

  /// What the bodies that loops have taken up are assembled on; chains of them that move by the hinge rates of one loop alone.
  void find_branches() {
    const std::size_t bodies = m_.bodies.size();
    base_.assign(bodies, 0);
    branch_.assign(bodies, -1), tip_.assign(bodies, 0);
    for (std::size_t k = 1; k < bodies; ++k) {
      if (owner_[k] < 0) continue;
      const EmbeddedLoop& c = e_.loops[at(owner_[k])];
      const int p = m_.bodies[k].parent;
      const bool passes = p != c.home && p > 0 && stops_[k] == 0 && owner_[at(p)] >= 0 && m_.bodies[k].kind != BodyKernel::rotor &&
                          std::ranges::find(c.path, p, &EmbeddedLoop::PathBody::body) != c.path.end();
      base_[k] = passes ? base_[at(p)] : p;
    }
    std::vector<int> rates(bodies, 0), carried(bodies, 0);
    for (std::size_t k = 1; k < bodies; ++k) {  // the innermost body of its chain
      if (owner_[k] < 0 || m_.bodies[k].kind == BodyKernel::rotor) continue;
      const auto p = at(m_.bodies[k].parent);
      const bool first = base_[k] == m_.bodies[k].parent;
      if (!first && (branch_[p] < 0 || owner_[p] != owner_[k])) continue;
      branch_[k] = first ? static_cast<int>(k) : branch_[p];
      tip_[at(branch_[k])] = static_cast<int>(k);
      rates[at(branch_[k])] += m_.bodies[k].nv;
      if (!first && ++carried[p] > 1) plain_[at(branch_[k])] = 1;  // a fork
    }
    for (std::size_t k = 1; k < bodies; ++k)
      if (const int b = branch_[k]; b >= 0) {
        const int n = rates[at(b)], most = std::min(EmbeddingStep::kBranchRates, e_.loops[at(owner_[k])].n);
        if (plain_[at(b)] || n < 2 || n > most) branch_[k] = -1;  // beyond, these are more columns than one by one
      }
  }

  // Motions: of the bodies that a loop has taken up one by one, and of those that carry them as far as what they are assembled on.
  void place_numbers() {
    const std::size_t bodies = m_.bodies.size();
    shared_.assign(bodies, -1), state_.assign(bodies, 0);
    int zeroed = 0;
    for (EmbeddedLoop& c : e_.loops) c.width = padded(c.n + 1), c.A = zeroed, zeroed += c.n * c.width;
    e_.n_numbers = zeroed;
    for (std::size_t i = 0; i < e_.loops.size(); ++i) {
      EmbeddedLoop& c = e_.loops[i];
      const auto wants = [&](auto&& self, EmbeddedLoop::PathBody& p) -> int {  // its motion
        if (p.motion >= 0) return p.motion;
        const int inboard = m_.bodies[at(p.body)].parent;
        if (inboard != base_[at(p.body)]) p.of_inboard = self(self, c.path[at(p.inboard)]);
        p.motion = e_.n_U, e_.n_U += c.n + 1;
        return p.motion;
      };
      for (EmbeddedLoop::PathBody& p : c.path)
        if (c.by_rates && owner_[at(p.body)] == static_cast<int>(i) && branch_[at(p.body)] < 0) wants(wants, p);
      const int columns = static_cast<int>(c.columns.size());
      const auto take = [&](int& begin, int n) { begin = e_.n_numbers, e_.n_numbers += n; };
      take(c.G, c.rows * c.own_columns), take(c.B, c.rows * padded((c.by_rates ? c.inputs : c.own_columns) + 1));
      if (c.by_rates) take(c.T, c.inputs * c.width), take(c.E, columns * c.width);
      c.x = e_.n_x, e_.n_x += c.n;
      c.row = e_.n_rows, e_.n_rows += c.rows;
      c.pivot = e_.n_pivots, e_.n_pivots += c.by_rates ? c.inputs : c.own_columns;
      place_path(c);
      // Path, columns, pivots, expressions, motions.
      const int geometric = m_.loops.all[at(c.loop)].closing == Closing::coupling ? 0 : 1;
      const long found = std::ranges::count(c.path, false, &EmbeddedLoop::PathBody::seen);
      e_.flops += geometric * (100L * found + c.own_columns * (15 + 11L * c.rows) + 60);
      if (c.by_rates) {
        e_.flops += 2L * c.rank * c.rows * (c.inputs + 1) + 2L * c.inputs * (c.n + 1) + columns * (c.n + 1);
        for (const EmbeddedLoop::PathBody& p : c.path)
          if (p.motion >= 0) e_.flops += (c.n + 1) * (36L + 12L * p.n);
      }
    }
  }

  /// Loops with the same home share what they have found of rigid bodies on their ways.
  void place_path(EmbeddedLoop& c) {
    if (c.closing == Closing::coupling) return;
    for (EmbeddedLoop::PathBody& p : c.path) {
      const auto k = at(p.body);
      const bool rigid = !is_general(m_.bodies[k].kind) && (p.inboard < 0 || shared_[at(c.path[at(p.inboard)].body)] == c.home);
      p.seen = rigid && shared_[k] == c.home;
      if (p.seen) {
        p.state = state_[k];
        continue;
      }
      p.state = e_.n_path++;
      if (rigid) shared_[k] = c.home, state_[k] = p.state;
    }
  }

  int column_of_Q(int body, int loop, bool carried) {
    const auto [entry, made] = Q_.try_emplace({body, loop, carried}, e_.n_Q);
    if (made) e_.n_Q += e_.loops[at(loop)].n;
    return entry->second;
  }
  CoordinateBlock block(int a, int b) {
    const int na = e_.loops[at(a)].n, nb = e_.loops[at(b)].n;
    if (a == b) return {e_.loops[at(a)].A, e_.loops[at(a)].width, 1};
    if (na * nb == 0) return {};
    const auto [entry, made] = pairs_.try_emplace({std::min(a, b), std::max(a, b)}, e_.n_pairs_);
    if (made) {
      e_.n_pairs_ += na * nb;
      coupled_[a].insert(b), coupled_[b].insert(a);
    }
    return a < b ? CoordinateBlock{-2 - entry->second, nb, 1} : CoordinateBlock{-2 - entry->second, 1, na};
  }
  bool are_coupled(int a, int b) const { return pairs_.contains({std::min(a, b), std::max(a, b)}); }

  /// The same on the modes of a body.
  int modes_of_Q(int body, int loop) {
    const auto [entry, made] = modal_.try_emplace({body, loop}, e_.n_modal);
    if (made) e_.n_modal += e_.loops[at(loop)].n * m_.bodies[at(body)].n_modes;
    return entry->second;
  }

  /// False: coordinates of a loop cross a hinge that was to be one with its gear; it is a loop as others from now on.
  bool write_steps() {
    Q_.clear(), pairs_.clear(), coupled_.clear(), closed_.clear(), modal_.clear();
    const int bodies = static_cast<int>(m_.bodies.size());
    std::vector<std::set<int>> own(at(bodies)), carried(at(bodies));
    std::vector<int> carries(at(bodies), -1);
    std::map<int, std::vector<Couple>> couples;  // multipliers of couplings, by body
    for (std::size_t i = 0; i < e_.loops.size(); ++i) {
      const EmbeddedLoop& c = e_.loops[i];
      if (c.by_rates) continue;
      const Loop& loop = m_.loops.all[at(c.loop)];
      const int self = static_cast<int>(i);
      if (loop.closing == Closing::coupling) {
        int gradient = c.gradient;
        for (const CoupledRate& term : loop.coupling.terms) {
          const int k = body_of_[at(term.v)];
          couples[k].push_back({self, term.v, gradient++});
          own[at(k)].insert(self);
        }
        continue;
      }
      for (const auto& [end, sign] : {std::pair(&loop.from, 1.0), std::pair(&loop.to, -1.0)}) {
        const int k = end->sweep;
        if (k == 0) continue;
        own[at(k)].insert(self);
        e_.pushes.push_back({self, k, column_of_Q(k, self, false), sign, deforms(*end) ? modes_of_Q(k, self) : -1});
        e_.flops += 30L * c.n;
      }
    }
    std::vector<std::vector<int>> closes(at(bodies)), after_modes(at(bodies));
    for (std::size_t i = 0; i < e_.loops.size(); ++i)
      (e_.loops[i].after_modes ? after_modes : closes)[at(e_.loops[i].home)].push_back(static_cast<int>(i));
    int open_begin = 0, open_end = 0, open_run = -1;
    const auto flush = [&] {
      if (open_run < 0) return;
      EmbeddingStep s;
      s.kind = EmbeddingStep::Kind::sweep, s.run = open_run, s.begin = open_begin, s.end = open_end;
      e_.steps.push_back(std::move(s));
      open_run = -1;
    };
    const auto run_of = [&](int k) {
      for (std::size_t r = 0; r < m_.runs.size(); ++r)
        if (k >= m_.runs[r].begin && k < m_.runs[r].end) return static_cast<int>(r);
      return -1;
    };
    for (int k = bodies - 1; k >= 0; --k) {
      for (const int l : closes[at(k)]) flush(), close(l, k, own);
      if (k == 0) break;
      const SweepBody& b = m_.bodies[at(k)];
      if (!turning_[at(k)].empty() && !own[at(k)].empty()) {
        for (const int l : turning_[at(k)]) crossed_[at(l)] = 1;
        return false;
      }
      if (const int gear = gear_of_[at(k)]; gear >= 0) {
        flush();
        if (k == e_.gears[at(gear)].wheel) continue;  // with the hinge
        if (e_.steps.empty() || e_.steps.back().kind != EmbeddingStep::Kind::gear) {
          e_.steps.emplace_back();
          e_.steps.back().kind = EmbeddingStep::Kind::gear, e_.steps.back().begin = gear;
        }
        e_.steps.back().end = gear + 1;
        e_.flops += of_tree(b) + 60L;
      } else if (const int chain = chain_of_[at(k)]; chain >= 0) {
        flush();
        const GearedChain& c = e_.chains[at(chain)];
        if (c.hinges.back() != k) continue;  // with the innermost
        e_.steps.emplace_back();
        e_.steps.back().kind = EmbeddingStep::Kind::chain, e_.steps.back().begin = chain, e_.steps.back().end = chain + 1;
        const long m = std::ssize(c.hinges);
        e_.flops += m * of_tree(b) + 18L * m * (m + 1) + std::ssize(c.wheels) * (50L + 10L * m);
      } else if (const int geared = geared_of_[at(k)]; geared != -1) {
        flush();
        if (geared == kWheel) continue;  // with its hinges
        if (e_.steps.empty() || e_.steps.back().kind != EmbeddingStep::Kind::geared) {
          e_.steps.emplace_back();
          e_.steps.back().kind = EmbeddingStep::Kind::geared, e_.steps.back().begin = geared;
        }
        e_.steps.back().end = geared + 1;
        const long n = std::ssize(e_.geared[at(geared)].turns);
        e_.flops += of_tree(b) + 60L + n * (50L + 8L * n);
      } else if (branch_[at(k)] >= 0) {
        if (!own[at(k)].empty() || !carried[at(k)].empty()) {
          plain_[at(branch_[at(k)])] = 1;
          return false;
        }
        flush();
        if (branch_[at(k)] == k) take_branch(k, own);
      } else if (owner_[at(k)] >= 0) {
        flush();
        take_item(k, own, carried, carries);
      } else if (is_general(b.kind) && !own[at(k)].empty()) {
        flush();
        eliminate_modes(k, own);
        for (const int l : after_modes[at(k)]) close(l, k, own);
        pass_hinge(k, own, couples[k]);
      } else if (!own[at(k)].empty()) {
        flush();
        cross(k, run_of(k), own, couples[k]);
      } else {
        const int run = run_of(k);
        if (run != open_run) flush(), open_run = run, open_end = k + 1;
        open_begin = k;
        e_.flops += of_tree(b);
      }
      e_.width = std::max(e_.width, width(own[at(b.parent)]));
    }
    flush();
    // Blocks between loops come after those of each, so that all of A is one stretch.
    const int begin = own_blocks();
    for (EmbeddingStep& s : e_.steps)
      for (CoordinateBlock& c : s.blocks)
        if (c.at < -1) c.at = begin + (-2 - c.at);
    shift_numbers(begin, e_.n_pairs_);
    e_.n_zeroed = begin + e_.n_pairs_;
    return true;
  }

  int level(int k) const {
    int n = 0;
    for (; k > 0; k = m_.bodies[at(k)].parent) ++n;
    return n;
  }
  /// Gears of one step, and geared chains of steps in a row: those that are alike and stand on one level, and so none outboard of another,
  /// four or two at a time.
  void place_side_by_side() {
    place_chains_side_by_side();
    for (EmbeddingStep& s : e_.steps) {
      if (s.kind != EmbeddingStep::Kind::gear) continue;
      const std::span<Gear> gears(e_.gears.data() + s.begin, e_.gears.data() + s.end);
      const auto key = [&](const Gear& gear) { return std::pair(-level(gear.body), m_.bodies[at(gear.body)].kind); };
      std::ranges::stable_sort(gears, std::less<>(), key);
      s.begin = static_cast<int>(e_.alike_gears.size());
      for (std::size_t i = 0; i < gears.size();) {
        std::size_t same = 1;
        while (i + same < gears.size() && key(gears[i + same]) == key(gears[i])) ++same;
        const auto n = static_cast<std::size_t>(alike(static_cast<std::ptrdiff_t>(same)));
        e_.alike_gears.push_back(side_by_side(gears.subspan(i, n)));
        for (std::size_t half = 0; n == 4 && half < 2; ++half) {
          e_.alike_gears.push_back(side_by_side(gears.subspan(i + 2 * half, 2)));
          e_.alike_gears.back().half = true;
        }
        i += n;
      }
      s.end = static_cast<int>(e_.alike_gears.size());
    }
  }
  /// Chains that were written one step each, one behind the other.
  void place_chains_side_by_side() {
    std::vector<EmbeddingStep> steps;
    const auto is_chain = [](const EmbeddingStep& s) { return s.kind == EmbeddingStep::Kind::chain; };
    for (auto s = e_.steps.begin(); s != e_.steps.end();) {
      if (!is_chain(*s)) {
        steps.push_back(std::move(*s++));
        continue;
      }
      EmbeddingStep all;
      all.kind = EmbeddingStep::Kind::chain, all.begin = static_cast<int>(e_.alike_chains.size());
      const auto end = std::find_if_not(s, e_.steps.end(), is_chain);
      while (s != end) {
        const auto same = std::find_if_not(s, end, [&](const EmbeddingStep& other) { return are_alike(chain_of(*s), chain_of(other)); });
        const auto n = alike(same - s);
        const auto put = [&](long from, long to, bool half) {
          AlikeChains side;
          side.half = half;
          for (long i = from; i < to; ++i) add_to(side, chain_of(s[i]));
          e_.alike_chains.push_back(std::move(side));
        };
        put(0, n, false);
        if (n == 4) put(0, 2, true), put(2, 4, true);
        s += n;
      }
      all.end = static_cast<int>(e_.alike_chains.size());
      steps.push_back(std::move(all));
    }
    e_.steps = std::move(steps);
  }
  /// Loops closed one behind the other whose ways are alike.
  void place_rows_side_by_side() {
    const std::size_t loops = e_.loops.size();
    for (std::size_t l = 0; l < loops;) {
      std::size_t same = l;
      while (same < loops && is_found_side_by_side(e_.loops[same]) && are_alike(e_.loops[l], e_.loops[same])) ++same;
      const auto n = static_cast<std::size_t>(alike(static_cast<std::ptrdiff_t>(same - l)));
      if (n > 1) e_.alike_rows.push_back(rows_side_by_side(l, n));
      for (std::size_t half = 0; n == 4 && half < 2; ++half) {
        e_.alike_rows.push_back(rows_side_by_side(l + 2 * half, 2));
        e_.alike_rows.back().half = true;
      }
      l += n;
    }
  }
  /// By ends that meet; nobody else asks for what is found of the bodies on its way.
  bool is_found_side_by_side(const EmbeddedLoop& c) const {
    const bool meets = c.closing == Closing::point || c.closing == Closing::line || c.closing == Closing::plane;
    if (!meets || !c.by_rates || c.from_node >= 0 || c.to_node >= 0 || c.deforms || c.home_modes >= 0) return false;
    if (c.path.size() > AlikeRows::kMostBodies || c.rows * c.own_columns > AlikeRows::kMostNumbers) return false;
    return std::ranges::all_of(c.path, [&](const EmbeddedLoop::PathBody& p) {
      if (p.seen) return true;
      const BodyKernel kind = m_.bodies[at(p.body)].kind;
      if (!p.shifts && (!is_axis(kind) || kind == BodyKernel::rotor)) return false;
      return std::ranges::none_of(e_.loops, [&](const EmbeddedLoop& other) {
        return std::ranges::any_of(other.path, [&](const EmbeddedLoop::PathBody& x) { return x.seen && x.state == p.state; });
      });
    });
  }
  bool are_alike(const EmbeddedLoop& a, const EmbeddedLoop& b) const {
    if (a.closing != b.closing || a.own_columns != b.own_columns || a.from_at != b.from_at || a.to_at != b.to_at) return false;
    return std::ranges::equal(a.path, b.path, [&](const EmbeddedLoop::PathBody& x, const EmbeddedLoop::PathBody& y) {
      if (x.inboard != y.inboard || x.column != y.column || x.sign != y.sign || x.seen != y.seen) return false;
      return x.seen ? x.state == y.state : x.shifts == y.shifts && m_.bodies[at(x.body)].kind == m_.bodies[at(y.body)].kind;
    });
  }
  AlikeRows rows_side_by_side(std::size_t first, std::size_t n) const {
    AlikeRows out;
    out.first = static_cast<int>(first), out.n = static_cast<int>(n);
    out.bodies.resize(e_.loops[first].path.size());
    for (int i = 0; i < out.n; ++i) {
      const EmbeddedLoop& c = e_.loops[first + at(i)];
      const auto set = [i](double(*to)[AlikeRows::kMost], const Vec3<double>& x) { to[0][i] = x.x, to[1][i] = x.y, to[2][i] = x.z; };
      for (std::size_t x = 0; x < c.path.size(); ++x) {
        const EmbeddedLoop::PathBody& p = c.path[x];
        if (p.seen) continue;
        AlikeRows::Body& body = out.bodies[x];
        const SweepBody& b = m_.bodies[at(p.body)];
        if (p.shifts) {
          body.hinges.kind = b.kind, body.hinges.body[i] = p.body, body.hinges.v[i] = b.v;
          set(body.u, b.axis);
          continue;
        }
        body.hinges.set(i, m_, p.body);
        const double* r = m_.axis_bodies[at(p.body)].p;
        set(body.p, {r[0], r[1], r[2]});
      }
      const Mat3<double>& R = c.from.R;
      set(out.from_R, {R.xx, R.xy, R.xz}), set(out.from_R + 3, {R.yx, R.yy, R.yz}), set(out.from_R + 6, {R.zx, R.zy, R.zz});
      set(out.from_p, c.from.p), set(out.to_p, c.to.p);
    }
    return out;
  }
  /// So many of n at a time.
  static long alike(std::ptrdiff_t n) { return n >= 4 ? 4 : n >= 2 ? 2 : 1; }
  void add_to(AlikeChains& side, const GearedChain& chain) const {
    const int i = side.n++;
    side.hinges.resize(chain.hinges.size()), side.wheels.resize(chain.wheels.size());
    for (std::size_t x = 0; x < side.hinges.size(); ++x) side.hinges[x].set(i, m_, chain.hinges[x]);
    for (std::size_t n = 0; n < side.wheels.size(); ++n) {
      const TurningWheel& wheel = e_.wheels[at(chain.wheels[n].wheel)];
      AlikeChains::Wheels& to = side.wheels[n];
      to.wheel[i] = chain.wheels[n].wheel, to.body[i] = wheel.body, to.v[i] = wheel.v, to.t[i] = wheel.t;
      to.u[0][i] = wheel.u.x, to.u[1][i] = wheel.u.y, to.u[2][i] = wheel.u.z, to.J_axial[i] = wheel.J_axial;
      for (std::size_t x = 0; x < GearedChain::kMost; ++x) to.ratio[x][i] = chain.wheels[n].ratio[x];
      side.on_ground = side.on_ground || wheel.on_ground > 0;
    }
  }
  const GearedChain& chain_of(const EmbeddingStep& s) const { return e_.chains[at(s.begin)]; }
  bool are_alike(const GearedChain& a, const GearedChain& b) const {
    const auto same_hinge = [&](int i, int j) { return m_.bodies[at(i)].kind == m_.bodies[at(j)].kind && level(i) == level(j); };
    const auto same_wheel = [](const GearedChain::Wheel& i, const GearedChain::Wheel& j) {
      return std::ranges::equal(
          i.ratio, j.ratio, {}, [](int r) { return r < 0; }, [](int r) { return r < 0; });
    };
    return std::ranges::equal(a.hinges, b.hinges, same_hinge) && std::ranges::equal(a.wheels, b.wheels, same_wheel);
  }
  AlikeGears side_by_side(std::span<const Gear> gears) const {
    AlikeGears out;
    for (const Gear& gear : gears) {
      const int i = out.n++;
      out.hinges.set(i, m_, gear.body);
      out.wheel[i] = gear.wheel, out.row[i] = gear.row, out.drive[i] = gear.drive, out.v[i] = gear.v;
      out.driven = out.driven || gear.drive >= 0;
      out.sense[i] = gear.sense, out.ratio[i] = gear.ratio, out.per_slope[i] = gear.per_slope;
      out.J_axial[i] = gear.J_axial, out.coupled[i] = gear.coupled, out.reflected[i] = gear.reflected;
    }
    return out;
  }
  int own_blocks() const {
    int n = 0;
    for (const EmbeddedLoop& c : e_.loops) n += c.n * c.width;
    return n;
  }
  void shift_numbers(int from, int by) {
    for (EmbeddedLoop& c : e_.loops)
      for (int* x : {&c.G, &c.B, &c.T, &c.E})
        if (*x >= from) *x += by;
    e_.n_numbers += by;
  }
  int width(const std::set<int>& loops) const {
    int n = 0;
    for (const int l : loops) n += e_.loops[at(l)].n;
    return n;
  }

  /// Inward and outward over a body of an open tree, about.
  static long of_tree(const SweepBody& b) {
    return b.kind == BodyKernel::rotor ? 25L : b.nv * 60L + (b.nv == 6 ? 0L : 290L) + b.n_modes * 70L;
  }

  void blocks_of(EmbeddingStep& s, bool all) {
    for (const PendingFlow& a : s.flows)
      for (const PendingFlow& b : s.flows) {
        const bool wanted = all || a.loop == b.loop || a.loop == s.flows[0].loop || b.loop == s.flows[0].loop;
        s.blocks.push_back(wanted ? block(a.loop, b.loop) : CoordinateBlock{});
      }
  }

  void take_item(int k, std::vector<std::set<int>>& own, std::vector<std::set<int>>& carried, std::vector<int>& carries) {
    const SweepBody& b = m_.bodies[at(k)];
    const int l = owner_[at(k)];
    const EmbeddedLoop& c = e_.loops[at(l)];
    EmbeddingStep s;
    s.kind = b.kind == BodyKernel::rotor ? EmbeddingStep::Kind::wheel : EmbeddingStep::Kind::item;
    s.body = k, s.loop = l;
    const auto path = std::ranges::find(c.path, k, &EmbeddedLoop::PathBody::body);
    s.motion = path->motion, s.column = path->column;
    s.to_carried = base_[at(k)] != b.parent;
    s.carried = carries[at(k)];
    std::set<int> through = own[at(k)];
    through.insert(carried[at(k)].begin(), carried[at(k)].end());
    through.erase(l);
    std::vector<int> all{l};
    all.insert(all.end(), through.begin(), through.end());
    for (const int x : all) {
      PendingFlow f;
      f.loop = x;
      if (own[at(k)].contains(x)) f.own = column_of_Q(k, x, false);
      if (carried[at(k)].contains(x)) f.carried = column_of_Q(k, x, true);
      if (b.parent > 0) {
        f.to = column_of_Q(b.parent, x, s.to_carried);
        (s.to_carried ? carried : own)[at(b.parent)].insert(x);
      }
      s.flows.push_back(f);
    }
    if (b.parent > 0 && s.to_carried) {
      if (carries[at(b.parent)] < 0) carries[at(b.parent)] = e_.n_carried++;
      s.carried_to = carries[at(b.parent)];
    }
    // Its loop with what stands on the body; what passes is not touched.
    for (const PendingFlow& x : s.flows)
      for (const PendingFlow& y : s.flows) {
        const bool with_own = (x.loop == l && (y.own >= 0 || y.loop == l)) || (y.loop == l && x.own >= 0);
        s.blocks.push_back(with_own ? block(x.loop, y.loop) : CoordinateBlock{});
      }
    if (s.kind == EmbeddingStep::Kind::wheel) {
      e_.flops += 20L + 12L * c.n + 2L * c.n * c.n;
    } else {
      e_.flops += 60L + 66L * (c.n + 1) + 6L * c.n * (c.n + 1) + (b.parent > 0 ? 230L : 0L);
      for (const PendingFlow& f : s.flows) {
        const long n = e_.loops[at(f.loop)].n;
        e_.flops += (f.to >= 0 ? 36L * n : 0L) + (f.own >= 0 ? 11L * n * (c.n + 1) : 0L);
      }
    }
    e_.steps.push_back(std::move(s));
  }

  void take_branch(int base, std::vector<std::set<int>>& own) {
    const int l = owner_[at(base)], parent = m_.bodies[at(base)].parent;
    const EmbeddedLoop& c = e_.loops[at(l)];
    EmbeddingStep s;
    s.kind = EmbeddingStep::Kind::branch, s.body = base, s.loop = l;
    PendingFlow f;
    f.loop = l;
    if (parent > 0) f.to = column_of_Q(parent, l, false), own[at(parent)].insert(l);
    s.flows.push_back(f);
    for (int k = tip_[at(base)]; k >= base; k = m_.bodies[at(k)].parent)
      s.branch.push_back({k, std::ranges::find(c.path, k, &EmbeddedLoop::PathBody::body)->column, shifts(m_.bodies[at(k)])});
    s.rigid = true;
    for (std::size_t k = 1; k < m_.bodies.size(); ++k) {
      const auto on = [&](int body) { return std::ranges::find(s.branch, body, &EmbeddingStep::BranchBody::body) != s.branch.end(); };
      if (m_.bodies[k].kind != BodyKernel::rotor && on(m_.bodies[k].parent) && !on(static_cast<int>(k))) s.rigid = false;
    }
    long rates = 0;
    for (const EmbeddingStep::BranchBody& x : s.branch) {
      const SweepBody& b = m_.bodies[at(x.body)];
      e_.flops += b.nv * (is_axis(b.kind) ? 0L : (s.rigid ? 30L : 66L) + 11L * (rates + b.nv + 1));
      rates += b.nv;
      if (b.parent > 0) e_.flops += (s.rigid ? 80L : 200L) - (x.shifts ? 50L : 0L) + (x.shifts ? 12L : 36L) * (rates + 1);
    }
    e_.flops += rates * (2L * rates * (c.n + 1) + 2L * c.n + c.n * (c.n + 1) + (parent > 0 ? 12L * (c.n + 1) : 0L));
    e_.steps.push_back(std::move(s));
  }

  void cross(int k, int run, std::vector<std::set<int>>& own, const std::vector<Couple>& couples) {
    const SweepBody& b = m_.bodies[at(k)];
    EmbeddingStep s;
    s.kind = EmbeddingStep::Kind::cross, s.body = k, s.run = run, s.begin = k, s.end = k + 1;
    int n = 0;
    for (const int l : own[at(k)]) {
      PendingFlow f;
      f.loop = l, f.own = column_of_Q(k, l, false);
      for (const Couple& x : couples)
        if (x.by == l) s.couples.push_back({static_cast<int>(s.flows.size()), x.v - b.v, x.gradient});
      if (b.parent > 0) f.to = column_of_Q(b.parent, l, false);
      own[at(b.parent)].insert(l);
      s.flows.push_back(f);
      n += e_.loops[at(l)].n;
    }
    blocks_of(s, true);
    s.Y = e_.n_Y, e_.n_Y += std::max<int>(b.nv, 6) * n;
    e_.flops += b.nv * (25L * n + 2L * n * n) + 30L * n + of_tree(b);
    e_.steps.push_back(std::move(s));
  }

  /// The coordinates on a body of a general kernel.
  std::vector<PendingFlow> flows_on(int k, const std::set<int>& own, int& n) {
    std::vector<PendingFlow> flows;
    for (const int l : own) {
      PendingFlow f;
      f.loop = l, f.own = column_of_Q(k, l, false);
      flows.push_back(f);
      n += e_.loops[at(l)].n;
    }
    return flows;
  }

  void eliminate_modes(int k, const std::vector<std::set<int>>& own) {
    const SweepBody& b = m_.bodies[at(k)];
    EmbeddingStep s;
    s.kind = EmbeddingStep::Kind::modes, s.body = k;
    int n = 0;
    s.flows = flows_on(k, own[at(k)], n);
    blocks_of(s, true);
    if (b.n_modes > 0) {
      for (PendingFlow& f : s.flows) f.own_modes = modes_of_Q(k, f.loop);
      e_.factored.push_back(k);
      e_.n_scratch = std::max(e_.n_scratch, 2 * n * b.n_modes);
      const long m = b.n_modes;
      e_.flops += m * (m + 1) * (2 * m + 1) / 6 + 14 * m * m + n * (m * m + 26 * m) + m * n * n;
    }
    e_.steps.push_back(std::move(s));
  }

  void pass_hinge(int k, std::vector<std::set<int>>& own, const std::vector<Couple>& couples) {
    const SweepBody& b = m_.bodies[at(k)];
    EmbeddingStep s;
    s.kind = EmbeddingStep::Kind::hinge, s.body = k;
    int n = 0;
    s.flows = flows_on(k, own[at(k)], n);
    for (std::size_t i = 0; i < s.flows.size(); ++i) {
      PendingFlow& f = s.flows[i];
      for (const Couple& x : couples)
        if (x.by == f.loop) s.couples.push_back({static_cast<int>(i), x.v - b.v, x.gradient});
      if (b.parent == 0) continue;
      f.to = column_of_Q(b.parent, f.loop, false);
      if (b.onode >= 0) f.to_modes = modes_of_Q(b.parent, f.loop), e_.flops += e_.loops[at(f.loop)].n * (24L + 12L * b.n_parent_modes);
      own[at(b.parent)].insert(f.loop);
    }
    blocks_of(s, true);
    s.Y = e_.n_Y, e_.n_Y += b.nv * n;
    e_.flops += b.nv * (25L * n + 2L * n * n) + 30L * n + of_tree(b);
    e_.steps.push_back(std::move(s));
  }

  void close(int l, int home, std::vector<std::set<int>>& own) {
    EmbeddedLoop& c = e_.loops[at(l)];
    EmbeddingStep s;
    s.kind = EmbeddingStep::Kind::close, s.body = home, s.loop = l, s.after_modes = c.after_modes;
    std::vector<int> all{l};
    for (const int b : coupled_[l])
      if (!closed_.contains(b)) all.push_back(b);
    s.coupled = static_cast<int>(all.size());
    const long w = width({all.begin() + 1, all.end()}) + c.keep;
    if (c.keep > 0 && std::ranges::find(all, c.consumer) == all.end()) all.push_back(c.consumer);
    own[at(home)].erase(l);
    if (c.keep > 0) own[at(home)].insert(c.consumer);
    for (const int x : all) {
      PendingFlow f;
      f.loop = x;
      if (home > 0) f.own = column_of_Q(home, x, false);
      s.flows.push_back(f);
      if (x != l) own[at(home)].insert(x);
    }
    // Eliminating couples all of them with each other.
    const int n = static_cast<int>(all.size());
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const bool met = i == j || std::max(i, j) < s.coupled || std::min(i, j) > 0;
        s.blocks.push_back(met ? block(all[at(i)], all[at(j)]) : CoordinateBlock{});
      }
    closed_.insert(l);
    const long e = c.n - c.keep;
    e_.flops += e * e * e / 3 + e * (e + 1) + (home > 0 ? e * (6L * e + 54L) : 0L) + e * w * (w + (home > 0 ? 14L : 2L));
    if (c.keep > 0) {
      const EmbeddedLoop& o = e_.loops[at(c.consumer)];
      const long taking = o.by_own ? 1L : o.n;  // by another name
      e_.flops += 2L * c.keep * taking * (c.keep + taking) + (home > 0 ? 12L * c.keep * (taking + 1) : 0L);
    }
    e_.steps.push_back(std::move(s));
  }

  const Model& m_;
  const std::vector<double>& rows_;
  std::vector<int> body_of_;              // of a hinge rate
  std::vector<std::vector<int>> hinges_;  // per loop: bodies whose hinges it has
  std::vector<int> home_;
  std::vector<std::uint8_t> meets_;  // per loop: modes of home are on its way
  std::vector<std::uint8_t> stops_;  // per body: its motion by a loop is counted from its inboard body
  struct Program : Embedding {
    int n_pairs_ = 0;
  };
  Program e_;
  std::vector<std::uint8_t> crossed_;                // per loop: coordinates of others cross the hinge that its gear would be one with
  std::vector<std::vector<int>> turning_;            // per body: loops that are transmissions with its hinge
  std::vector<int> gear_of_, geared_of_, chain_of_;  // per body, index into Embedding::gears, ::geared, ::chains
  std::vector<int> index_, owner_, base_;
  std::vector<int> branch_;          // per body: the innermost of its chain; -1: it is taken up by itself, or not at all
  std::vector<int> tip_;             // per such: the outermost
  std::vector<std::uint8_t> plain_;  // per such: coordinates of others are on the chain
  std::vector<int> shared_, state_;  // per body: the home of the last loop that has found its state, and where that stands
  std::map<std::tuple<int, int, bool>, int> Q_;
  std::map<std::pair<int, int>, int> modal_;
  std::map<std::pair<int, int>, int> pairs_;
  std::map<int, std::set<int>> coupled_;
  std::set<int> closed_;
};

}  // namespace

Embedding embed_loops(const Model& model, const std::vector<double>& scaled_rows, bool without_inertia, std::vector<LoopSet>& sets) {
  Embedder embedder(model, scaled_rows);
  sets = embedder.sets();
  for (LoopSet& set : sets)
    for (const int l : set.loops)
      if (set.why.empty()) set.why = embedder.modes_on_the_way(l);
  std::vector<std::uint8_t> by_rates(model.loops.all.size(), 1);
  std::size_t tried = 0;
  const auto flops = [&] { return Embedder(model, scaled_rows).build(by_rates).flops; };
  const auto light = [&](int l) { return embedder.has_wheel(l) || embedder.has_light_rates(l); };
  /// By multipliers where that takes fewer operations than so much of those by rates.
  const auto try_multipliers = [&](const LoopSet& set, double worth) {
    const long rates = flops();
    for (const int i : set.loops) by_rates[at(i)] = 0;
    const bool fewer = static_cast<double>(flops()) < worth * static_cast<double>(rates);
    for (const int i : set.loops) by_rates[at(i)] = !fewer;
  };
  for (LoopSet& set : sets) {
    set.form = "rates";
    const int l = set.loops[0];
    const int left = embedder.path_rates(l) - model.loops.all[at(l)].rows;
    if (!set.why.empty()) {  // modes on the way
      for (const int i : set.loops) by_rates[at(i)] = 0;
    } else if (without_inertia) {  // hinges that multipliers would have eliminated may have none of their own
      set.why = "the open tree has a direction without inertia";
    } else if (set.loops.size() > 1) {
      set.why = "they share hinges";
      if (std::ranges::none_of(set.loops, light) && tried++ < kTried) try_multipliers(set, kWorth);
    } else if (embedder.has_wheel(l)) {
      set.why = "a wheel behind a gear";
    } else if (left > kLongLoop) {
      by_rates[at(l)] = 0;
      set.why = "a long way";
    } else if (left > 1 && !light(l) && tried++ < kTried) {
      try_multipliers(set, kSafer);
    }
    if (!by_rates[at(l)]) set.form = "multipliers in the sweep";
  }
  Embedding embedding = embed_loops(model, scaled_rows, by_rates);
  std::vector<const char*> turns(model.loops.all.size(), nullptr);
  for (std::size_t l = 0; l < turns.size(); ++l)
    if (std::ranges::find(embedding.gears, model.loops.all[l].first, &Gear::row) != embedding.gears.end())
      turns[l] = "a wheel geared to a hinge beside it";
  for (const Transmission& t : embedding.transmissions)
    for (const Transmission::Row& row : t.rows) turns[at(row.loop)] = "wheels that turn with hinges outboard of their carrier";
  for (LoopSet& set : sets)
    if (const char* why = turns[at(set.loops[0])]) set.why = why;
  return embedding;
}

Embedding embed_loops(const Model& model, const std::vector<double>& scaled_rows, const std::vector<std::uint8_t>& by_rates) {
  return Embedder(model, scaled_rows).build(by_rates);
}

}  // namespace cardan
