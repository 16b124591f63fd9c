// `cardan import` as a user runs it: what it writes loads, is checked and runs; what it says; what it does not overwrite.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
const std::string kImportRobots = CARDAN_SOURCE_DIR "/tests/import/robots/";

TEST(Import, WritesAVehicleThatIsCheckedAndRuns) {
  for (const std::string name : {"double_pendulum.urdf", "gripper.urdf", "four_bar.urdf", "four_bar.xml", "arm.xml"}) {
    const TemporaryFolder dir;
    const Finished made = run_program({"import", kImportRobots + name, "--out", "vehicle.yaml"}, dir.path());
    ASSERT_EQ(made.exit_code, 0) << made.err;
    EXPECT_TRUE(made.out.starts_with("vehicle.yaml: ")) << made.out;
    write(dir / "scenario.lua", "vehicle \"vehicle.yaml\"\nmission { duration = 0.2, output = { rate = 50 } }\n");
    const Finished checked = run_program({"check", "scenario.lua"}, dir.path());
    EXPECT_EQ(checked.exit_code, 0) << name << checked.err;
    const Finished run = run_program({"run", "scenario.lua", "--out", "out", "--quiet"}, dir.path());
    EXPECT_EQ(run.exit_code, 0) << name << run.err;
    EXPECT_TRUE(fs::exists(dir / "out/run.h5"));
  }
}

TEST(Import, TellsWhereEachThingCameFrom) {
  const TemporaryFolder dir;
  const Finished made = run_program({"import", kImportRobots + "gripper.urdf"}, dir.path());
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_EQ(made.out,
            "gripper.yaml: 3 bodies, 9 coordinates, 8 velocities, 1 loop\n"
            "  the root link \"palm\" is free: --base fixed holds it to the world\n"
            "  limits of 2 joints are comments: --stop-stiffness K makes stops of them\n");
  EXPECT_EQ(file_text(dir / "gripper.yaml"),
            R"(# URDF "gripper", from gripper.urdf, by cardan import. Comments tell where things stand there.
# the root link "palm" is free: --base fixed holds it to the world
# limits of 2 joints are comments: --stop-stiffness K makes stops of them

cardan: 1
name: 'gripper'
gravity: none   # URDF has none; on the ground {uniform: [0, 0, -9.81]}

bodies:
  palm:   # link "palm", gripper.urdf:2
    mass: 2
    inertia: [0.01, 0.01, 0.01]
    hinge:
      type: free
      to: world
  finger_1:   # link "finger 1", gripper.urdf:5
    mass: 0.4
    com: [0, 0, 0.05]
    inertia: [0.001, 0.001, 0.0004]
    hinge:   # joint "left", gripper.urdf:11
      type: prismatic
      to: palm
      axis: [0, 1, 0]
      # joint "left": effort 20, velocity 0.1
      # limits of joint "left": 0 to 0.04 m
  finger_2:   # link "finger 2", gripper.urdf:8
    mass: 0.6
    com: [0, 0, 0.05]
    inertia: [0.001, 0.001, 0.0004]
    hinge:   # joint "right", gripper.urdf:16
      type: prismatic
      to: palm
      axis: [0, 1, 0]
      initial: {displacement: 0.01}
      # joint "right": effort 20, velocity 0.1
      # limits of joint "right": -0.04 to 0.01 m

loops:
  right:   # mimic of joint "right", gripper.urdf:20
    type: coupling
    terms: {finger_2: 1, finger_1: 0.5}
    offset: 0.01
)");
}

TEST(Import, ReadsAPipeToItsEndAndNoDevice) {
  const TemporaryFolder dir;
  const std::string pipe = dir / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::thread writer([&] { std::ofstream(pipe) << file_text(kImportRobots + "double_pendulum.urdf"); });
  const Finished piped = run_program({"import", "pipe", "--out", "b.yaml"}, dir.path());
  writer.join();
  EXPECT_EQ(piped.exit_code, 0) << piped.err;
  EXPECT_TRUE(has(piped.out, "b.yaml: 2 bodies, 2 coordinates")) << piped.out;
  EXPECT_TRUE(has(run_program({"import", "/dev/null"}, dir.path()).err, "expected: a file or a pipe\n  got:      a device or a socket\n"));
  EXPECT_TRUE(has(run_program({"import", "."}, dir.path()).err, "got:      a folder\n"));
}

TEST(Import, TakesItsOptions) {
  const TemporaryFolder dir;
  const auto import = [&](std::vector<std::string> more) {
    std::vector<std::string> all{"import", kImportRobots + "double_pendulum.urdf", "--out", "v.yaml"};
    all.insert(all.end(), more.begin(), more.end());
    return run_program(all, dir.path());
  };
  ASSERT_EQ(
      import({"--stop-stiffness", "200", "--friction-width", "0.01", "--initial", "shoulder=30 deg", "--initial", "elbow=0.5"}).exit_code,
      0);
  const std::string text = file_text(dir / "v.yaml");
  EXPECT_TRUE(has(text, "initial: {angle: 0.5235987755982988}")) << text;
  EXPECT_TRUE(has(text, "initial: {angle: 0.5}")) << text;
  EXPECT_TRUE(has(text, "{type: stop, component: angle, lower: -2, upper: 2.5, stiffness: 200, exponent: 1}")) << text;
  EXPECT_TRUE(has(text, "{type: friction, component: angle, coulomb: 0.05, width: 0.01}")) << text;
  for (const auto& [option, value, part] :
       {std::tuple{"--base", "fred", "expected: free or fixed"}, std::tuple{"--stop-stiffness", "-1", "expected: a number > 0, in SI"},
        std::tuple{"--friction-width", "wide", "expected: a number > 0, in SI"},
        std::tuple{"--initial", "shoulder", "expected: joint=value"},
        std::tuple{"--initial", "hip=3", "expected: the name of a joint with one coordinate: "},
        std::tuple{"--initial", "shoulder=3 kg", "expected: an angle of joint \"shoulder\""},
        std::tuple{"--initial", "elbow=3 cm", "expected: an angle of joint \"elbow\""},
        std::tuple{"--leave-out", "legs", "got:      \"legs\""}}) {
    const Finished refused = import({option, value});
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_TRUE(has(refused.err, std::string("at: ") + option)) << refused.err;
    EXPECT_TRUE(has(refused.err, part)) << refused.err;
  }
}

// Limits between which nothing moves are no stops.
TEST(Import, EqualLimitsAreNoStops) {
  const TemporaryFolder dir;
  const std::string inertial = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link>\n";
  write(dir / "r.urdf", "<robot name='r'>\n<link name='base'>" + inertial + "<link name='arm'>" + inertial +
                            "<joint name='shoulder' type='revolute'><parent link='base'/><child link='arm'/>\n"
                            "<limit lower='0.3' upper='0.3' effort='1' velocity='1'/></joint></robot>\n");
  EXPECT_EQ(run_program({"import", "r.urdf", "--out", "v.yaml"}, dir.path()).exit_code, 0);
  const Finished refused = run_program({"import", "r.urdf", "--stop-stiffness", "10", "--out", "w.yaml"}, dir.path());
  EXPECT_EQ(refused.exit_code, 2);
  for (const char* part : {"C0301", "r.urdf:4", "limits of joint \"shoulder\"", "0.3 twice", "type=\"fixed\""})
    EXPECT_TRUE(has(refused.err, part)) << part << refused.err;
}

TEST(Import, WritesOverNothingThatItWasNotToldTo) {
  const TemporaryFolder dir;
  write(dir / "gripper.yaml", "mine");
  const Finished refused = run_program({"import", kImportRobots + "gripper.urdf"}, dir.path());
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_TRUE(has(refused.err, "error[C0701]")) << refused.err;
  EXPECT_EQ(file_text(dir / "gripper.yaml"), "mine");
  EXPECT_EQ(run_program({"import", kImportRobots + "gripper.urdf", "--out", "gripper.yaml"}, dir.path()).exit_code, 0);
  fs::copy_file(kImportRobots + "gripper.urdf", dir / "r.urdf");
  EXPECT_EQ(run_program({"import", "r.urdf", "--out", "r.urdf"}, dir.path()).exit_code, 2) << "the robot itself";
  std::filesystem::create_symlink("/dev/full", dir / "full");  // by a link: where a file took its name, the device itself stays
  const Finished full = run_program({"import", "r.urdf", "--out", "full"}, dir.path());
  EXPECT_EQ(full.exit_code, 4) << full.out;
  EXPECT_TRUE(has(full.err, "No space left on device") && !has(full.err, "Nothing was run")) << full.err;
  EXPECT_TRUE(std::filesystem::is_symlink(dir / "full"));
  write(dir / "bad.urdf", "<robot");
  EXPECT_EQ(run_program({"import", "bad.urdf", "--out", "gripper.yaml"}, dir.path()).exit_code, 2);
  EXPECT_TRUE(has(file_text(dir / "gripper.yaml"), "finger_2")) << "what cannot be read leaves what is there";
  EXPECT_TRUE(has(run_program({"import", "none.urdf"}, dir.path()).err, "C0102"));
}

}  // namespace
}  // namespace cardan
