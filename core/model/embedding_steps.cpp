#include <algorithm>
#include <map>
#include <set>
#include <tuple>

#include "core/model/embedding_stages.hpp"

namespace cardan::embedding_stages {
namespace {

/// Goes from the tips to the base and keeps what is pending where. Of each step it counts the operations.
class StepWriter {
 public:
  StepWriter(const Ways& ways, const Wheels& wheels, const std::vector<int>& owner, const Branches& branches, Avoided& avoided,
             Embedding& e)
      : ways_(ways), wheels_(wheels), owner_(owner), branches_(branches), avoided_(avoided), e_(e) {
    const std::size_t bodies = owner.size();
    own_.resize(bodies), carried_.resize(bodies), carries_.assign(bodies, -1);
  }

  bool write() {
    push_multipliers();
    std::vector<std::vector<int>> closes(own_.size()), after_modes(own_.size());
    for (std::size_t i = 0; i < e_.loops.size(); ++i)
      (e_.loops[i].after_modes ? after_modes : closes)[at(e_.loops[i].home)].push_back(static_cast<int>(i));
    for (int k = static_cast<int>(own_.size()) - 1; k > 0; --k) {
      for (const int l : closes[at(k)]) close(l, k);
      if (!pass(k, after_modes[at(k)])) return false;
      e_.width = std::max(e_.width, width(own_[at(ways_.body(k).parent)]));
    }
    for (const int l : closes[0]) close(l, 0);
    place_blocks();
    return true;
  }

 private:
  /// What a multiplier of a coupling does to a rate: whose, and where EmbeddingWork::gradients has by how much.
  struct Couple {
    int by, v, gradient;
  };

  void push_multipliers() {
    for (std::size_t i = 0; i < e_.loops.size(); ++i) {
      const EmbeddedLoop& c = e_.loops[i];
      if (c.by_rates) continue;
      const Loop& loop = ways_.loop(c.loop);
      const int self = static_cast<int>(i);
      if (loop.closing == Closing::coupling) {
        int gradient = c.gradient;
        for (const CoupledRate& term : loop.coupling.terms) {
          const int k = ways_.body_of[at(term.v)];
          couples_[k].push_back({self, term.v, gradient++});
          own_[at(k)].insert(self);
        }
        continue;
      }
      for (const auto& [end, sign] : {std::pair(&loop.from, 1.0), std::pair(&loop.to, -1.0)}) {
        const int k = end->sweep;
        if (k == 0) continue;
        own_[at(k)].insert(self);
        e_.pushes.push_back({self, k, column_of_Q(k, self, false), sign, ways_.deforms(*end) ? modes_of_Q(k, self) : -1});
        e_.flops += 30L * c.n;
      }
    }
  }

  /// Body k; `after_modes`: loops that are closed between its modes and its hinge.
  bool pass(int k, const std::vector<int>& after_modes) {
    const bool pending = !own_[at(k)].empty();
    if (!wheels_.turning[at(k)].empty() && pending) {
      for (const int l : wheels_.turning[at(k)]) avoided_.crossed[at(l)] = 1;
      return false;
    }
    const int branch = branches_.branch[at(k)];
    if (branch >= 0 && (pending || !carried_[at(k)].empty())) {
      avoided_.plain[at(branch)] = 1;
      return false;
    }
    if (wheels_.gear_of[at(k)] >= 0 || wheels_.chain_of[at(k)] >= 0 || wheels_.geared_of[at(k)] != -1) {
      turn_wheels(k);
    } else if (branch >= 0) {
      if (branch == k) take_branch(k);
    } else if (owner_[at(k)] >= 0) {
      take_item(k);
    } else if (is_general(ways_.body(k).kind) && pending) {
      eliminate_modes(k);
      for (const int l : after_modes) close(l, k);
      pass_hinge(k);
    } else if (pending) {
      cross(k);
    } else {
      sweep(k);
    }
    return true;
  }

  /// As in an open tree.
  void sweep(int k) {
    const int run = run_of(k);
    const bool goes_on = !e_.steps.empty() && e_.steps.back().kind == EmbeddingStep::Kind::sweep && e_.steps.back().run == run &&
                         e_.steps.back().begin == k + 1;
    if (!goes_on) {
      EmbeddingStep s;
      s.kind = EmbeddingStep::Kind::sweep, s.run = run, s.end = k + 1;
      e_.steps.push_back(std::move(s));
    }
    e_.steps.back().begin = k;
    e_.flops += of_tree(ways_.body(k));
  }
  int run_of(int k) const {
    const std::vector<Run>& runs = ways_.model.runs;
    return static_cast<int>(std::ranges::find_if(runs, [&](const Run& r) { return k >= r.begin && k < r.end; }) - runs.begin());
  }

  /// Wheels and the hinges that they turn with; what is of several bodies is written at the innermost hinge.
  void turn_wheels(int k) {
    const SweepBody& b = ways_.body(k);
    if (const int gear = wheels_.gear_of[at(k)]; gear >= 0) {
      if (k == e_.gears[at(gear)].wheel) return;  // with the hinge
      extend(EmbeddingStep::Kind::gear, gear);
      e_.flops += of_tree(b) + 60L;
    } else if (const int chain = wheels_.chain_of[at(k)]; chain >= 0) {
      const GearedChain& c = e_.chains[at(chain)];
      if (c.hinges.back() != k) return;
      EmbeddingStep s;
      s.kind = EmbeddingStep::Kind::chain, s.begin = chain, s.end = chain + 1;
      e_.steps.push_back(std::move(s));
      const long m = std::ssize(c.hinges);
      e_.flops += m * of_tree(b) + 18L * m * (m + 1) + std::ssize(c.wheels) * (50L + 10L * m);
    } else if (const int geared = wheels_.geared_of[at(k)]; geared != kWheel) {
      extend(EmbeddingStep::Kind::geared, geared);
      const long n = std::ssize(e_.geared[at(geared)].turns);
      e_.flops += of_tree(b) + 60L + n * (50L + 8L * n);
    }
  }
  /// The last step, or a new one where that is of another kind, by its member i.
  void extend(EmbeddingStep::Kind kind, int i) {
    if (e_.steps.empty() || e_.steps.back().kind != kind) {
      EmbeddingStep s;
      s.kind = kind, s.begin = i;
      e_.steps.push_back(std::move(s));
    }
    e_.steps.back().end = i + 1;
  }

  void take_item(int k) {
    const SweepBody& b = ways_.body(k);
    const int l = owner_[at(k)];
    const EmbeddedLoop& c = e_.loops[at(l)];
    EmbeddingStep s;
    s.kind = b.kind == BodyKernel::rotor ? EmbeddingStep::Kind::wheel : EmbeddingStep::Kind::item;
    s.body = k, s.loop = l;
    const auto path = std::ranges::find(c.path, k, &EmbeddedLoop::PathBody::body);
    s.motion = path->motion, s.column = path->column;
    s.to_carried = branches_.base[at(k)] != b.parent;
    s.carried = carries_[at(k)];
    std::set<int> through = own_[at(k)];
    through.insert(carried_[at(k)].begin(), carried_[at(k)].end());
    through.erase(l);
    std::vector<int> all{l};
    all.insert(all.end(), through.begin(), through.end());
    for (const int x : all) {
      PendingFlow f;
      f.loop = x;
      if (own_[at(k)].contains(x)) f.own = column_of_Q(k, x, false);
      if (carried_[at(k)].contains(x)) f.carried = column_of_Q(k, x, true);
      if (b.parent > 0) {
        f.to = column_of_Q(b.parent, x, s.to_carried);
        (s.to_carried ? carried_ : own_)[at(b.parent)].insert(x);
      }
      s.flows.push_back(f);
    }
    if (b.parent > 0 && s.to_carried) {
      if (carries_[at(b.parent)] < 0) carries_[at(b.parent)] = e_.n_carried++;
      s.carried_to = carries_[at(b.parent)];
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

  void take_branch(int base) {
    const int l = owner_[at(base)], parent = ways_.body(base).parent;
    const EmbeddedLoop& c = e_.loops[at(l)];
    EmbeddingStep s;
    s.kind = EmbeddingStep::Kind::branch, s.body = base, s.loop = l;
    PendingFlow f;
    f.loop = l;
    if (parent > 0) f.to = column_of_Q(parent, l, false), own_[at(parent)].insert(l);
    s.flows.push_back(f);
    for (int k = branches_.tip[at(base)]; k >= base; k = ways_.body(k).parent)
      s.branch.push_back({k, std::ranges::find(c.path, k, &EmbeddedLoop::PathBody::body)->column, ways_.shifts(k)});
    s.rigid = true;
    for (std::size_t k = 1; k < ways_.model.bodies.size(); ++k) {
      const auto on = [&](int body) { return std::ranges::find(s.branch, body, &EmbeddingStep::BranchBody::body) != s.branch.end(); };
      if (ways_.model.bodies[k].kind != BodyKernel::rotor && on(ways_.model.bodies[k].parent) && !on(static_cast<int>(k))) s.rigid = false;
    }
    long rates = 0;
    for (const EmbeddingStep::BranchBody& x : s.branch) {
      const SweepBody& b = ways_.body(x.body);
      e_.flops += b.nv * (is_axis(b.kind) ? 0L : (s.rigid ? 30L : 66L) + 11L * (rates + b.nv + 1));
      rates += b.nv;
      if (b.parent > 0) e_.flops += (s.rigid ? 80L : 200L) - (x.shifts ? 50L : 0L) + (x.shifts ? 12L : 36L) * (rates + 1);
    }
    e_.flops += rates * (2L * rates * (c.n + 1) + 2L * c.n + c.n * (c.n + 1) + (parent > 0 ? 12L * (c.n + 1) : 0L));
    e_.steps.push_back(std::move(s));
  }

  void cross(int k) {
    const SweepBody& b = ways_.body(k);
    EmbeddingStep s;
    s.kind = EmbeddingStep::Kind::cross, s.body = k, s.run = run_of(k), s.begin = k, s.end = k + 1;
    int n = 0;
    for (const int l : own_[at(k)]) {
      PendingFlow f;
      f.loop = l, f.own = column_of_Q(k, l, false);
      for (const Couple& x : couples_[k])
        if (x.by == l) s.couples.push_back({static_cast<int>(s.flows.size()), x.v - b.v, x.gradient});
      if (b.parent > 0) f.to = column_of_Q(b.parent, l, false);
      own_[at(b.parent)].insert(l);
      s.flows.push_back(f);
      n += e_.loops[at(l)].n;
    }
    blocks_of(s);
    s.Y = e_.n_Y, e_.n_Y += std::max<int>(b.nv, 6) * n;
    e_.flops += b.nv * (25L * n + 2L * n * n) + 30L * n + of_tree(b);
    e_.steps.push_back(std::move(s));
  }

  /// Of a body of a general kernel: with the coordinates on it, n of them.
  EmbeddingStep step_on(int k, EmbeddingStep::Kind kind, int& n) {
    EmbeddingStep s;
    s.kind = kind, s.body = k;
    for (const int l : own_[at(k)]) {
      PendingFlow f;
      f.loop = l, f.own = column_of_Q(k, l, false);
      s.flows.push_back(f);
      n += e_.loops[at(l)].n;
    }
    blocks_of(s);
    return s;
  }

  void eliminate_modes(int k) {
    const SweepBody& b = ways_.body(k);
    int n = 0;
    EmbeddingStep s = step_on(k, EmbeddingStep::Kind::modes, n);
    if (b.n_modes > 0) {
      for (PendingFlow& f : s.flows) f.own_modes = modes_of_Q(k, f.loop);
      e_.factored.push_back(k);
      e_.n_scratch = std::max(e_.n_scratch, 2 * n * b.n_modes);
      const long m = b.n_modes;
      e_.flops += m * (m + 1) * (2 * m + 1) / 6 + 14 * m * m + n * (m * m + 26 * m) + m * n * n;
    }
    e_.steps.push_back(std::move(s));
  }

  void pass_hinge(int k) {
    const SweepBody& b = ways_.body(k);
    int n = 0;
    EmbeddingStep s = step_on(k, EmbeddingStep::Kind::hinge, n);
    for (std::size_t i = 0; i < s.flows.size(); ++i) {
      PendingFlow& f = s.flows[i];
      for (const Couple& x : couples_[k])
        if (x.by == f.loop) s.couples.push_back({static_cast<int>(i), x.v - b.v, x.gradient});
      if (b.parent == 0) continue;
      f.to = column_of_Q(b.parent, f.loop, false);
      if (b.onode >= 0) f.to_modes = modes_of_Q(b.parent, f.loop), e_.flops += e_.loops[at(f.loop)].n * (24L + 12L * b.n_parent_modes);
      own_[at(b.parent)].insert(f.loop);
    }
    s.Y = e_.n_Y, e_.n_Y += b.nv * n;
    e_.flops += b.nv * (25L * n + 2L * n * n) + 30L * n + of_tree(b);
    e_.steps.push_back(std::move(s));
  }

  void close(int l, int home) {
    EmbeddedLoop& c = e_.loops[at(l)];
    EmbeddingStep s;
    s.kind = EmbeddingStep::Kind::close, s.body = home, s.loop = l, s.after_modes = c.after_modes;
    std::vector<int> all{l};
    for (const int b : coupled_[l])
      if (!closed_.contains(b)) all.push_back(b);
    s.coupled = static_cast<int>(all.size());
    const long w = width({all.begin() + 1, all.end()}) + c.keep;
    if (c.keep > 0 && std::ranges::find(all, c.consumer) == all.end()) all.push_back(c.consumer);
    own_[at(home)].erase(l);
    if (c.keep > 0) own_[at(home)].insert(c.consumer);
    for (const int x : all) {
      PendingFlow f;
      f.loop = x;
      if (home > 0) f.own = column_of_Q(home, x, false);
      s.flows.push_back(f);
      if (x != l) own_[at(home)].insert(x);
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

  /// Blocks between loops come after those of each, so that all of A is one stretch, and the other numbers after them.
  void place_blocks() {
    int begin = 0;
    for (const EmbeddedLoop& c : e_.loops) begin += c.n * c.width;
    for (EmbeddingStep& s : e_.steps)
      for (CoordinateBlock& c : s.blocks)
        if (c.at < -1) c.at = begin + (-2 - c.at);
    for (EmbeddedLoop& c : e_.loops)
      for (int* x : {&c.G, &c.B, &c.T, &c.E})
        if (*x >= begin) *x += between_loops_;
    e_.n_numbers += between_loops_;
    e_.n_zeroed = begin + between_loops_;
  }

  /// Inward and outward over a body of an open tree, about.
  static long of_tree(const SweepBody& b) {
    return b.kind == BodyKernel::rotor ? 25L : b.nv * 60L + (b.nv == 6 ? 0L : 290L) + b.n_modes * 70L;
  }
  int width(const std::set<int>& loops) const {
    int n = 0;
    for (const int l : loops) n += e_.loops[at(l)].n;
    return n;
  }

  /// Where coordinates stand on a body, or pass it.
  int column_of_Q(int body, int loop, bool carried) {
    const auto [entry, made] = Q_.try_emplace({body, loop, carried}, e_.n_Q);
    if (made) e_.n_Q += e_.loops[at(loop)].n;
    return entry->second;
  }
  /// Part of A between the coordinates of two loops; what couples them is counted from -2 downward until place_blocks().
  CoordinateBlock block(int a, int b) {
    const int na = e_.loops[at(a)].n, nb = e_.loops[at(b)].n;
    if (a == b) return {e_.loops[at(a)].A, e_.loops[at(a)].width, 1};
    if (na * nb == 0) return {};
    const auto [entry, made] = pairs_.try_emplace({std::min(a, b), std::max(a, b)}, between_loops_);
    if (made) {
      between_loops_ += na * nb;
      coupled_[a].insert(b), coupled_[b].insert(a);
    }
    return a < b ? CoordinateBlock{-2 - entry->second, nb, 1} : CoordinateBlock{-2 - entry->second, 1, na};
  }
  /// The same on the modes of a body.
  int modes_of_Q(int body, int loop) {
    const auto [entry, made] = modal_.try_emplace({body, loop}, e_.n_modal);
    if (made) e_.n_modal += e_.loops[at(loop)].n * ways_.body(body).n_modes;
    return entry->second;
  }

  void blocks_of(EmbeddingStep& s) {
    for (const PendingFlow& a : s.flows)
      for (const PendingFlow& b : s.flows) s.blocks.push_back(block(a.loop, b.loop));
  }

  const Ways& ways_;
  const Wheels& wheels_;
  const std::vector<int>& owner_;
  const Branches& branches_;
  Avoided& avoided_;
  Embedding& e_;
  std::vector<std::set<int>> own_, carried_;    // per body: loops whose coordinates stand on it, pass it
  std::vector<int> carries_;                    // per body: index of what passes it; -1: nothing
  std::map<int, std::vector<Couple>> couples_;  // per body: multipliers of couplings
  std::map<std::tuple<int, int, bool>, int> Q_;
  std::map<std::pair<int, int>, int> modal_, pairs_;
  std::map<int, std::set<int>> coupled_;  // per loop
  std::set<int> closed_;
  int between_loops_ = 0;  // numbers of A
};

}  // namespace

bool write_steps(const Ways& ways, const Wheels& wheels, const std::vector<int>& owner, const Branches& branches, Avoided& avoided,
                 Embedding& e) {
  return StepWriter(ways, wheels, owner, branches, avoided, e).write();
}

}  // namespace cardan::embedding_stages
