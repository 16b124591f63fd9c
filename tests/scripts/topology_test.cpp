// Bodies that part and join in a run: sat:attach, detach, lock, unlock, close, open.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/io/hdf5_file.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

using nlohmann::json;

/// A bus with an arm of two links, a stage on it, and a guest that flies by itself; `dock` may hold the guest to the arm.
constexpr const char* kStack = R"yaml(
cardan: 1
bodies:
  bus:
    mass: 100 kg
    com: [0.1, 0, 0.2]
    inertia: [30, 40, 50]
    nodes: {port: {position: [0, 0, 1]}}
    hinge: {type: free, to: world, initial: {velocity: [0.1, 0.2, 0], rate: [0.1, -0.2, 0.3]}}
  arm: {mass: 10, inertia: [1, 1, 0.1], com: [0, 0, 0.5], hinge: {type: revolute, axis: [1, 0, 0], to: {body: bus, position: [1, 0, 0]}, initial: {angle: 20 deg, rate: 0.5}}}
  tip:
    mass: 5
    inertia: [0.3, 0.2, 0.1]
    com: [0, 0.1, 0.5]
    nodes: {hand: {position: [0, 0, 1]}}
    hinge: {type: revolute, axis: [0, 1, 0], to: {body: arm, position: [0, 0, 1]}, initial: {rate: -0.5}}
  boom:
    type: modal_flexible
    modal: {beam: {length: 3 m, material: {E: 70 GPa, rho: 2700}, section: {tube: {radius: 2 cm, wall: 1 mm}}}, modes: {count: 2}}
    hinge: {type: locked, to: bus.port, at: root}
  upper: {mass: 50, inertia: [10, 11, 12], com: [0, 0, 0.5], hinge: {type: locked, to: {body: bus, position: [0, 0, -1]}, at: {position: [0, 0.1, 0.3], orientation: {axis: [0, 1, 2], angle: 30 deg}}}}
  guest: {mass: 20, inertia: [2, 3, 4], hinge: {type: free, to: world, initial: {position: [5, 0, 0], rate: [0.1, 0.05, 0]}}}
loops:
  dock: {type: distance, length: 2, from: bus, to: guest, open: true}
)yaml";

Finished mission(const TemporaryFolder& dir, const std::string& rest, const char* vehicle = kStack,
                 const std::string& dynamics = "standard") {
  write(dir / "vehicle.yaml", vehicle);
  const std::string nodes = vehicle == kStack                              ? R"("upper", "tip", "guest")"
                            : std::string_view(vehicle).find("arm:") < 500 ? R"("arm.tip", "guest")"
                                                                           : R"("guest")";
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 6, integrator = { method = "dop853", relative = 1e-12 }, checkpoint = { period = "0.5 s" }, dynamics = ")lua" +
                                  dynamics +
                                  R"lua(",
          output = { rate = "10 Hz", nodes = { )lua" +
                                  nodes + R"lua( } } }
)lua" + rest);
  return run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
}

constexpr const char* kEvents = R"lua(
phase { name = "stack", duration = 1, exit_ = function() sat:detach "upper" end }
phase { name = "apart", duration = 1, exit_ = function() sat:lock "arm" end }
phase { name = "held", duration = 1, exit_ = function() sat:detach "tip"; sat:unlock "arm" end }
phase { name = "loose", duration = 1, exit_ = function() sat:attach("tip", { to = "upper", as_found = true }) end }
phase { name = "grasped", duration = 1, exit_ = function() sat:attach("guest", { to = "bus.port", as_found = true }) end }
phase { name = "one", duration = 1 }
)lua";

/// One a tenth of a second, 61 in all.
std::vector<std::vector<double>> rows(const std::filesystem::path& dir, const std::string& channel) {
  const std::vector<double> all = channels_of(dir.string()).at("/channels/" + channel);
  const auto width = static_cast<std::ptrdiff_t>(all.size() / 61);
  std::vector<std::vector<double>> out;
  for (auto at = all.begin(); at != all.end(); at += width) out.emplace_back(at, at + width);
  return out;
}

TEST(Topology, BodiesPartAndJoinAndTheBooksBalance) {
  const TemporaryFolder dir;
  const Finished done = mission(dir, kEvents);
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const json summary = summary_of(dir / "out");
  EXPECT_TRUE(summary.at("ledger").dump().find("null") == std::string::npos) << summary.at("ledger").dump();
  const auto angle = rows(dir / "out", "hinges/arm/angle"), rate = rows(dir / "out", "hinges/arm/rate"),
             tip = rows(dir / "out", "hinges/tip/angle");
  for (int i = 21; i <= 30; ++i) EXPECT_EQ(angle[static_cast<std::size_t>(i)][0], angle[21][0]) << i;  // locked from 2 s to 3 s
  for (int i = 21; i <= 30; ++i) EXPECT_EQ(rate[static_cast<std::size_t>(i)][0], 0.0) << i;
  EXPECT_NE(angle[31][0], angle[30][0]);
  for (int i = 31; i <= 60; ++i) EXPECT_EQ(tip[static_cast<std::size_t>(i)][0], tip[30][0]) << i;  // gone at 3 s
  // Held to each other, the distance of two bodies stays.
  const auto upper = rows(dir / "out", "nodes/upper/position"), hand = rows(dir / "out", "nodes/tip/position");
  const auto apart = [&](std::size_t i) {
    double sum = 0.0;
    for (std::size_t j = 0; j < 3; ++j) sum += std::pow(upper[i][j] - hand[i][j], 2);
    return std::sqrt(sum);
  };
  for (std::size_t i = 41; i <= 60; ++i) EXPECT_NEAR(apart(i), apart(40), 1e-12 * apart(40)) << i;
  EXPECT_GT(std::abs(apart(40) - apart(31)), 1e-3);
}

// The mass that leaves the sums has not gone: it stands on the world.
TEST(Topology, BodiesThatAreLockedToTheWorldAreToldWhereMassIs) {
  const TemporaryFolder dir;
  write(dir / "vehicle.yaml", R"yaml(
cardan: 1
bodies:
  mast: {mass: 3, inertia: [1, 2, 3], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {rate: 0.1}}}
  flag: {mass: 2, inertia: [1, 1, 1], hinge: {type: locked, to: mast}}
  vane: {mass: 1, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {rate: 0.2}}}
)yaml");
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 3 }
phase { name = "turning", duration = 1, exit_ = function() sat:lock "mast" end }
phase { name = "held", duration = 1, exit_ = function() sat:unlock "mast" end }
phase { name = "again", duration = 1 }
)lua");
  const Finished done = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const std::vector<std::string> told = Hdf5File::open(dir / "out/run.h5").read_texts("/run/events/text");
  ASSERT_EQ(told.size(), 4u);  // what happened, and the sums
  EXPECT_TRUE(told[1].starts_with("mass -5 kg") && told[1].ends_with("; mast, flag stand on the world, which has no part in these sums"))
      << told[1];
  EXPECT_TRUE(told[3].starts_with("mass +5 kg") && told[3].ends_with("; mast, flag stand on the world no longer")) << told[3];
}

TEST(Topology, ARunIsRepeatedAndResumedWithTheSameBits) {
  const TemporaryFolder dir;
  ASSERT_EQ(mission(dir, kEvents).exit_code, 0);
  const std::string all = json(channels_of(dir / "out")).dump();
  for (const char* at : {"0.5", "1", "2.5", "3", "4", "4.5", "5.5"}) {
    const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", at, "--quiet", "--out", "resumed"}, dir.path());
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_EQ(json(channels_of(dir / "resumed")).dump(), all) << at;
  }
  ASSERT_EQ(run_program({"run", "--again", "out/run.h5", "--quiet", "--out", "again"}, dir.path()).exit_code, 0);
  EXPECT_EQ(json(channels_of(dir / "again")).dump(), all);
}

// A hinge is written anew where it is: nothing happens but that what it says otherwise holds from then on. It was refused, as an initial
// state.
TEST(Topology, AHingeIsWrittenAnewWhereItIs) {
  const TemporaryFolder dir;
  constexpr const char* kPhases = "phase { name = 'a', duration = 1, exit_ = function() %s end }\nphase { name = 'b', duration = 1 }\n";
  const auto channels = [&](const std::string& call) {
    std::string phases = kPhases;
    const Finished done = mission(dir, phases.replace(phases.find("%s"), 2, call));
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return json(channels_of(dir / "out")).dump();
  };
  const std::string arm = "{type = 'revolute', axis = {1, 0, 0}, to = {body = 'bus', position = {1, 0, 0}}";
  const std::string plain = channels("sat:change { ['bodies.arm.mass'] = '10 kg' }");
  EXPECT_EQ(channels("sat:attach('arm', " + arm + "})"), plain);
  const std::string sprung = channels("sat:change { ['bodies.arm.hinge.spring'] = '{stiffness: 5, damping: 1}' }");
  EXPECT_NE(sprung, plain);
  EXPECT_EQ(channels("sat:attach('arm', " + arm + ", spring = {stiffness = 5, damping = 1}})"), sprung);
}

// The velocities nu begin anew with the vehicle that an event leaves.
TEST(Topology, InDiagonalisedVelocitiesTheMotionIsTheSame) {
  const TemporaryFolder dir;
  ASSERT_EQ(mission(dir, kEvents).exit_code, 0);
  const char* const channels[] = {"nodes/tip/position", "nodes/upper/position", "nodes/guest/attitude", "hinges/arm/angle",
                                  "hinges/tip/rate"};
  std::vector<std::vector<std::vector<double>>> wanted;
  for (const char* channel : channels) wanted.push_back(rows(dir / "out", channel));
  for (const char* dynamics : {"diagonalised", "diagonalised_rates"}) {
    const Finished done = mission(dir, kEvents, kStack, dynamics);
    ASSERT_EQ(done.exit_code, 0) << done.err;
    for (std::size_t c = 0; c < std::size(channels); ++c) {
      const auto got = rows(dir / "out", channels[c]);
      double apart = 0.0;
      for (std::size_t i = 0; i < got.size(); ++i)
        for (std::size_t j = 0; j < got[i].size(); ++j) apart = std::max(apart, std::abs(got[i][j] - wanted[c][i][j]));
      EXPECT_LT(apart, 1e-9) << dynamics << ", " << channels[c];  // two integrations at 1e-12 over 6 s
    }
    const std::string all = json(channels_of(dir / "out")).dump();
    const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", "2.5", "--quiet", "--out", "resumed"}, dir.path());
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_EQ(json(channels_of(dir / "resumed")).dump(), all) << dynamics;
  }
}

TEST(Topology, ALoopThatClosesInDiagonalisedVelocitiesIsRefusedWhereItIsAsked) {
  const TemporaryFolder dir;
  const char* two = R"yaml(
cardan: 1
bodies:
  bus: {mass: 100, inertia: [30, 40, 50], hinge: {type: free, to: world, initial: {rate: [0, 0.1, 0.2]}}}
  guest: {mass: 20, inertia: [2, 3, 4], nodes: {port: {position: [0, 0.3, 0]}}, hinge: {type: free, to: world, initial: {position: [3, 0, 0], rate: [0.3, 0, 0.1]}}}
loops:
  grip: {type: weld, from: bus, to: guest.port, open: true, as_found: true}
)yaml";
  const Finished done =
      mission(dir, "phase { name = 'free', duration = 1.3, exit_ = function() sat:close 'grip' end }\nphase { name = 'held' }\n", two,
              "diagonalised");
  EXPECT_EQ(done.exit_code, 3) << done.err;
  for (const char* part : {"not supported by the chosen method", "scenario.lua:5", "closed loops", "diagonalised, which do not"})
    EXPECT_NE(done.err.find(part), std::string::npos) << part << "\n" << done.err;
}

// A clutch: gears mesh as they stand. The rates after it by J_a n w_a + J_b w_b = (J_a n^2 + J_b) w_b'.
TEST(Topology, ACouplingTakesTheSumThatItFinds) {
  const TemporaryFolder dir;
  const Finished done = mission(dir, R"lua(
phase { name = "free", duration = 1.3, exit_ = function() sat:close "clutch" end }
phase { name = "held", duration = 2, exit_ = function() sat:open "clutch" end }
phase { name = "apart", duration = 1.2, enter = function() sat:hinge("b"):torque(0.2) end, exit_ = function() sat:close "clutch" end }
phase { name = "held again" }
)lua",
                                R"yaml(
cardan: 1
bodies:
  a: {mass: 1, inertia: [1, 1, 0.4], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {rate: 20}}}
  b: {mass: 1, inertia: [1, 1, 0.9], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {angle: 0.3, rate: 1}}}
  guest: {mass: 20, inertia: [2, 3, 4], hinge: {type: free, to: world}}
loops:
  clutch: {type: coupling, terms: {a: 1, b: -3}, open: true, as_found: true}
)yaml");
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const auto a = rows(dir / "out", "hinges/a/angle"), b = rows(dir / "out", "hinges/b/angle"), rate = rows(dir / "out", "hinges/b/rate");
  const auto sum = [&](std::size_t i) { return a[i][0] - 3.0 * b[i][0]; };
  for (std::size_t i = 14; i <= 33; ++i) EXPECT_NEAR(sum(i), sum(13), 1e-12) << i;
  for (std::size_t i = 46; i <= 60; ++i) EXPECT_NEAR(sum(i), sum(45), 1e-12) << i;
  EXPECT_GT(std::abs(sum(45) - sum(33)), 1e-3);
  EXPECT_NEAR(rate[20][0], (0.4 * 3.0 * 20.0 + 0.9) / (0.4 * 9.0 + 0.9), 1e-13);
  const std::string all = json(channels_of(dir / "out")).dump();
  for (const char* at : {"1", "2", "4", "5"}) {
    const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", at, "--quiet", "--out", "resumed"}, dir.path());
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_EQ(json(channels_of(dir / "resumed")).dump(), all) << at;
  }
}

TEST(Topology, TheOrderOfWhatHappensInOneInstantTellsNothing) {
  const TemporaryFolder dir;
  std::string all;
  for (const char* calls : {"sat:detach 'upper' sat:lock 'arm' sat:detach 'tip'", "sat:detach 'tip' sat:detach 'upper' sat:lock 'arm'",
                            "sat:lock 'arm' sat:detach 'tip' sat:detach 'upper' sat:lock 'arm'"}) {
    const Finished done = mission(dir, "phase { name = 'a', duration = 1, exit_ = function() " + std::string(calls) + " end }\n");
    ASSERT_EQ(done.exit_code, 0) << done.err;
    const std::string bits = json(channels_of(dir / "out")).dump();
    EXPECT_TRUE(all.empty() || all == bits) << calls;
    all = bits;
  }
}

/// A rod of 2 m between two bodies that come to be 2 m apart: then the distance stays, until it is let go; a loop that is open pushes with
/// nothing.
TEST(Topology, ALoopIsClosedWhereItsEndsMeetAndOpenedAgain) {
  const TemporaryFolder dir;
  const char* two = R"yaml(
cardan: 1
bodies:
  bus: {mass: 100, inertia: [30, 40, 50], hinge: {type: free, to: world, initial: {rate: [0, 0, 0.2]}}}
  guest: {mass: 20, inertia: [2, 3, 4], hinge: {type: free, to: world, initial: {position: [3, 0, 0], velocity: [-0.5, 0.1, 0]}}}
loops:
  rod: {type: distance, length: 2, from: bus, to: guest, open: true}
)yaml";
  const Finished done = mission(dir, R"lua(
local bus, guest, memory = sat:hinge "bus", sat:hinge "guest", persist { met = false }
event { name = "met", direction = "falling", action = function()
          if not memory.met then sat:close "rod" end
          memory.met = true
        end,
        when = function()
          local function along(name) return guest:q(name) - bus:q(name) end
          return math.sqrt(along "x" ^ 2 + along "y" ^ 2 + along "z" ^ 2) - 2
        end }
phase { name = "free", duration = 5, exit_ = function() sat:open "rod" end }
phase { name = "apart", duration = 1 }
)lua",
                                two);
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const auto bus = rows(dir / "out", "bodies/bus/position"), guest = rows(dir / "out", "bodies/guest/position"),
             force = rows(dir / "out", "loops/rod/reaction");
  const auto apart = [&](std::size_t i) { return std::hypot(bus[i][0] - guest[i][0], bus[i][1] - guest[i][1], bus[i][2] - guest[i][2]); };
  for (std::size_t i = 25; i <= 50; ++i) {
    EXPECT_NEAR(apart(i), 2.0, 1e-9) << i;
    EXPECT_GT(std::hypot(force[i][3], force[i][4], force[i][5]), 1e-3) << i;
  }
  for (const std::size_t i : {0, 10, 51, 60}) EXPECT_EQ(force[i], std::vector<double>(6, 0.0)) << i;
  EXPECT_GT(std::abs(apart(60) - 2.0), 1e-3);
}

/// A weld that is closed while its ends are apart holds them as they are; with checkpoints before, in and after the time in which it holds.
TEST(Topology, AWeldHoldsWhatItFinds) {
  const TemporaryFolder dir;
  const char* two = R"yaml(
cardan: 1
bodies:
  bus: {mass: 100, inertia: [30, 40, 50], hinge: {type: free, to: world, initial: {rate: [0, 0.1, 0.2]}}}
  arm: {mass: 5, inertia: [1, 1, 1], com: [0.5, 0, 0], nodes: {tip: {position: [1, 0, 0]}}, hinge: {type: ball, to: {body: bus, position: [1, 0, 0]}}}
  guest: {mass: 20, inertia: [2, 3, 4], nodes: {port: {position: [0, 0.3, 0]}}, hinge: {type: free, to: world, initial: {position: [3, 0, 0], rate: [0.3, 0, 0.1]}}}
loops:
  grip: {type: weld, from: arm.tip, to: guest.port, open: true, as_found: true}
)yaml";
  const Finished done = mission(dir, R"lua(
phase { name = "free", duration = 1.3, exit_ = function() sat:close "grip" end }
phase { name = "held", duration = 2, exit_ = function() sat:open "grip" end }
phase { name = "apart", duration = 1.2, exit_ = function() sat:close "grip" end }
phase { name = "held again" }
)lua",
                                two);
  ASSERT_EQ(done.exit_code, 0) << done.err;
  const auto guest = rows(dir / "out", "bodies/guest/position"), arm = rows(dir / "out", "nodes/arm.tip/position");
  const auto apart = [&](std::size_t i) { return std::hypot(arm[i][0] - guest[i][0], arm[i][1] - guest[i][1], arm[i][2] - guest[i][2]); };
  for (std::size_t i = 14; i <= 33; ++i) EXPECT_NEAR(apart(i), apart(13), 1e-9) << i;
  for (std::size_t i = 46; i <= 60; ++i) EXPECT_NEAR(apart(i), apart(45), 1e-9) << i;
  EXPECT_GT(std::abs(apart(45) - apart(33)), 1e-3);
  const std::string all = json(channels_of(dir / "out")).dump();
  for (const char* at : {"1", "2", "4", "5"}) {
    const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", at, "--quiet", "--out", "resumed"}, dir.path());
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_EQ(json(channels_of(dir / "resumed")).dump(), all) << at;
  }
}

// Held as they are found, 7000 km from the origin of the world: what the grip finds is known to 1e-9 m there, and five of its rows follow
// from the hinge that holds the guest as well.
TEST(Topology, TwoHoldsOfOneGuestAgreeInOrbit) {
  constexpr const char* kOrbit = R"yaml(
cardan: 1
gravity: {central: {mu: 398600.4418 km^3/s^2}}
bodies:
  bus:
    mass: 100
    com: [0.1, 0, 0.2]
    inertia: [30, 40, 50]
    nodes: {port: {position: [0, 0, 1]}}
    hinge: {type: free, to: world, initial: {position: [6878 km, 100 km, 200 km], velocity: [0.1 km/s, 7.5 km/s, 0.6 km/s], rate: [0.01, -0.02, 0.03]}}
  arm:
    mass: 10
    inertia: [1, 1, 0.1]
    com: [0, 0, 0.5]
    nodes: {tip: {position: [0, 0.2, 1], orientation: {axis: [1, 2, 0], angle: 30 deg}}}
    hinge: {type: revolute, axis: [1, 0.2, 0], to: {body: bus, position: [1, 0, 0]}, initial: {angle: 20 deg, rate: 0.05}}
  guest:
    mass: 20
    inertia: [2, 3, 4]
    hinge: {type: free, to: world, initial: {position: [6878.003 km, 100 km, 200 km], velocity: [0.1 km/s, 7.5 km/s, 0.6 km/s], rate: [0.01, 0.05, 0]}}
loops:
  grip: {type: weld, from: arm.tip, to: guest, open: true, as_found: true}
)yaml";
  for (const char* calls : {"sat:attach('guest', { to = 'bus.port', as_found = true }) sat:close 'grip'",
                            "sat:close 'grip' end }\nphase { name = 'next', duration = 1, exit_ = function() "
                            "sat:attach('guest', { to = 'bus.port', as_found = true })",
                            "sat:attach('guest', { to = 'bus.port', as_found = true }) end }\n"
                            "phase { name = 'next', duration = 1, exit_ = function() sat:close 'grip'"}) {
    const TemporaryFolder dir;
    const std::string rest =
        std::string("phase { name = 'free', duration = 1.3, exit_ = function() ") + calls +
        " end }\nphase { name = 'held' }\n"
        "check { name = 'arm', unit = 'rad/s', value = function() return sat:hinge('arm'):rate() end, within = {-1e-12, 1e-12} }\n";
    const Finished done = mission(dir, rest, kOrbit);
    EXPECT_EQ(done.exit_code, 0) << calls << "\n" << done.err;
    const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", "3", "--quiet", "--out", "resumed"}, dir.path());
    EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
    const auto state = [&](const char* folder) -> json { return summary_of(dir / folder)["hashes"]["final_state"]; };
    EXPECT_EQ(state("resumed"), state("out")) << calls;
  }
}

TEST(Topology, AnEventThatHappensOnceIsNotLookedAtAgain) {
  const TemporaryFolder dir;
  const std::string counting = R"lua(
local m, arm = persist { times = 0 }, sat:hinge "arm"
event { name = "passes", once = true, direction = "rising", when = function(t) return math.sin(2 * t + 0 * arm:q()) end,
        action = function() m.times = m.times + 1 sat:lock "arm" end }
check { name = "times", value = function() return m.times end, equal = { 1, tolerance = 0.1 } }
)lua";
  const Finished done = mission(dir, counting);
  EXPECT_EQ(done.exit_code, 0) << done.err << done.out;
  const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", "4", "--quiet", "--out", "resumed"}, dir.path());
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err << resumed.out;
  std::string both = counting;
  both.replace(both.find(R"(direction = "rising", )"), 22, "");
  const Finished refused = mission(dir, both);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("true beside direction"), std::string::npos) << refused.err;
}

/// A latch that nothing came to, one that was passed too fast, an event that is waited for in vain and a signal that nothing stores; what
/// happened is not told.
TEST(Topology, WhatCaughtNothingIsToldAtTheEnd) {
  const TemporaryFolder dir;
  const char* vehicle = R"yaml(
cardan: 1
bodies:
  guest: {mass: 5, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: world, initial: {angle: -0.5, rate: 1}}}
devices:
  far: {type: latch, at: guest, place: 9 rad, max_rate: 2 rad/s, stiffness: 100}
  fast: {type: latch, at: guest, max_rate: 0.5 rad/s, stiffness: 100}
  slow: {type: latch, at: guest, place: 0.2 rad, max_rate: 2 rad/s, stiffness: 1}
)yaml";
  const Finished run = mission(dir, R"lua(
local lid = sat:hinge "guest"
local log = signals { kept = {}, forgotten = { components = { "x", "y" } } }
event { name = "never", once = true, direction = "rising", when = function() return lid:angle() - 5 end, action = function() end }
event { name = "opens", once = true, direction = "rising", when = function() return lid:angle() end, action = function() log.kept(1) end }
)lua",
                               vehicle);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const std::string told = summary_of(dir / "out").at("warnings").dump();
  EXPECT_NE(told.find("far has caught nothing: nothing came to its place"), std::string::npos) << told;
  EXPECT_NE(told.find("fast has caught nothing: its place was passed too fast, times 2"), std::string::npos) << told;
  EXPECT_EQ(told.find("slow has"), std::string::npos) << told;
  EXPECT_NE(told.find("it never happened: what it would have done was not done"), std::string::npos) << told;
  EXPECT_EQ(told.find("opens"), std::string::npos) << told;
  EXPECT_NE(told.find("nothing stored a number: its channel is empty"), std::string::npos) << told;
  EXPECT_NE(told.find("signals.forgotten"), std::string::npos) << told;
  EXPECT_EQ(told.find("signals.kept"), std::string::npos) << told;
}

/// The difference of readings that are counted from two zeros is no rate.
TEST(Topology, AnEncoderOfAnotherZeroBeginsAnew) {
  constexpr const char* kSlide = R"yaml(
cardan: 1
bodies:
  bus: {mass: 100 kg, inertia: [10, 12, 14], hinge: {type: free, to: world}}
  slide: {mass: 2 kg, inertia: [0.1, 0.1, 0.1], hinge: {type: prismatic, to: bus, axis: [0, 0, 1], initial: {rate: 0.4}}}
  guest: {mass: 20, inertia: [2, 3, 4], hinge: {type: free, to: world, initial: {position: [5, 0, 0]}}}
devices:
  ruler: {type: encoder, at: slide, rate: 10 Hz}
  bent: {type: encoder, at: slide, rate: 10 Hz}
)yaml";
  constexpr const char* kReadings = R"lua(
local slide = sat:hinge "slide"
local m = persist { worst = 0, valid = 0 }
controller { name = "look", rate = "10 Hz", step = function(t)
  for _, name in ipairs { "ruler", "bent" } do
    local d = sat:device(name)
    if d:valid "rate" then m.valid, m.worst = m.valid + 1, math.max(m.worst, math.abs(d:get "rate" - slide:v())) end
  end
end }
phase { name = "here", duration = 1, exit_ = function()
  sat:attach("slide", { to = { body = "bus", position = { 0, 0, 0.3 } }, type = "prismatic", axis = { 0, 0, 1 } })
end }
phase { name = "there", duration = 0.5, exit_ = function() sat:change { ["devices.bent.bias"] = "1 cm" } end }
phase { name = "bent" }
check { name = "readings", value = function() return m.worst end, below = 1e-9 }
check { name = "rates", value = function() return m.valid end, equal = { 2 * 60 - 3, tolerance = 0 } }
)lua";
  const TemporaryFolder dir;
  const Finished run = mission(dir, kReadings, kSlide);
  EXPECT_EQ(run.exit_code, 0) << run.err << run.out;
}

TEST(Topology, DevicesAtAHingeThatIsHeldOrGoneReadItThereAndPushNothing) {
  constexpr const char* kMotorised = R"yaml(
cardan: 1
bodies:
  bus: {mass: 100 kg, inertia: [10, 12, 14], hinge: {type: free, to: world, initial: {rate: [0.1, 0, 0.05]}}}
  panel: {mass: 5 kg, inertia: [0.2, 0.3, 0.4], com: [0.5, 0, 0], hinge: {type: revolute, to: {body: bus, position: [1, 0, 0]}, axis: [0, 1, 0], locked: true, initial: {angle: 0.3}}}
  slide: {mass: 2 kg, inertia: [0.1, 0.1, 0.1], hinge: {type: prismatic, to: {body: bus, position: [0, 1, 0]}, axis: [0, 0, 1], initial: {rate: 0.4}}}
  guest: {mass: 20, inertia: [2, 3, 4], hinge: {type: free, to: world, initial: {position: [5, 0, 0]}}}
devices:
  motor: {type: dc_motor, at: panel, resistance: 2, constant: 0.5, inductance: 0.01, inputs: {voltage: 3}}
  encoder: {type: encoder, at: panel.rate, rate: 10 Hz}
  ruler: {type: encoder, at: slide, rate: 10 Hz}
  brake: {type: dry_friction, at: slide, coulomb: 0.2 N}
)yaml";
  constexpr const char* kReadings = R"lua(
local panel, slide, motor = sat:hinge "panel", sat:hinge "slide", sat:device "motor"
local encoder, ruler = sat:device "encoder", sat:device "ruler"
local m = persist { worst = 0, angle = 0.3, along = 0 }
local function near(a, b) m.worst = math.max(m.worst, math.abs(a - b)) end
controller { name = "look", rate = "10 Hz", step = function(t)
  local now = mission.phase()
  local moves, gone = now == "free" or now == "again", now == "gone" or now == "welded"
  if moves then m.angle = panel:angle() end
  if not gone then m.along = slide:q() end
  if t % 1 < 0.05 then return end
  if now ~= m.phase and not moves and now ~= "locked" then m.phase, m.at = now, { encoder:get "position", ruler:get "position" } end
  if not moves and t % 1 > 0.15 then near(encoder:get "rate", 0) end    -- by what it read the time before
  near(encoder:get "position", (moves or now == "locked") and m.angle or m.at[1])
  near(ruler:get "position", gone and m.at[2] or m.along)
  if now == "held" then near(encoder:get "position", panel:angle()) end
  if t % 1 > 0.5 and not moves then near(motor:get "current", 1.5) end    -- 3 V at 2 ohm, nothing turns; 100 times its time constant
end }
phase { name = "locked", duration = 1, exit_ = function() sat:unlock "panel" end }
phase { name = "free", duration = 1, exit_ = function() sat:lock "panel" end }
phase { name = "held", duration = 1, exit_ = function() sat:unlock "panel" end }
phase { name = "again", duration = 1, exit_ = function() sat:detach "panel"; sat:detach "slide" end }
phase { name = "gone", duration = 1, exit_ = function()
  sat:attach("panel", { to = "bus", as_found = true })
  sat:attach("slide", { to = "bus", as_found = true })
end }
phase { name = "welded" }
check { name = "readings", value = function() return m.worst end, below = 1e-9 }
check { name = "it went on turning", value = function() return m.angle end, above = 0.35 }
)lua";
  const TemporaryFolder dir;
  const Finished run = mission(dir, kReadings, kMotorised);
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  const json summary = summary_of(dir / "out");
  EXPECT_TRUE(summary.at("warnings").empty()) << summary.at("warnings").dump();  // books that do not balance, too
  const std::string all = json(channels_of(dir / "out")).dump();
  for (const char* at : {"0.5", "2.5", "4.5", "5.5"}) {
    const Finished resumed = run_program({"run", "--resume", "out/run.h5", "--at", at, "--quiet", "--out", "resumed"}, dir.path());
    ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
    EXPECT_EQ(json(channels_of(dir / "resumed")).dump(), all) << at;
  }

  // A hinge of another kind in its place has no such component.
  const Finished other = mission(dir, R"lua(
phase { name = "one", duration = 1, exit_ = function() sat:attach("slide", { to = "bus", type = "free" }) end }
phase { name = "two" }
)lua",
                                 kMotorised);
  EXPECT_EQ(other.exit_code, 3);
  EXPECT_NE(other.err.find("at devices.brake.at"), std::string::npos) << other.err;
  // Locked from the beginning to the end.
  const Finished still = mission(dir, "", kMotorised);
  EXPECT_EQ(still.exit_code, 0) << still.err;
  const std::string told = summary_of(dir / "out").at("warnings").dump();
  EXPECT_NE(told.find("the hinge of \\\"panel\\\" is locked: it is read at rest, and to push there has no effect"), std::string::npos)
      << told;
}

TEST(Topology, AHingeThatIsHeldIsAskedByAnyNameOfItsComponents) {
  constexpr const char* kJoint = R"yaml(
cardan: 1
bodies:
  guest: {mass: 20, inertia: [2, 3, 4], hinge: {type: universal, to: world, axes: [[1, 0, 0], [0, 1, 0]], initial: {angle_1: 0.3, angle_2: 0.4, rate_2: 0.5}}}
)yaml";
  constexpr const char* kAsks = R"lua(
local joint, seen = sat:hinge "guest", {}
phase { name = "free", duration = 1, exit_ = function()
  seen = { joint:q(1), joint:q(2) }
  sat:lock "guest"
end }
phase { name = "held" }
for _, c in ipairs { "angle", "rate" } do
  for i = 1, 2 do
    check { name = c .. i, value = function() return joint:q(c .. "_" .. i) - seen[i] + math.abs(joint:v("guest." .. c .. "_" .. i)) end, equal = { 0, tolerance = 0 } }
  end
end
)lua";
  const TemporaryFolder dir;
  const Finished run = mission(dir, kAsks, kJoint);
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  const Finished unknown = mission(dir,
                                   "phase { name = 'free', duration = 1, exit_ = function() sat:lock 'guest' end }\n"
                                   "phase { name = 'held', enter = function() print(sat:hinge('guest'):q 'angle_3') end }",
                                   kJoint);
  EXPECT_NE(unknown.err.find("expected: 1 to 2, or a name: angle_1, angle_2"), std::string::npos) << unknown.err;
}

TEST(Topology, AControllerGoesOnWhileItsHingeIsHeld) {
  constexpr const char* kPushes = R"lua(
local arm, held = sat:hinge "arm", nil
controller { name = "motor", rate = "10 Hz", step = function(t)
  arm:torque(0.5)
  if mission.phase() == "held" then held = arm:applied() end
end }
phase { name = "free", duration = 1, exit_ = function() sat:lock "arm" end }
phase { name = "held", duration = 1, exit_ = function() sat:unlock "arm" end }
phase { name = "free again" }
check { name = "held", value = function() return held end, equal = { 0, tolerance = 0 } }
check { name = "free", value = function() return arm:applied() end, equal = { 0.5, tolerance = 0 } }
)lua";
  const TemporaryFolder dir;
  const Finished run = mission(dir, kPushes);
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  const std::string told = summary_of(dir / "out").at("warnings").dump();
  EXPECT_NE(told.find("it is locked: a force on it has no effect"), std::string::npos) << told;
  EXPECT_EQ(rows(dir / "out", "hinges/arm/force")[15], std::vector<double>{0.0}) << "what is recorded while it is held";
}

// Six velocities more for each body that is let go of: what reads all of them follows the vehicle.
TEST(Topology, DrivesAreReadOnceBodiesHaveParted) {
  const TemporaryFolder dir;
  std::string vehicle = R"yaml(
cardan: 1
bodies:
  base: {mass: 10, inertia: [1, 1, 1], hinge: {type: locked, to: world}}
  drum: {mass: 3, inertia: [1, 1, 2], hinge: {type: revolute, axis: [0, 0, 1], to: base, prescribed: true}}
)yaml";
  for (int i = 0; i < 40; ++i) vehicle += fmt::format("  p{}: {{mass: 1, inertia: [1, 1, 1], hinge: {{type: locked, to: base}}}}\n", i);
  write(dir / "vehicle.yaml", vehicle);
  write(dir / "scenario.lua", R"lua(
local sat = vehicle "vehicle.yaml"
mission { duration = 2 }
local drum = sat:hinge "drum"
drum:profile { rate_table = { { 0, 0 }, { 10, 5 } } }
phase { name = "together", duration = 1, exit_ = function() for i = 0, 39 do sat:detach("p" .. i) end end }
phase { name = "apart" }
check { name = "drive", unit = "N m", value = function() return drum:applied() end, equal = { 2 * 0.5, tolerance = 1e-12 } }
)lua");
  const Finished done = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(done.exit_code, 0) << done.out << done.err;
}

TEST(Topology, FrictionIsAgainstTheRateThatAnImpulseTurnsRound) {
  constexpr const char* kBraked = R"yaml(
cardan: 1
bodies:
  bus: {mass: 100 kg, inertia: [10, 12, 14], hinge: {type: free, to: world}}
  slide: {mass: 2 kg, inertia: [0.1, 0.1, 0.1], hinge: {type: prismatic, to: bus, axis: [0, 0, 1], initial: {rate: 0.4}}}
  guest: {mass: 20, inertia: [2, 3, 4], hinge: {type: free, to: world, initial: {position: [0, 0, 9], velocity: [0, 0, -1]}}}
devices:
  brake: {type: dry_friction, at: slide, coulomb: 0.2 N}
)yaml";
  constexpr const char* kCatch = R"lua(
local slide, brake = sat:hinge "slide", sat:device "brake"
phase { name = "loose", duration = 1, exit_ = function() sat:attach("guest", { to = "slide", as_found = true }) end }
phase { name = "caught" }
check { name = "slides back", unit = "m/s", value = function() return slide:rate() end, below = -0.5 }
check { name = "force", unit = "N", value = function() return brake:get "force" end, equal = { 0.2, tolerance = 0 } }
)lua";
  const TemporaryFolder dir;
  const Finished run = mission(dir, kCatch, kBraked);
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

// A nut that is let go and caught where it is: how often it has been turned is told by its way, which one angle does not.
TEST(Topology, AScrewIsFoundAsOftenTurnedAsItWas) {
  const char* screwed = R"yaml(
cardan: 1
bodies:
  bolt: {mass: 100, inertia: [30, 40, 50], hinge: {type: free, to: world}}
  guest: {mass: 2, inertia: [0.01, 0.01, 0.02], hinge: {type: helical, axis: [0, 0.6, 0.8], pitch: 0.02, to: bolt, initial: {angle: 20}}}
)yaml";
  constexpr const char* kAgain = R"lua(
local nut = sat:hinge "guest"
phase { name = "on", duration = 1, exit_ = function() sat:detach "guest" end }
phase { name = "loose", duration = 1, exit_ = function() sat:attach("guest", { to = "bolt", type = "helical", axis = { 0, 0.6, 0.8 }, pitch = 0.02 }) end }
phase { name = "on again" }
check { name = "angle", unit = "rad", value = function() return nut:angle() end, equal = { 20, tolerance = 1e-12 } }
)lua";
  const TemporaryFolder dir;
  const Finished run = mission(dir, kAgain, screwed);
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
}

TEST(Topology, WhatHadNoEffectIsToldAtTheEnd) {
  const TemporaryFolder dir;
  const char* latched = R"yaml(
cardan: 1
bodies:
  bus: {mass: 100, inertia: [30, 40, 50], hinge: {type: free, to: world}}
  panel: {mass: 5, inertia: [1, 1, 1], hinge: {type: revolute, axis: [0, 0, 1], to: bus, locked: true, initial: {angle: 1}, spring: {stiffness: 2}}}
  guest: {mass: 20, inertia: [2, 3, 4], hinge: {type: free, to: world, initial: {position: [3, 0, 0]}}}
loops:
  latch: {type: weld, from: bus, to: guest, open: true}
)yaml";
  const Finished idle = mission(dir, "phase { name = 'a' }\n", latched);
  EXPECT_EQ(idle.exit_code, 0) << idle.err;
  const std::string told = summary_of(dir / "out").at("warnings").dump();
  EXPECT_NE(told.find("open all the time: nothing closed it"), std::string::npos) << told;
  EXPECT_NE(told.find("the hinge is locked: this spring and damper do nothing"), std::string::npos) << told;
  const Finished acts = mission(dir, R"lua(
local panel = sat:hinge "panel"
phase { name = 'a', duration = 1, exit_ = function() if panel:angle() == 1 and panel:rate() == 0 then sat:unlock 'panel' end end }
phase { name = 'b' }
)lua",
                                latched);
  EXPECT_EQ(acts.exit_code, 0) << acts.err;
  EXPECT_EQ(summary_of(dir / "out").at("warnings").dump().find("the hinge is locked"), std::string::npos);
  EXPECT_NE(rows(dir / "out", "hinges/panel/angle").back()[0], 1.0);
}

TEST(Topology, WhatCannotBeDoneIsTold) {
  const TemporaryFolder dir;
  const auto told = [&](const std::string& call, int code, const std::string& text) {
    const Finished done =
        mission(dir, "phase { name = 'a', duration = 1, exit_ = function() " + call + " end }\nphase { name = 'b', duration = 1 }\n");
    EXPECT_EQ(done.exit_code, code) << call << done.err;
    EXPECT_NE(done.err.find(text), std::string::npos) << call << "\n" << done.err;
  };
  told("sat:detach 'guest'", 3, "guest, which flies freely");
  told("sat:detach 'gust'", 3, "did you mean \"guest\"?");
  told("sat:lock 'upper'", 3, "that of upper, locked");
  told("sat:unlock 'arm'", 3, "that of arm, revolute");
  told("sat:open 'dock'", 3, "dock, which is not");
  told("sat:close 'dick'", 3, "did you mean \"dock\"?");
  told("sat:detach 'tip' sat:lock 'tip'", 3, "lock tip, after detach tip");
  told("sat:attach('guest', {to = 'bus.port'})", 3, "the ends of a hinge do not meet, at bodies.guest.hinge");
  told("sat:attach('guest', {to = 'bus.pot', as_found = true})", 3, "unknown node");
  told("sat:attach('bus', {to = 'tip', as_found = true})", 3, "closed loop");
  told("sat:attach('guest', {to = 'bus', type = 'ball', as_found = true})", 3, "a type, or as_found = true");
  told("sat:attach('guest', {to = 'bus', initial = {}})", 3, "a hinge without `initial` and `locked`");
  told("local t = {to = 'bus'} t.type = t sat:attach('guest', t)", 3, "tables more than 10 deep");
  told("sat:attach('guest', {to = {body = 'bus', position = {1, 0, 0, z = 1}}})", 3, "a list with other keys than 1, 2, ...");
  told("sat:hinge('upper'):torque(1)", 3, "wrong argument, at hinge of upper\n");
  told("sat:close 'dock'", 3, "the ends of a loop do not meet, at loops.dock");
}

TEST(Topology, WhatALoopDoesNotTakeIsToldWithWhatToDo) {
  constexpr const char* kGeared = R"yaml(
cardan: 1
bodies:
  bus: {mass: 30, inertia: [3, 4, 5], nodes: {p: {position: [1, 0, 0]}}, hinge: {type: free, to: world}}
  motor: {mass: 1, inertia: [0.01, 0.02, 0.02], hinge: {type: revolute, axis: [1, 0, 0], to: bus, initial: {rate: 5}}}
  drum: {mass: 1, inertia: [0.1, 0.2, 0.2], hinge: {type: revolute, axis: [1, 0, 0], to: bus.p}}
  dust: {type: particle, mass: 0.5, hinge: {type: locked, to: {body: drum, position: [0, 0.4, 0]}}}
  guest: {mass: 1, inertia: [0.1, 0.2, 0.2], hinge: {type: revolute, axis: [1, 0, 0], to: {body: bus, position: [0, 1, 0]}}}
  fan: {mass: 1, inertia: [0.1, 0.1, 0.2], hinge: {type: revolute, axis: [0, 0, 1], to: bus, prescribed: true}}
loops:
  gear: {type: coupling, terms: {motor: 1, drum: -5}}
  stay: {type: plane, from: bus, to: guest}
)yaml";
  const TemporaryFolder dir;
  const auto told = [&](const std::string& call, const std::string& text, const std::string& hint) {
    const Finished done = mission(
        dir, "phase { name = 'a', duration = 1, exit_ = function() " + call + " end }\nphase { name = 'b', duration = 1 }\n", kGeared);
    EXPECT_EQ(done.exit_code, 3) << call << done.err;
    EXPECT_NE(done.err.find(text), std::string::npos) << call << "\n" << done.err;
    EXPECT_NE(done.err.find(hint), std::string::npos) << call << "\n" << done.err;
  };
  told("sat:lock 'drum'", "\"drum\", whose hinge is locked", "sat:open in a mission");
  told("sat:lock 'drum'", "a loop that closes nothing, at loops.gear.terms.drum\n", "got:      \"drum\", whose hinge is locked");
  told("sat:detach 'drum'", "\"drum\", which flies freely", "sat:open in a mission");
  told("sat:lock 'guest'", "which are fixed to each other", "sat:open in a mission");
  told("sat:detach 'dust'", "dust, a particle", "translational");
  told("sat:lock 'fan'", "a model that the run cannot go on with, at vehicle:lock\n", "that of fan, which is prescribed");
  const Finished done =
      mission(dir,
              "phase { name = 'a', duration = 1, exit_ = function() sat:attach('dust', {to = {body = 'world', orientation = "
              "{quaternion_wxyz = {sat:body('dust'):attitude()}}}, type = 'translational'}) end }\n"
              "phase { name = 'b', duration = 1 }\n",
              kGeared);
  EXPECT_EQ(done.exit_code, 0) << done.err;
}

/// Where an event closes it: between two free flyers in orbit, and not with the one on a free hinge to the other.
TEST(Topology, ALoopFarFromItsHomeIsToldOf) {
  const auto told = [](const char* inboard, const char* place) {
    const std::string vehicle = fmt::format(R"yaml(
cardan: 1
bodies:
  chaser: {{mass: 20, inertia: [2, 3, 4], hinge: {{type: free, to: world, initial: {{position: [6.9e6, 0, 0]}}}}}}
  guest: {{mass: 50, inertia: [5, 6, 7], hinge: {{type: free, to: {}, initial: {{position: [{}, 0, 0]}}}}}}
loops:
  grip: {{type: ball, from: {{body: chaser, position: [1, 0, 0]}}, to: {{body: guest, position: [-1, 0, 0]}}, open: true}}
)yaml",
                                            inboard, place);
    const TemporaryFolder dir;
    const Finished done = mission(
        dir, "phase { name = 'a', duration = 1, exit_ = function() sat:close 'grip' end }\nphase { name = 'b' }\n", vehicle.c_str());
    EXPECT_EQ(done.exit_code, 0) << done.err;
    return summary_of(dir / "out").at("warnings").dump().find("counted from the origin of the world") != std::string::npos;
  };
  EXPECT_TRUE(told("world", "6900002"));
  EXPECT_FALSE(told("chaser", "2"));
}

}  // namespace
}  // namespace cardan
