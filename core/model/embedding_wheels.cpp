#include <algorithm>
#include <functional>
#include <set>

#include "core/model/embedding_stages.hpp"

namespace cardan::embedding_stages {
namespace {

/// One wheel beside its hinge, with axes along each other, and no other wheel turns with it.
bool is_gear(const Model& m, const Wheels& wheels, const Transmission& t) {
  if (t.wheels.size() != 1 || t.way.size() != 1 || !t.rows[0].coupling.is_linear() || wheels.turning[at(t.way[0])].size() != 1)
    return false;
  if (m.bodies[at(t.wheels[0])].kind != BodyKernel::rotor) return false;
  const Vec3<double> across = cardan::cross(axis_on_carrier(m, t.way[0]), axis_on_carrier(m, t.wheels[0]));
  return dot(across, across) < 1e-30;  // but for rounding
}

Gear gear_of(const Model& m, const Transmission& t) {
  const Transmission::Row& row = t.rows[0];
  Gear gear;
  gear.body = t.way[0], gear.wheel = t.wheels[0];
  gear.row = row.row, gear.drive = row.drive;
  gear.sense = dot(axis_on_carrier(m, gear.body), axis_on_carrier(m, gear.wheel)) > 0.0 ? 1.0 : -1.0;
  double slopes[2] = {};  // of the wheel, of the hinge
  for (std::size_t i = 0; i < row.column.size(); ++i) slopes[row.column[i]] += row.coupling.terms[i].coefficient;
  gear.ratio = -gear.sense * slopes[1] / slopes[0], gear.per_slope = 1.0 / slopes[0];
  const AxisBody& wheel = m.axis_bodies[at(gear.wheel)];
  gear.v = wheel.v, gear.J_axial = wheel.J_axial;
  gear.coupled = gear.ratio * wheel.J_axial, gear.reflected = gear.ratio * gear.coupled;
  return gear;
}

/// Wheel w of a transmission, which has its numbers already.
TurningWheel turning_wheel(const Model& m, const Transmission& t, std::size_t w) {
  const int k = t.wheels[w];
  const SweepBody& b = m.bodies[at(k)];
  const AxisBody& a = m.axis_bodies[at(k)];
  const std::size_t n = t.wheels.size();
  TurningWheel wheel{k, b.parent, b.v, a.J_axial, {a.u[0], a.u[1], a.u[2]}, t.numbers + static_cast<int>(n * t.way.size() + w), 0};
  if (b.kind != BodyKernel::rotor) {
    const int axis = b.axis.x != 0.0 ? 0 : b.axis.y != 0.0 ? 1 : 2;
    wheel.on_ground = 1 + axis, wheel.u = {};
    wheel.J_axial = axis == 0 ? b.M_sweep.J.xx : axis == 1 ? b.M_sweep.J.yy : b.M_sweep.J.zz;
  }
  return wheel;
}

/// Transmissions that share hinges and have one carrier, of few hinges.
void place_chains(const Model& m, std::vector<int>& chain_of, Embedding& e) {
  std::vector<std::uint8_t> done(e.transmissions.size());
  for (std::size_t i = 0; i < done.size(); ++i) {
    if (done[i]) continue;
    std::vector<std::size_t> all{i};
    std::set<int, std::greater<>> hinges;
    std::size_t longest = 0;
    bool one = true;  // carrier
    done[i] = 1;
    for (std::size_t next = 0; next < all.size(); ++next) {
      const Transmission& t = e.transmissions[all[next]];
      hinges.insert(t.way.begin(), t.way.end());
      longest = std::max(longest, t.way.size());
      one = one && m.bodies[at(t.way[0])].parent == m.bodies[at(e.transmissions[i].way[0])].parent;
      for (std::size_t j = 0; j < done.size(); ++j)
        if (!done[j] && std::ranges::any_of(e.transmissions[j].way, [&](int k) { return hinges.contains(k); }))
          done[j] = 1, all.push_back(j);
    }
    if (!one || hinges.size() != longest || hinges.size() > GearedChain::kMost) continue;
    GearedChain chain;
    chain.hinges.assign(hinges.begin(), hinges.end());
    chain.carrier = m.bodies[at(chain.hinges.back())].parent;
    for (const std::size_t j : all) {
      const Transmission& t = e.transmissions[j];
      for (std::size_t w = 0; w < t.wheels.size(); ++w) {
        GearedChain::Wheel wheel;
        wheel.wheel = static_cast<int>(std::ranges::find(e.wheels, t.wheels[w], &TurningWheel::body) - e.wheels.begin());
        for (std::size_t h = 0; h < t.way.size(); ++h) {
          const auto on = std::ranges::find(chain.hinges, t.way[h]) - chain.hinges.begin();
          wheel.ratio[on] = t.numbers + static_cast<int>(w * t.way.size() + h);
        }
        chain.wheels.push_back(wheel);
      }
    }
    for (const int k : chain.hinges) chain_of[at(k)] = static_cast<int>(e.chains.size());
    e.chains.push_back(std::move(chain));
  }
}

/// A wheel of a transmission on its way from the outermost hinge to its carrier.
struct WheelOnItsWay {
  std::size_t transmission;
  int last = -1, turn = 0;  // the hinge before, index into Embedding::geared, and which of its turns
};

void place_hinge(int k, std::vector<WheelOnItsWay>& on_their_way, Embedding& e) {
  GearedHinge hinge;
  hinge.body = k;
  std::vector<WheelOnItsWay> before;
  for (std::size_t w = 0; w < on_their_way.size(); ++w) {
    WheelOnItsWay& wheel = on_their_way[w];
    const Transmission& t = e.transmissions[wheel.transmission];
    const auto on = std::ranges::find(t.way, k);
    if (on == t.way.end()) continue;
    const auto along = static_cast<int>(t.way.size()),
               which = static_cast<int>(std::ranges::find(t.wheels, e.wheels[w].body) - t.wheels.begin());
    hinge.turns.push_back(
        {static_cast<int>(w), t.numbers + which * along + static_cast<int>(on - t.way.begin()), k == t.way.back(), k == t.way.front()});
    before.push_back(wheel);
    wheel.last = static_cast<int>(e.geared.size()), wheel.turn = static_cast<int>(before.size()) - 1;
  }
  for (const WheelOnItsWay& a : before)
    for (const WheelOnItsWay& b : before) {
      const bool met = a.last >= 0 && a.last == b.last;
      hinge.pairs.push_back(met ? e.geared[at(a.last)].A + a.turn * static_cast<int>(e.geared[at(a.last)].turns.size()) + b.turn : -1);
    }
  const int n = static_cast<int>(hinge.turns.size());
  hinge.A = e.n_pairs, e.n_pairs += n * (n + 1);
  e.geared.push_back(std::move(hinge));
}

}  // namespace

Wheels place_wheels(const Ways& ways, const ByRates& by_rates, const Avoided& avoided, Embedding& e) {
  const Model& m = ways.model;
  const std::size_t bodies = m.bodies.size();
  Wheels wheels;
  wheels.turning.resize(bodies), wheels.taken.resize(by_rates.size());
  wheels.gear_of.assign(bodies, -1), wheels.geared_of.assign(bodies, -1), wheels.chain_of.assign(bodies, -1);
  ByRates may(by_rates);
  for (std::size_t l = 0; l < may.size(); ++l) may[l] = may[l] && !avoided.crossed[l];
  std::vector<Transmission> all = find_transmissions(m, ways.rows, ways.hinges, may);
  for (const Transmission& t : all)
    for (const Transmission::Row& row : t.rows) {
      wheels.taken[at(row.loop)] = 1;
      for (const std::vector<int>* turn : {&t.wheels, &t.way})
        for (const int k : *turn) wheels.turning[at(k)].push_back(row.loop);
    }
  for (Transmission& t : all)
    if (is_gear(m, wheels, t))
      e.gears.push_back(gear_of(m, t));
    else
      e.transmissions.push_back(std::move(t));
  std::ranges::sort(e.gears, std::greater<>(), &Gear::body);
  for (std::size_t i = 0; i < e.gears.size(); ++i)
    wheels.gear_of[at(e.gears[i].body)] = wheels.gear_of[at(e.gears[i].wheel)] = static_cast<int>(i);

  std::vector<WheelOnItsWay> on_their_way;
  std::set<int, std::greater<>> hinges;
  for (std::size_t i = 0; i < e.transmissions.size(); ++i) {
    Transmission& t = e.transmissions[i];
    const int n = static_cast<int>(t.wheels.size()), along = static_cast<int>(t.way.size());
    t.numbers = e.n_ratios, e.n_ratios += n * (along + 1 + n);
    for (Transmission::Row& row : t.rows) row.angles = e.n_angles, e.n_angles += row.sinusoids.angles();
    for (std::size_t w = 0; w < t.wheels.size(); ++w) {
      e.wheels.push_back(turning_wheel(m, t, w));
      on_their_way.push_back({i});
      wheels.geared_of[at(t.wheels[w])] = kWheel;
    }
    hinges.insert(t.way.begin(), t.way.end());
  }
  place_chains(m, wheels.chain_of, e);
  for (const int k : hinges) {
    if (wheels.chain_of[at(k)] >= 0) continue;
    wheels.geared_of[at(k)] = static_cast<int>(e.geared.size());
    place_hinge(k, on_their_way, e);
  }
  return wheels;
}

}  // namespace cardan::embedding_stages
