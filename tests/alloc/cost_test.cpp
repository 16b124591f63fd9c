// A scene pays for what it has: memory, lines of the program and operations follow from it. Operations are counted on the
// kernels themselves (core/soa/cost.hpp), so that a limit here is a statement about formulas, not about a machine. What
// families compute in double (hinges without a constant axis, inertia of flexible bodies above level 0) is not counted.
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <fstream>
#include <numbers>
#include <sstream>

#include "bodies/modal/lumped.hpp"
#include "core/dynamics/forward.hpp"
#include "core/sim/simulation.hpp"
#include "core/soa/cost.hpp"
#include "core/soa/record.hpp"
#include "tests/properties/random_devices.hpp"
#include "tests/support/builders.hpp"
#include "tests/support/random_tree.hpp"
#include "tests/support/sanitized.hpp"

namespace cardan::test {
namespace {

using Eigen::Vector3d;

SystemSpec chain(int n, const std::string& hinge = "revolute") {
  std::vector<BodySpec> bodies;
  for (int i = 0; i < n; ++i) {
    bodies.push_back(on(rigid(fmt::format("b{}", i), 1.0 + i % 3, Vector3d(0.1, 0.2, 0.5), diagonal({1, 1.5, 2})),
                        i == 0 ? "" : fmt::format("b{}", i - 1), hinge,
                        hinge == "revolute" ? std::vector<Vector3d>{Vector3d::Unit(i % 3)} : std::vector<Vector3d>{}, Vector3d(0, 0, 1)));
  }
  return system(bodies);
}

std::size_t rounded(std::size_t bytes) { return (bytes + 63) / 64 * 64; }
/// Core and record of a body.
template <class Record>
std::size_t bytes_of() {
  return rounded(sizeof(soa::Core<double>) + sizeof(Record));
}

TEST(Cost, ARigidChainHasNoModalField) {
  const int n = 40;
  const auto model = compiled(chain(n));
  Workspace ws(*model);
  for (int k = 1; k <= n; ++k) EXPECT_EQ(ws.modal_of(k), nullptr);
  EXPECT_FALSE(ws.has_world());
  // The body; sine and cosine of its hinge (40 of them: a multiple of 8); q of the last evaluation. And of the ground core and z.
  const std::size_t one = bytes_of<soa::AxisRecord<double>>() + 3 * sizeof(double);
  EXPECT_EQ(ws.bytes(), bytes_of<Force<double>>() + n * one);
}

TEST(Cost, BytesGrowLinearly) {
  for (const char* hinge : {"revolute", "ball", "free"}) {
    const auto bytes = [&](int n) { return Workspace(*compiled(chain(n, hinge))).bytes(); };
    EXPECT_EQ(bytes(401) - bytes(201), bytes(201) - bytes(1)) << hinge;
  }
}

TEST(Cost, OneFlexibleBodyDoesNotMakeTheOthersDearer) {
  const RandomTree tree = random_tree(11, {.bodies = 12, .roots = 1, .flexible = 0.15, .floating = true});
  const auto model = compiled(tree.spec);
  const Workspace ws(*model);
  int rigid_records = 0;
  for (int k = 1; k < static_cast<int>(model->bodies.size()); ++k) {
    const SweepBody& b = model->bodies[static_cast<std::size_t>(k)];
    EXPECT_EQ(ws.modal_of(k) != nullptr, b.n_modes > 0 || b.onode >= 0);
    if (!ws.modal_of(k)) ++rigid_records;
  }
  EXPECT_GT(rigid_records, 3);
}

TEST(Cost, TheProgramOfAnUnforcedSceneIsItsHingesAndTheThreeSweeps) {
  CompileOptions bare;
  bare.node_wrenches = false;
  const auto model = compiled(chain(5), bare);
  for (const OpCode k : {OpCode::elastic, OpCode::world, OpCode::central_gravity, OpCode::node_wrenches}) EXPECT_FALSE(model->has(k));
  EXPECT_EQ(model->program.size(), 1 + 3 * model->runs.size());
}

TEST(Cost, AnOpIsThereForWhatNeedsIt) {
  SystemSpec spec = chain(2, "ball");
  EXPECT_TRUE(compiled(spec)->has(OpCode::node_wrenches));
  EXPECT_FALSE(compiled(spec)->has(OpCode::world));
  CompileOptions with_world;
  with_world.world_wrenches = true;
  EXPECT_TRUE(compiled(spec, with_world)->has(OpCode::world));
  spec.gravity = uniform_gravity({0, 0, -9.81});
  EXPECT_FALSE(compiled(spec)->has(OpCode::central_gravity));
  spec.gravity = central_gravity(1.0, true, {100, 0, 0});
  EXPECT_TRUE(compiled(spec)->has(OpCode::central_gravity));
  EXPECT_TRUE(compiled(spec)->has(OpCode::world));
}

// ---- operations ----

const Vector3d X = Vector3d::UnitX(), Y = Vector3d::UnitY(), Z = Vector3d::UnitZ();

struct Costs {
  std::shared_ptr<const Model> model;
  std::vector<soa::OpCost> ops;
  std::size_t bytes = 0;
  long flops() const {
    long sum = 0;
    for (const soa::OpCost& op : ops) sum += op.flops;
    return sum;
  }
  long flops(OpCode code) const {
    long sum = 0;
    for (std::size_t i = 0; i < ops.size(); ++i) sum += model->program[i].code == code ? ops[i].flops : 0;
    return sum;
  }
  const Run* run(std::size_t i) const {
    return model->program[i].run < 0 ? nullptr : &model->runs[static_cast<std::size_t>(model->program[i].run)];
  }
};

/// Loads: one node wrench per entry, on that node.
Costs costs(const SystemSpec& spec, const CompileOptions& options = {}, const std::vector<std::string>& loads = {},
            bool world_axes = false) {
  Costs c;
  c.model = compiled(spec, options);
  std::vector<NodeWrench> wrenches;
  for (const std::string& node : loads) wrenches.push_back({c.model->find_node(node), world_axes, {{1, 2, 3}, {4, 5, 6}}});
  c.ops = soa::op_costs(*c.model, c.model->initial_state(), wrenches);
  c.bytes = Workspace(*c.model).bytes();
  return c;
}

/// Their laws are C functions: not counted, and timed where they stand in the program.
TEST(Cost, DevicesAreTimedInTheProgram) {
  SystemSpec spec = system({on(rigid("bus", 100, {0, 0, 0}, diagonal({10, 12, 14})), "", "free")});
  spec.devices = {device("wheel", "momentum_wheel", {{"inertia", 0.1}}, {{"at", "bus"}})};
  Costs c = costs(spec);
  EXPECT_EQ(c.flops(OpCode::devices), -1);
  const State at = c.model->initial_state();
  const std::vector<double> zero(static_cast<std::size_t>(c.model->nv));
  int calls = 0;
  soa::measure(*c.model, {.q = at.q.data(), .v = at.v.data(), .tau = zero.data(), .vdot = zero.data()}, c.ops, [&](Workspace& ws) {
    EXPECT_TRUE(ws.has_world()) << "poses are there before them";
    ++calls;
  });
  EXPECT_GT(calls, 0);
}

CompileOptions no_loads() {
  CompileOptions o;
  o.node_wrenches = false;
  return o;
}

/// A bus with a panel and an antenna on it.
std::vector<BodySpec> base_scene() {
  return {on(rigid("bus", 100, {0.01, 0.02, 0.03}, diagonal({10, 12, 14})), "", "free"),
          on(rigid("panel", 5, {0.1, 0.5, 0}, diagonal({2, 0.5, 2.5})), "bus", "revolute", {Y}, {0, 0.5, 0}),
          on(rigid("antenna", 1, {0.1, 0.2, 0.3}, diagonal({0.1, 0.15, 0.2})), "panel", "revolute", {X}, {0, 1, 0})};
}
std::vector<BodySpec> with(std::vector<BodySpec> scene, const BodySpec& body) {
  scene.push_back(body);
  return scene;
}
/// On a revolute hinge about z; axisymmetric about it when both moments across are equal.
BodySpec spinning(const std::string& inboard, double J_y) {
  return on(rigid("spinning", 2, Vector3d::Zero(), diagonal({0.01, J_y, 0.02})), inboard, "revolute", {Z}, {0.1, 0, 0.2});
}
BodySpec wheel(const std::string& inboard) { return spinning(inboard, 0.01); }
BodySpec not_axisymmetric(const std::string& inboard) { return spinning(inboard, 0.011); }

/// Twelve masses along x, 3 m, that bend along y and z by turns, with a node at the tip; their own inertia if asked for, about
/// axes that are not theirs: so the modal mass depends on the deformation (levels 1 and 2).
BodySpec beam(const std::string& inboard, int level, int modes, bool rotary = false) {
  const double length = 3.0;
  const auto shapes = [&](double x, Eigen::MatrixXd& Phi, Eigen::MatrixXd& Psi) {
    Phi = Psi = Eigen::MatrixXd::Zero(3, modes);
    for (int j = 0; j < modes; ++j) {
      const double k = (0.5 + j / 2) * std::numbers::pi / length, slope = k * std::sin(k * x);
      Phi(1 + j % 2, j) = 1.0 - std::cos(k * x);
      Psi(2 - j % 2, j) = j % 2 == 0 ? slope : -slope;
    }
  };
  std::vector<MassNode> masses(12);
  for (int i = 0; i < 12; ++i) {
    MassNode& n = masses[static_cast<std::size_t>(i)];
    n.mass = 0.4;
    n.position = {length * (i + 1) / 12, 0, 0};
    if (rotary) n.inertia << 1e-3, 2e-4, 0, 2e-4, 2e-3, 0, 0, 0, 3e-3;
    shapes(n.position.x(), n.Phi, n.Psi);
  }
  ModalNode tip{"tip", {length, 0, 0}, Eigen::Matrix3d::Identity(), {}, {}};
  shapes(length, tip.Phi, tip.Psi);
  const Eigen::MatrixXd K = Eigen::VectorXd::LinSpaced(modes, 10.0, 1000.0).asDiagonal();
  BodySpec b;
  b.name = "beam";
  b.rotary_tolerance = 0.0;  // all of it, so that levels differ in nothing else
  b.type = "modal_flexible";
  b.modal = std::make_shared<const ModalData>(lumped_modal_data(std::move(masses), K, 0.01 * K, {tip}));
  b.level = level;
  return on(b, inboard, "revolute", {X}, {0.5, 0, 0});
}

/// Every op of `less` stands in `more`, in order and at the same flops and bytes; gives back the others of `more`.
std::vector<std::string> added_ops(const Costs& less, const Costs& more) {
  std::vector<std::string> added;
  std::size_t i = 0;
  for (std::size_t j = 0; j < more.ops.size(); ++j) {
    if (i < less.ops.size() && less.model->program[i].code == more.model->program[j].code && less.ops[i].name == more.ops[j].name) {
      EXPECT_EQ(more.ops[j].flops, less.ops[i].flops) << more.ops[j].name;
      EXPECT_EQ(more.ops[j].bytes, less.ops[i].bytes) << more.ops[j].name;
      ++i;
    } else {
      added.push_back(more.ops[j].name);
    }
  }
  EXPECT_EQ(i, less.ops.size());
  return added;
}

// Each body has its own share in each sweep and no other: with three axes in turn, three more bodies cost the same
// wherever the chain ends.
TEST(Cost, OperationsGrowLinearly) {
  for (const char* hinge : {"revolute", "ball", "free"}) {
    const auto flops = [&](int n) { return costs(chain(n, hinge)).flops(); };
    const long hundred = flops(100), four = flops(400);
    EXPECT_EQ(flops(1000) - four, 2 * (four - hundred)) << hinge;
    EXPECT_EQ((four - hundred) % 100, 0) << hinge;
  }
}

// Three bodies about parallel axes (one kernel): side by side there are two leaves, in a row there is one.
TEST(Cost, ALeafIsNoDearerThanAnInnerBody) {
  const auto scene = [](const std::string& second_to) {
    const auto body = [](const std::string& name) { return rigid(name, 1, {0.1, 0.2, 0.3}, diagonal({1, 1.5, 2})); };
    return costs(system(
        {on(body("a"), "", "revolute", {Z}, X), on(body("b"), "a", "revolute", {Z}, X), on(body("c"), second_to, "revolute", {Z}, X)}));
  };
  EXPECT_LE(scene("a").flops(), scene("b").flops());
  EXPECT_LE(scene("a").bytes, scene("b").bytes);
}

// A wheel on a body (kernels_axis.hpp, inward_rotor, acceleration_rotor): tau + load 1, Ja v 1, w x u 9, times 3,
// u* gamma 5, times Ja and subtracted 2, times u 3, two sums of vectors 6; v' 1 + 3 + 5 + 1. That is 40, whatever the
// carrier's own hinge; a body in its place turns and shifts a 6 x 6 matrix.
TEST(Cost, AWheelIsAFractionOfABody) {
  const Costs base = costs(system(base_scene()));
  for (const char* carrier : {"bus", "panel", "antenna"}) {
    const Costs rotor = costs(system(with(base_scene(), wheel(carrier)))),
                body = costs(system(with(base_scene(), not_axisymmetric(carrier))));
    ASSERT_EQ(rotor.model->rotors.size(), 1u);
    ASSERT_TRUE(body.model->rotors.empty());
    EXPECT_LE(rotor.flops() - base.flops(), 40) << carrier;
    EXPECT_LE(6 * (rotor.flops() - base.flops()), body.flops() - base.flops()) << carrier;
    EXPECT_EQ(rotor.flops(OpCode::hinge_records), base.flops(OpCode::hinge_records)) << carrier;
    EXPECT_EQ(rotor.flops(OpCode::outward), base.flops(OpCode::outward)) << carrier;
    EXPECT_EQ(rotor.bytes - base.bytes, bytes_of<soa::AxisRecord<double>>() + sizeof(double)) << carrier;  // its q
  }
}

// A second wheel costs what the first did: none of it is shared, none of it falls on the carrier.
TEST(Cost, WheelsAddUp) {
  std::vector<BodySpec> scene = base_scene();
  std::vector<long> flops = {costs(system(scene)).flops()};
  for (int i = 0; i < 4; ++i) {
    scene.push_back(wheel("bus"));
    scene.back().name += std::to_string(i);
    flops.push_back(costs(system(scene)).flops());
    EXPECT_EQ(flops.back() - flops[flops.size() - 2], flops[1] - flops[0]);
  }
}

// Rotors have no pose, no P and no z of their own: nothing happens base to tip.
TEST(Cost, ARunOfWheelsHasNoOutwardOp) {
  const auto outward_runs = [](const Costs& c) {
    std::vector<int> bodies;
    for (std::size_t i = 0; i < c.ops.size(); ++i)
      if (c.model->program[i].code == OpCode::outward) bodies.push_back(c.run(i)->begin);
    return bodies;
  };
  const BodySpec bus = base_scene()[0];
  const Costs wheels = costs(system({bus, wheel("bus")}), no_loads());
  EXPECT_EQ(outward_runs(wheels), std::vector<int>{1});
  EXPECT_FALSE(wheels.model->has(OpCode::hinge_records));  // nor a sine
  EXPECT_EQ(wheels.ops.size(), 2u + 3u);
  // Together with a body that turns the run has one again, whichever of them comes first.
  for (const auto& scene : {std::vector{bus, wheel("bus"), base_scene()[1]}, std::vector{bus, base_scene()[1], wheel("bus")}}) {
    const Costs mixed = costs(system(scene), no_loads());
    EXPECT_EQ(outward_runs(mixed), (std::vector<int>{1, 2}));
    EXPECT_EQ(mixed.ops.size(), 1u + 3u + 3u);
  }
}

TEST(Cost, ALockedBodyIsFree) {
  const Costs base = costs(system(base_scene()));
  for (const char* carrier : {"", "bus", "panel", "antenna"}) {
    for (const char* hinge : {"revolute", "ball", "locked"}) {
      BodySpec body = not_axisymmetric(carrier);
      body.hinge.type = hinge;
      if (std::string(hinge) != "revolute") body.hinge.params = {};
      body.hinge.locked = true;
      const Costs locked = costs(system(with(base_scene(), body)));
      EXPECT_TRUE(added_ops(base, locked).empty());
      EXPECT_EQ(locked.flops(), base.flops()) << hinge << " on " << carrier;
      EXPECT_EQ(locked.bytes, base.bytes) << hinge << " on " << carrier;
    }
  }
}

// -g is the acceleration of the ground: the sweeps carry it as any other.
TEST(Cost, UniformGravityIsFree) {
  const Costs none = costs(system(base_scene())), uniform = costs(system(base_scene(), uniform_gravity({0, 0, -9.81})));
  EXPECT_TRUE(added_ops(none, uniform).empty());
  EXPECT_EQ(uniform.bytes, none.bytes);
}

TEST(Cost, CentralGravityAddsItsTwoOps) {
  const auto scene = with(base_scene(), beam("bus", 1, 4));
  const Costs none = costs(system(scene)), central = costs(system(scene, central_gravity(4e14, true, {7e6, 0, 0}))),
              plain = costs(system(scene, central_gravity(4e14, false, {7e6, 0, 0})));
  EXPECT_EQ(added_ops(none, central), (std::vector<std::string>{"world poses", "central gravity"}));
  EXPECT_GT(central.flops(OpCode::central_gravity), plain.flops(OpCode::central_gravity));  // the gradient
  EXPECT_EQ(central.flops(OpCode::world), plain.flops(OpCode::world));
  // a pose and a velocity of each body and of the ground
  const std::size_t bodies = none.model->bodies.size();
  EXPECT_EQ(central.bytes - none.bytes, bodies * (sizeof(Pose<double>) + sizeof(Motion<double>)));
}

TEST(Cost, LoadsCostWhereTheyAre) {
  const auto scene = system(with(with(base_scene(), beam("bus", 1, 4)), wheel("bus")));
  const Costs without = costs(scene, no_loads()), none = costs(scene);
  EXPECT_EQ(added_ops(without, none), std::vector<std::string>{"node wrenches"});
  EXPECT_EQ(none.flops(), without.flops());
  EXPECT_EQ(none.bytes, without.bytes);
  const auto of = [&](const std::vector<std::string>& nodes) {
    const Costs loaded = costs(scene, {}, nodes);
    EXPECT_EQ(loaded.flops() - loaded.flops(OpCode::node_wrenches), none.flops());
    return loaded.flops(OpCode::node_wrenches);
  };
  // Two vectors turned (15 each), the moment about the origin (9 + 3), z (6).
  EXPECT_EQ(of({"bus"}), 48);
  EXPECT_EQ(of({"bus", "antenna"}), 96);
  EXPECT_GT(of({"beam.tip"}), 48);  // the node deforms, its modes are pushed
  CompileOptions world;
  world.world_wrenches = true;
  EXPECT_EQ(added_ops(none, costs(scene, world)), std::vector<std::string>{"world poses"});
}

// The kernel that takes given motions serves the run of that body alone, also where another body has the same kernel for
// another reason (the beam).
TEST(Cost, APrescribedHingeIsPaidByItsBody) {
  for (const char* prescribed : {"panel", "antenna", "arm"}) {
    auto scene = with(base_scene(), beam("bus", 1, 4));
    scene.push_back(on(rigid("arm", 1, {0, 0, 0.3}, diagonal({0.1, 0.2, 0.3})), "beam", "prismatic", {Z}));
    const Costs free = costs(system(scene));
    for (BodySpec& b : scene)
      if (b.name == prescribed) b.hinge.prescribed = {0};
    const Costs given = costs(system(scene));
    const int own = given.model->user[static_cast<std::size_t>(given.model->find_body(prescribed))].sweep;
    // Flops of the sweeps over bodies one by one: runs are cut into pieces, so totals of the others are compared.
    const auto others = [&](const Costs& c, bool general) {
      long sum = 0;
      for (std::size_t i = 0; i < c.ops.size(); ++i)
        if (const cardan::Run* run = c.run(i); run && is_general(run->kind) == general && !run->prescribed) sum += c.ops[i].flops;
      return sum;
    };
    int runs = 0;
    for (const auto& run : given.model->runs)
      if (run.prescribed) {
        ++runs;
        EXPECT_EQ(run.begin, own);
        EXPECT_EQ(run.end, own + 1);
      }
    EXPECT_EQ(runs, 1);
    EXPECT_EQ(others(given, true), others(free, true)) << prescribed;
    // The rest of the rigid bodies: what the scene costs without that one.
    auto rest = scene;
    std::erase_if(rest, [&](const BodySpec& b) { return b.name == prescribed; });
    for (BodySpec& b : rest)
      if (b.hinge.inboard_body == prescribed) b.hinge.inboard_body = "bus";  // the antenna, when the panel is the one
    EXPECT_EQ(others(given, false), others(costs(system(rest)), false)) << prescribed;
    EXPECT_EQ(given.flops(OpCode::elastic), free.flops(OpCode::elastic));
  }
}

// What the runs without given motions leave out is zero: the same v' as when every general kernel takes them (bits; sanitized
// sweeps, which are optimised less, contract their sums differently).
TEST(Cost, GivenMotionsReachWhatTheyMove) {
  int spared = 0, given = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    const RandomTree tree = random_tree(seed, {.bodies = 12, .flexible = 0.5, .prescribed = 0.1});
    const auto model = compiled(tree.spec);
    if (!model->has_prescribed()) continue;
    Model everywhere = *model;
    for (cardan::Run& run : everywhere.runs) {
      given += run.prescribed;
      spared += is_general(run.kind) && !run.prescribed;
      run.prescribed = is_general(run.kind);
    }
    const State x = model->initial_state();
    Eigen::VectorXd accelerations = Eigen::VectorXd::Zero(model->nv), a(model->nv), b(model->nv);
    for (int i = 0; i < model->nv; ++i)
      if (model->prescribed[static_cast<std::size_t>(i)]) accelerations[i] = 1.0 + 0.1 * i;
    const Inputs in{.q = x.q.data(), .v = x.v.data(), .vdot = accelerations.data()};
    Workspace ws_a(*model), ws_b(everywhere);
    ASSERT_TRUE(forward_dynamics(*model, ws_a, in, a.data()));
    ASSERT_TRUE(forward_dynamics(everywhere, ws_b, in, b.data()));
    EXPECT_LE((a - b).norm(), (sanitized ? 1e-12 : 0.0) * a.norm()) << "seed " << seed;
  }
  EXPECT_GT(spared, 10);
  EXPECT_GT(given, 10);
}

// Level 0 takes blocks that compile() has made, at level 1 the coupling to the modes changes and with rotary inertia their
// mass; what level 2 adds is in the family. Apart from M_fl and b themselves (outward): at level 0 the sweeps form them and
// are counted, above it the family does. With and without something on the tip, by either elimination of the modes (through the
// nodes with more than six modes per node: it saves operations, and takes memory of its own where the other needs a matrix of the modes).
TEST(Cost, ALowerLevelIsNoDearer) {
  for (const int modes : {6, 12})
    for (const bool rotary : {false, true})
      for (const bool loaded : {false, true}) {
        std::vector<Costs> c;
        for (const int level : {0, 1, 2}) {
          auto scene = with(base_scene(), beam("bus", level, modes, rotary));
          BodySpec tip = not_axisymmetric("beam");
          tip.hinge.inboard_node = "tip";
          tip.hinge.onode_position.setZero();
          if (loaded) scene.push_back(tip);
          c.push_back(costs(system(scene)));
        }
        const std::string which = fmt::format("{} modes, rotary inertia {}, something on the tip {}", modes, rotary, loaded);
        EXPECT_EQ(c[0].model->flexible[0].by_nodes, loaded && modes > 6) << which;
        EXPECT_LE(c[0].flops() - c[0].flops(OpCode::outward), c[1].flops() - c[1].flops(OpCode::outward)) << which;
        EXPECT_LE(c[1].flops(), c[2].flops()) << which;
        if (!c[0].model->flexible[0].by_nodes) {
          EXPECT_LE(c[0].bytes, c[1].bytes) << which;
        }
        EXPECT_LE(c[1].bytes, c[2].bytes) << which;
      }
}

TEST(Cost, AFlexibleBodyLeavesTheRigidOnesAsTheyAre) {
  const Costs rigid_scene = costs(system(base_scene()));
  for (const int level : {0, 1, 2}) {
    const Costs flexible = costs(system(with(base_scene(), beam("bus", level, 6))));
    long flops = flexible.flops(OpCode::hinge_records);
    std::size_t bytes = 0;
    for (std::size_t i = 0; i < flexible.ops.size(); ++i) {
      const cardan::Run* run = flexible.run(i);
      if (!run || is_general(run->kind)) continue;
      flops += flexible.ops[i].flops;
      if (flexible.model->program[i].code == OpCode::outward) bytes += flexible.ops[i].bytes;
    }
    EXPECT_EQ(flops, rigid_scene.flops());
    EXPECT_EQ(bytes, bytes_of<soa::FreeRecord<double>>() + 2 * bytes_of<soa::AxisRecord<double>>());
  }
}

struct Rows : Recorder {
  int rows = 0;
  void begin(const RunHeader&, const std::vector<Channel>&) override {}
  void row(double, std::span<const double>) override { ++rows; }
  void attach(const std::string&, const std::string&) override {}
  void restart_state(double, std::span<const double>) override {}
  void flush() override {}
  void close(std::string_view) override {}
};

// An output is evaluated once per row and never between; without a row, never.
TEST(Cost, AnOutputThatIsNotRecordedIsNotComputed) {
  SimulationOptions options;
  options.integrator.method = "rk4";
  options.integrator.fixed_step = 0.01;
  for (const std::int64_t period : {0, 1, 2}) {  // 0: not recorded
    Simulation sim(compiled(system(base_scene())), options);
    int calls = 0;
    Rows rows;
    Output output;
    output.channel.components = {"x"};
    output.fill = [&](double* x) { *x = ++calls; };
    if (period > 0) sim.record(rows, {output}, {period, 1});
    sim.run(4.0);
    EXPECT_EQ(calls, period > 0 ? 4 / period + 1 : 0);
    EXPECT_EQ(calls, rows.rows);
  }
}

// ---- the table of docs/benchmarks.md ----

// Prints it, and compares it with what stands there.
TEST(Cost, TheTableInTheDocumentsIsTrue) {
  const Costs base = costs(system(base_scene()), no_loads());
  std::vector<std::string> table = {fmt::format("| base scene | {} | {} | {} |", base.flops(), base.bytes, base.ops.size())};
  const auto row = [&](const std::string& what, const Costs& c, const Costs& than) {
    std::vector<std::string> names, before;
    for (const soa::OpCost& op : than.ops) before.push_back(op.name);
    for (const soa::OpCost& op : c.ops) {
      const auto known = std::find(before.begin(), before.end(), op.name);
      if (known == before.end())
        names.push_back(op.name);
      else
        before.erase(known);
    }
    const long bytes = static_cast<long>(c.bytes) - static_cast<long>(than.bytes);
    table.push_back(fmt::format("| {} | {:+} | {:+} | {} |", what, c.flops() - than.flops(), bytes,
                                names.empty() ? "-" : fmt::format("{}", fmt::join(names, ", "))));
  };
  const auto scene = [&](const BodySpec& added) { return costs(system(with(base_scene(), added)), no_loads()); };
  row("+ wheel on the bus", scene(wheel("bus")), base);
  row("+ the same, not axisymmetric", scene(not_axisymmetric("bus")), base);
  BodySpec locked = not_axisymmetric("bus");
  locked.hinge.locked = true;
  row("+ the same, locked", scene(locked), base);
  row("+ uniform gravity", costs(system(base_scene(), uniform_gravity({0, 0, -9.81})), no_loads()), base);
  row("+ central gravity", costs(system(base_scene(), central_gravity(4e14, false, {7e6, 0, 0})), no_loads()), base);
  row("+ central gravity with its gradient", costs(system(base_scene(), central_gravity(4e14, true, {7e6, 0, 0})), no_loads()), base);
  row("+ loads possible, none given", costs(system(base_scene())), base);
  row("+ load on the antenna, its axes", costs(system(base_scene()), {}, {"antenna"}), base);
  CompileOptions world;
  world.world_wrenches = true;
  row("+ load on the antenna, world axes", costs(system(base_scene()), world, {"antenna"}, true), base);
  auto prescribed = base_scene();
  prescribed[2].hinge.prescribed = {0};
  row("+ hinge of the antenna prescribed", costs(system(prescribed), no_loads()), base);
  for (const int level : {0, 1, 2})
    row(fmt::format("+ beam on the antenna, 6 modes, level {}", level), scene(beam("antenna", level, 6, true)), base);

  std::stringstream text;
  text << std::ifstream(CARDAN_SOURCE_DIR "/docs/benchmarks.md").rdbuf();
  for (const std::string& line : table) {
    fmt::print("{}\n", line);
    EXPECT_NE(text.str().find(line + "\n"), std::string::npos) << "docs/benchmarks.md lacks " << line;
  }
}

}  // namespace
}  // namespace cardan::test
