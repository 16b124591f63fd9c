// Random scenes in which something happens: every method beside the most accurate one, and its balances.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "bodies/modal/modal_source.hpp"
#include "core/base/impact.hpp"
#include "core/dynamics/observe.hpp"
#include "tests/properties/accurate.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/four_bar.hpp"

namespace cardan::test {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

class Draw {
 public:
  explicit Draw(unsigned seed) : bits_(seed) {}
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(bits_); }
  double decades(double low, double high) { return low * std::pow(high / low, between(0.0, 1.0)); }
  bool chance(double share) { return between(0.0, 1.0) < share; }
  int below(int n) { return static_cast<int>(bits_() % static_cast<unsigned>(n)); }
  Vector3d direction() {
    std::normal_distribution<double> n;
    return Vector3d(n(bits_), n(bits_), n(bits_)).normalized();
  }

 private:
  std::mt19937 bits_;
};

/// What moves, and where something may happen to it.
struct Scene {
  SystemSpec spec;
  std::string body, node;  // what the device is at: a component of the hinge of the body, a node
  double until = 0.0;      // [s]
};

SpringDamper spring(double stiffness, double damping = 0.0) {
  SpringDamper s;
  s.stiffness = stiffness, s.damping = damping;
  return s;
}

Scene mass_on_a_slide(Draw& draw) {
  BodySpec mass = on(particle("mass", draw.decades(0.3, 5.0), {0, 0, 0}), "", "prismatic", {draw.direction()});
  mass.hinge.q = {draw.between(-0.3, 0.3)}, mass.hinge.v = {draw.between(-2.0, 2.0)};
  if (draw.chance(0.6)) mass.hinge.springs = {spring(mass.mass * draw.decades(1.0, 1e3), draw.chance(0.5) ? 0.1 * mass.mass : 0.0)};
  return {system({mass}, uniform_gravity(9.81 * draw.direction())), "mass", "mass", 2.0};
}

BodySpec link(Draw& draw, const std::string& name, double length) {
  const double m = draw.decades(0.5, 5.0), J = m * length * length / 12.0;
  BodySpec b = rigid(name, m, {0.5 * length, 0.02, -0.01}, diagonal({0.2 * J, J, 1.1 * J}));
  NodeSpec tip;
  tip.name = "tip", tip.position = {length, 0, 0};
  b.nodes = {tip};
  return b;
}

Scene two_links(Draw& draw) {
  const double length = draw.between(0.4, 1.0);
  BodySpec upper = on(link(draw, "upper", length), "", "revolute", {draw.direction()});
  BodySpec lower = on(link(draw, "lower", draw.between(0.3, 0.8)), "upper", "revolute", {draw.direction()}, {length, 0, 0});
  upper.hinge.q = {draw.between(-2, 2)}, upper.hinge.v = {draw.between(-2, 2)};
  lower.hinge.q = {draw.between(-1, 1)}, lower.hinge.v = {draw.between(-2, 2)};
  upper.hinge.springs = {spring(0.0, 0.3)}, lower.hinge.springs = {spring(draw.between(0, 5), 0.3)};
  return {system({upper, lower}, uniform_gravity(9.81 * draw.direction())), draw.chance(0.5) ? "upper" : "lower", "lower.tip", 2.0};
}

ModalSource flexible_panel(double length) {
  ModalSource source;
  BeamModel beam;
  beam.length = length, beam.material = {70e9, 0.3, 2700.0}, beam.section = rectangle_section(0.03, 0.002), beam.elements = 6;
  source.model = beam;
  source.modes.count = 3;
  return source;
}

/// A free bus, an arm that turns on it, and a panel with modes on the arm or on the bus.
Scene floating_vehicle(Draw& draw) {
  SystemSpec spec = system(base_with_sprung_arm());
  BodySpec& bus = spec.bodies[0];
  for (double& x : bus.hinge.v) x = draw.between(-0.5, 0.5);
  BodySpec& arm = spec.bodies[1];
  arm.hinge.params = along({draw.direction()});
  arm.hinge.q = {draw.between(-0.5, 0.5)}, arm.hinge.v = {draw.between(-2, 2)};
  arm.hinge.springs = {spring(draw.decades(0.5, 50.0), 0.05)};
  NodeSpec tip;
  tip.name = "tip", tip.position = {1.0, 0, 0.1};
  arm.nodes = {tip};
  BodySpec panel;
  panel.name = "panel", panel.type = "modal_flexible", panel.level = draw.below(2);
  panel.modal = std::make_shared<const ModalData>(make_modal_data(flexible_panel(draw.between(0.8, 1.5))));
  panel = on(panel, draw.chance(0.5) ? "arm" : "base", "locked", {}, {0.4, 0.3, 0});
  spec.bodies.push_back(panel);
  return {spec, "arm", "arm.tip", 3.0};
}

/// A loop of four bars.
Scene linkage(Draw& draw) {
  SystemSpec spec = four_bar("point", draw.between(2.0, 8.0), draw.chance(0.5) ? 1.0 : -1.0);
  spec.loop_form = draw.chance(0.5) ? LoopForm::embedding : LoopForm::multipliers;
  NodeSpec tip;
  tip.name = "middle", tip.position = {0.3, 0.1, 0};
  spec.bodies[1].nodes = {tip};
  spec.bodies[2].hinge.springs = {spring(0.0, 0.05)};
  return {spec, draw.chance(0.5) ? "crank" : "rocker", "coupler.middle", 1.5};
}

using Base = Scene (*)(Draw&);
const std::vector<std::pair<std::string, Base>> kBases = {
    {"Slide", mass_on_a_slide}, {"Links", two_links}, {"Vehicle", floating_vehicle}, {"Linkage", linkage}};

/// Where the coordinate and the node of a scene come to without what happens to them.
struct Reach {
  double lower = kInfinite, upper = -kInfinite, fastest = 0.0;
  double inertia = 0.0;  // of the coordinate, at the start
  std::vector<Vector3d> places;
};
Reach reach(const Scene& scene) {
  Simulation sim(compiled(scene.spec), accurate("dopri5", 1e-8));
  const Model& m = sim.model();
  const UserBody& b = m.user[idx(m.find_body(scene.body))];
  Reach r;
  const double before = sim.vdot()[b.v];
  sim.set_force(b.v, 1.0);
  r.inertia = 1.0 / (sim.vdot()[b.v] - before);
  sim.set_force(b.v, 0.0);
  for (int i = 0; i <= 200; ++i) {
    sim.run(scene.until * i / 200.0);
    const double q = sim.state().q[b.q];
    r.lower = std::min(r.lower, q), r.upper = std::max(r.upper, q), r.fastest = std::max(r.fastest, std::abs(sim.state().v[b.v]));
    r.places.push_back(sim.observe().node(m.find_node(scene.node)).position);
  }
  return r;
}

/// Something happens in it; what cannot be said in the description is done by `prepare`.
struct Eventful {
  SystemSpec spec;
  std::function<void(Simulation&)> prepare;
};
using Happening = Eventful (*)(Scene, const Reach&, Draw&);

HingeSpec& hinge(Scene& s) {
  for (BodySpec& b : s.spec.bodies)
    if (b.name == s.body) return b.hinge;
  throw std::logic_error("no body " + s.body);
}
double inside(const Reach& r, Draw& draw) { return r.lower + draw.between(0.1, 0.9) * (r.upper - r.lower); }

/// On the side of the place that the motion does not start in.
HingeLoadSpec limit(Scene& s, const Reach& r, Draw& draw, double stiffness) {
  const double q0 = hinge(s).q[0], place = inside(r, draw);
  HingeLoadSpec load{0, HingeLaw::stop, {-kInfinite, kInfinite, stiffness, 1.0, 0.0}, {}, {}};
  load.parameters[q0 > place ? 0 : 1] = place;
  if (draw.chance(0.3))
    load.parameters[q0 > place ? 1 : 0] = place + (q0 > place ? 1.0 : -1.0) * (std::abs(q0 - place) + draw.between(0.0, r.upper - r.lower));
  return load;
}

Eventful at_a_stop(Scene s, const Reach& r, Draw& draw) {
  HingeLoadSpec load = limit(s, r, draw, r.inertia * std::pow(draw.decades(5.0, 2e3), 2));
  if (draw.chance(0.5)) load.parameters[3] = 1.5;
  if (draw.chance(0.7)) load.parameters[4] = draw.between(0.0, 1.0) / r.fastest;
  hinge(s).loads = {load};
  return {s.spec, {}};
}

Eventful at_a_hard_stop(Scene s, const Reach& r, Draw& draw) {
  HingeLoadSpec load = limit(s, r, draw, r.inertia * std::pow(draw.decades(30.0, 3e3), 2));
  const double e = draw.chance(0.2) ? 1.0 : draw.between(0.0, 0.9), speed = r.fastest * draw.decades(1e-3, 0.1);
  load.parameters[4] = dissipation_times_speed(std::max(e, 0.05)) / speed;
  load.bounce = {e, speed};
  hinge(s).loads = {load};
  return {s.spec, {}};
}

Eventful under_dry_friction(Scene s, const Reach& r, Draw& draw) {
  const double F = r.inertia * r.fastest * draw.decades(0.2, 20.0);
  s.spec.devices = {device("drag", "dry_friction", {{"coulomb", F}, {"breakaway", F * (draw.chance(0.5) ? 1.0 : draw.between(1.0, 1.5))}},
                           {{"at", s.body}})};
  return {s.spec, {}};
}

Eventful with_a_latch(Scene s, const Reach& r, Draw& draw) {
  s.spec.devices = {device("catch", "latch",
                           {{"place", inside(r, draw)},
                            {"max_rate", r.fastest * draw.decades(0.1, 2.0)},
                            {"stiffness", r.inertia * std::pow(draw.decades(10.0, 300.0), 2)},
                            {"damping", r.inertia * draw.between(0.0, 5.0)}},
                           {{"at", s.body}})};
  return {s.spec, {}};
}

Eventful with_a_tape_spring(Scene s, const Reach& r, Draw& draw) {
  const double steady = r.inertia * draw.decades(0.3, 10.0);
  s.spec.devices = {device("blade", "tape_spring",
                           {{"peak_moment", steady * draw.between(2.0, 10.0)},
                            {"peak_angle", draw.between(0.02, 0.2)},
                            {"steady_moment", steady},
                            {"damping", r.inertia * draw.between(0.0, 1.0)},
                            {"rest", inside(r, draw)}},
                           {{"at", s.body}})};
  return {s.spec, {}};
}

Eventful on_a_cable(Scene s, const Reach& r, Draw& draw) {
  const Vector3d anchor = r.places[0] + draw.between(0.1, 1.0) * draw.direction();
  double nearest = kInfinite, farthest = 0.0;
  for (const Vector3d& p : r.places) nearest = std::min(nearest, (p - anchor).norm()), farthest = std::max(farthest, (p - anchor).norm());
  DeviceSpec line = device("line", "cable",
                           {{"stiffness", std::pow(draw.decades(5.0, 500.0), 2)},
                            {"length", nearest + draw.between(0.1, 0.9) * (farthest - nearest)},
                            {"damping", draw.chance(0.5) ? 0.0 : draw.decades(0.1, 10.0)}},
                           {{"from", "world"}, {"to", s.node}});
  line.mounts["from"].position = anchor;
  s.spec.devices = {line};
  return {s.spec, {}};
}

Eventful against_a_plane(Scene s, const Reach& r, Draw& draw) {
  Vector3d n = draw.direction();
  double lowest = kInfinite, highest = -kInfinite;
  for (const Vector3d& p : r.places) lowest = std::min(lowest, n.dot(p)), highest = std::max(highest, n.dot(p));
  double at = lowest + draw.between(0.1, 0.9) * (highest - lowest);
  if (n.dot(r.places[0]) < at) n = -n, at = -at;  // it begins outside
  const double radius = 0.05;
  DeviceSpec wall = device("wall", "contact",
                           {{"stiffness", std::pow(draw.decades(20.0, 1e3), 2)},
                            {"exponent", draw.chance(0.5) ? 1.0 : 1.5},
                            {"at_depth", 0.01},
                            {"from_radius", radius}},
                           {{"from", s.node}, {"to", "world"}});
  if (draw.chance(0.6)) wall.params["restitution"] = number(draw.between(0.1, 1.0)), wall.params["speed"] = number(1.0);
  if (draw.chance(0.3)) wall.params["friction"] = number(draw.between(0.05, 0.8)), wall.params["width"] = number(0.05);
  wall.params["from_shape"].value = std::string("sphere"), wall.params["to_shape"].value = std::string("plane");
  wall.mounts["to"].position = (at - radius) * n;
  s.spec.devices = {with_vector(wall, "to_axis", n)};
  return {s.spec, {}};
}

/// A relay: a force against the motion's side of a place, with or without hysteresis.
Eventful by_a_relay(Scene s, const Reach& r, Draw& draw) {
  const double place = inside(r, draw), F = r.inertia * r.fastest * draw.decades(0.3, 10.0),
               width = (r.upper - r.lower) * (draw.chance(0.3) ? 0.0 : draw.between(0.01, 0.2));
  const std::string body = s.body;
  return {s.spec, [place, F, width, body](Simulation& sim) {
            const UserBody& b = sim.model().user[idx(sim.model().find_body(body))];
            const int q = b.q, v = b.v;
            sim.set_force(v, sim.state().q[q] > place ? -F : F);
            sim.add_event({"above", [q, place, width](double, const double* x, const double*) { return x[q] - place - width; }, +1,
                           [&sim, v, F] { sim.set_force(v, -F); }});
            sim.add_event({"below", [q, place, width](double, const double* x, const double*) { return x[q] - place + width; }, -1,
                           [&sim, v, F] { sim.set_force(v, F); }});
          }};
}

/// Friction of the hinge itself, and by bristles.
Eventful under_friction(Scene s, const Reach& r, Draw& draw) {
  const double F = r.inertia * r.fastest * draw.decades(0.2, 5.0), breakaway = F * draw.between(1.0, 1.5);
  if (draw.chance(0.5))
    hinge(s).loads = {
        {0, HingeLaw::friction, {F, breakaway, 0.1 * r.fastest, draw.between(0.0, 0.5) * r.inertia, 0.02 * r.fastest}, {}, {}}};
  else
    s.spec.devices = {device("bristles", "lugre_friction",
                             {{"coulomb", F},
                              {"breakaway", breakaway},
                              {"stribeck_rate", 0.1 * r.fastest},
                              {"stiffness", r.inertia * std::pow(draw.decades(20.0, 200.0), 2)},
                              {"damping", r.inertia * draw.between(0.0, 10.0)},
                              {"fading_rate", 0.2 * r.fastest}},
                             {{"at", s.body}})};
  return {s.spec, {}};
}

/// A sampled controller: a force at each tick by what it sees, and one that is held between corners of its own.
Eventful by_ticks(Scene s, const Reach& r, Draw& draw) {
  const double place = inside(r, draw), gain = r.inertia * draw.decades(1.0, 10.0);  // more grows
  const int rate = 5 + draw.below(40);
  const std::string body = s.body;
  return {s.spec, [place, gain, rate, body](Simulation& sim) {
            const UserBody& b = sim.model().user[idx(sim.model().find_body(body))];
            sim.every({1, rate}, [&sim, q = b.q, v = b.v, place, gain] { sim.set_force(v, -gain * (sim.state().q[q] - place)); });
          }};
}

const std::vector<std::pair<std::string, Happening>> kSingle = {{"Stop", at_a_stop},
                                                                {"HardStop", at_a_hard_stop},
                                                                {"DryFriction", under_dry_friction},
                                                                {"Latch", with_a_latch},
                                                                {"TapeSpring", with_a_tape_spring},
                                                                {"Cable", on_a_cable},
                                                                {"Contact", against_a_plane},
                                                                {"Relay", by_a_relay},
                                                                {"Friction", under_friction},
                                                                {"Ticks", by_ticks}};

/// Two of them at once.
Eventful two(Scene s, const Reach& r, Draw& draw) {
  Eventful all{s.spec, {}};
  std::vector<std::function<void(Simulation&)>> prepare;
  const bool turns = hinge(s).type == "revolute";
  const int n = static_cast<int>(kSingle.size()), first = draw.below(n), second = (first + 1 + draw.below(n - 1)) % n;
  for (const int k : {first, second}) {
    if (kSingle[idx(k)].second == with_a_tape_spring && !turns) continue;
    Eventful one = kSingle[idx(k)].second(s, r, draw);
    for (DeviceSpec& d : one.spec.devices) d.name += std::to_string(all.spec.devices.size()), all.spec.devices.push_back(d);
    for (std::size_t b = 0; b < all.spec.bodies.size(); ++b) {
      auto &to = all.spec.bodies[b].hinge.loads, &from = one.spec.bodies[b].hinge.loads;
      to.insert(to.end(), from.begin(), from.end());
    }
    if (one.prepare) prepare.push_back(one.prepare);
  }
  all.prepare = [prepare](Simulation& sim) {
    for (const auto& p : prepare) p(sim);
  };
  return all;
}

const std::vector<std::pair<std::string, Happening>> kHappenings = [] {
  auto all = kSingle;
  all.emplace_back("Two", two);
  return all;
}();

struct Ending {
  VectorXd q, v;
  double off_balance = 0.0;  // the residual of the worst balance over its limit
  std::string refused;
};
/// nudge: of each rate at the start, over its size.
Ending ending(const Eventful& scene, double until, const std::string& method, double tolerance, double nudge = 0.0) {
  Ending e;
  try {
    Simulation sim(compiled(scene.spec), accurate(method, tolerance));
    if (nudge != 0.0) {
      State at = sim.state();
      for (double& v : at.v) v += nudge * (1.0 + std::abs(v));
      sim.set_state(at);
    }
    if (scene.prepare) scene.prepare(sim);
    sim.run(until);
    e.q = sim.state().q, e.v = sim.state().v;
    const LedgerState ledger = sim.ledger();
    if (!ledger.pass)
      e.off_balance = std::max({ledger.linear_relative / ledger.linear_limit, ledger.angular_relative / ledger.angular_limit,
                                ledger.energy_relative / ledger.energy_limit});
  } catch (const std::exception& x) {
    e.refused = x.what();
  }
  return e;
}
double ends_apart(const Ending& a, const Ending& b) {
  if (!a.refused.empty() || !b.refused.empty()) return kInfinite;
  const double d = worse(distance(a.q, b.q), distance(a.v, b.v) / (1.0 + largest(b.v)));
  return std::isnan(d) ? kInfinite : d;
}

using Pair = std::pair<std::size_t, std::size_t>;  // of kBases and kHappenings
std::string name_of(const Pair& p) { return kBases[p.first].first + kHappenings[p.second].first; }

/// Of each pair.
int scenes() {
  const char* asked = std::getenv("CARDAN_SCENES");
  return asked != nullptr ? std::atoi(asked) : 1;
}

std::vector<std::string> methods_for(const Scene& scene) {
  std::vector<std::string> all = {"dopri5", "dop853", "cvode_adams", "cvode_bdf", "ark_explicit", "ark_imex", "ark_implicit"};
  if (scene.spec.loops.empty()) all.insert(all.end(), {"exponential", "multirate"});  // they take no loops
  return all;
}

/// What is missed, or happens twice, is seen: errors are those of the steps, times what the motion makes of an error. That is taken from a
/// run that starts a little beside, and from how far the two most accurate ones are apart. Methods of many steps find events by polynomials
/// whose end lies beyond. of_balances: limits that a residual may have; those of the steps that an event ends are not always enough.
void expect_the_same_end(const Pair& pair, unsigned drawn_from, double of_balances) {
  constexpr double tolerance = 1e-8, finest = 1e-12, of_one_step = 1e4, of_many_steps = 3e5, nudge = 1e-9;
  SCOPED_TRACE(name_of(pair) + " drawn from " + std::to_string(drawn_from));
  Draw draw(drawn_from);
  const Scene scene = kBases[pair.first].second(draw);
  const Eventful eventful = kHappenings[pair.second].second(scene, reach(scene), draw);
  const auto end = [&](const std::string& method, double relative, double beside = 0.0) {
    return ending(eventful, scene.until, method, relative, beside);
  };
  const Ending truth = end("dop853", finest);
  ASSERT_EQ(truth.refused, "");
  const double grows = std::max(1.0, ends_apart(truth, end("dop853", finest, nudge)) / nudge),
               again = ends_apart(truth, end("dopri5", finest));
  EXPECT_LT(again, of_one_step * finest * grows) << "dopri5 at " << finest;
  const double one = tolerance * std::max(grows, again / (30.0 * finest));
  for (const std::string& method : methods_for(scene)) {
    const Ending e = end(method, tolerance);
    EXPECT_LT(ends_apart(truth, e), one * (method.starts_with("cvode") ? of_many_steps : of_one_step)) << method << " " << e.refused;
    EXPECT_LT(e.off_balance, of_balances) << method;
  }
}

/// From a checkpoint the motion goes on as if there had been none, to the last bit.
void expect_the_same_bits(const Pair& pair, unsigned drawn_from) {
  SCOPED_TRACE(name_of(pair) + " drawn from " + std::to_string(drawn_from));
  Draw draw(drawn_from);
  const Scene scene = kBases[pair.first].second(draw);
  const Eventful eventful = kHappenings[pair.second].second(scene, reach(scene), draw);
  const double at = scene.until * draw.between(0.05, 0.95);
  for (const std::string& method : methods_for(scene)) {
    Simulation whole(compiled(eventful.spec), accurate(method, 1e-8)), part(compiled(eventful.spec), accurate(method, 1e-8));
    if (eventful.prepare) eventful.prepare(whole), eventful.prepare(part);
    whole.run(at);
    part.resume(whole.checkpoint());
    whole.run(scene.until), part.run(scene.until);
    EXPECT_TRUE(whole.state().q == part.state().q && whole.state().v == part.state().v && whole.state().z == part.state().z) << method;
    EXPECT_EQ(whole.ledger().energy, part.ledger().energy) << method;
    EXPECT_EQ(whole.statistics().rhs_calls, part.statistics().rhs_calls) << method;
  }
}

class EventScenes : public ::testing::TestWithParam<Pair> {
 protected:
  static unsigned drawn_from(unsigned seed) { return seed * 64 + static_cast<unsigned>(16 * GetParam().first + GetParam().second); }
};

TEST_P(EventScenes, EveryMethodComesToTheSameEnd) {
  for (unsigned seed = first_seed(); seed < first_seed() + static_cast<unsigned>(scenes()); ++seed)
    expect_the_same_end(GetParam(), drawn_from(seed), 4.0);
}

TEST_P(EventScenes, ResumesBitForBit) {
  for (unsigned seed = first_seed(); seed < first_seed() + static_cast<unsigned>(scenes()); ++seed)
    expect_the_same_bits(GetParam(), drawn_from(seed));
}

/// Scenes that were wrong once: a method that came no further, integrals and balances off.
TEST(ScenesWithEvents, ThatWereWrongOnce) {
  const auto find = [](const auto& all, const std::string& name) {
    return static_cast<std::size_t>(std::ranges::find(all, name, [](const auto& e) { return e.first; }) - all.begin());
  };
  const std::vector<std::tuple<std::string, std::string, unsigned>> all = {
      {"Links", "HardStop", 649}, {"Slide", "Stop", 320},        {"Slide", "Stop", 704},        {"Links", "Contact", 206},
      {"Links", "Contact", 1230}, {"Slide", "DryFriction", 386}, {"Slide", "DryFriction", 706}, {"Slide", "DryFriction", 962},
      {"Slide", "Latch", 515},    {"Slide", "HardStop", 1153}};
  for (const auto& [base, happening, from] : all) expect_the_same_end({find(kBases, base), find(kHappenings, happening)}, from, 1.0);
}

std::vector<Pair> pairs() {
  std::vector<Pair> all;
  for (std::size_t b = 0; b < kBases.size(); ++b)
    for (std::size_t h = 0; h < kHappenings.size(); ++h)
      if (kBases[b].second != mass_on_a_slide || kHappenings[h].second != with_a_tape_spring) all.emplace_back(b, h);  // it turns nothing
  return all;
}
INSTANTIATE_TEST_SUITE_P(, EventScenes, ::testing::ValuesIn(pairs()), [](const auto& p) { return name_of(p.param); });

}  // namespace
}  // namespace cardan::test
