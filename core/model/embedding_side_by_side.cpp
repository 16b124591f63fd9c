#include <algorithm>
#include <functional>
#include <span>

#include "core/model/embedding_stages.hpp"

namespace cardan::embedding_stages {
namespace {

/// Takes four or two at a time, fours as two halves too (AlikeGears::half).
class SideBySide {
 public:
  SideBySide(const Model& model, Embedding& e) : model_(model), e_(e) {}

  /// Gears of one step: those of one kernel on one level, and so none outboard of another.
  void place_gears() {
    for (EmbeddingStep& s : e_.steps) {
      if (s.kind != EmbeddingStep::Kind::gear) continue;
      const std::span<Gear> gears(e_.gears.data() + s.begin, e_.gears.data() + s.end);
      const auto key = [&](const Gear& gear) { return std::pair(-level(gear.body), model_.bodies[at(gear.body)].kind); };
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
  void place_chains() {
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
  void place_rows() {
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

 private:
  /// So many of n at a time.
  static long alike(std::ptrdiff_t n) { return n >= 4 ? 4 : n >= 2 ? 2 : 1; }
  int level(int k) const {
    int n = 0;
    for (; k > 0; k = model_.bodies[at(k)].parent) ++n;
    return n;
  }

  /// By ends that meet; nobody else asks for what is found of the bodies on its way.
  bool is_found_side_by_side(const EmbeddedLoop& c) const {
    const bool meets = c.closing == Closing::point || c.closing == Closing::line || c.closing == Closing::plane;
    if (!meets || !c.by_rates || c.from_node >= 0 || c.to_node >= 0 || c.deforms || c.home_modes >= 0) return false;
    if (c.path.size() > AlikeRows::kMostBodies || c.rows * c.own_columns > AlikeRows::kMostNumbers) return false;
    return std::ranges::all_of(c.path, [&](const EmbeddedLoop::PathBody& p) {
      if (p.seen) return true;
      const BodyKernel kind = model_.bodies[at(p.body)].kind;
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
      return x.seen ? x.state == y.state : x.shifts == y.shifts && model_.bodies[at(x.body)].kind == model_.bodies[at(y.body)].kind;
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
        const SweepBody& b = model_.bodies[at(p.body)];
        if (p.shifts) {
          body.hinges.kind = b.kind, body.hinges.body[i] = p.body, body.hinges.v[i] = b.v;
          set(body.u, b.axis);
          continue;
        }
        body.hinges.set(i, model_, p.body);
        const double* r = model_.axis_bodies[at(p.body)].p;
        set(body.p, {r[0], r[1], r[2]});
      }
      const Mat3<double>& R = c.from.R;
      set(out.from_R, {R.xx, R.xy, R.xz}), set(out.from_R + 3, {R.yx, R.yy, R.yz}), set(out.from_R + 6, {R.zx, R.zy, R.zz});
      set(out.from_p, c.from.p), set(out.to_p, c.to.p);
    }
    return out;
  }
  void add_to(AlikeChains& side, const GearedChain& chain) const {
    const int i = side.n++;
    side.hinges.resize(chain.hinges.size()), side.wheels.resize(chain.wheels.size());
    for (std::size_t x = 0; x < side.hinges.size(); ++x) side.hinges[x].set(i, model_, chain.hinges[x]);
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
    const auto same_hinge = [&](int i, int j) { return model_.bodies[at(i)].kind == model_.bodies[at(j)].kind && level(i) == level(j); };
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
      out.hinges.set(i, model_, gear.body);
      out.wheel[i] = gear.wheel, out.row[i] = gear.row, out.drive[i] = gear.drive, out.v[i] = gear.v;
      out.driven = out.driven || gear.drive >= 0;
      out.sense[i] = gear.sense, out.ratio[i] = gear.ratio, out.per_slope[i] = gear.per_slope;
      out.J_axial[i] = gear.J_axial, out.coupled[i] = gear.coupled, out.reflected[i] = gear.reflected;
    }
    return out;
  }
  const Model& model_;
  Embedding& e_;
};

}  // namespace

void place_side_by_side(const Model& model, Embedding& e) {
  SideBySide side(model, e);
  side.place_chains(), side.place_gears(), side.place_rows();
}

}  // namespace cardan::embedding_stages
