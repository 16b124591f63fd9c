// Plugins by the program: a good one in C, and every way in which one may be no plugin, a bad one or a dangerous one.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/io/hdf5_file.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
const std::string kPlugins = CARDAN_BINARY_DIR "/plugins/";

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// A folder with the plugin as p.so, and a scenario that uses the hinge faulty/slide.
struct PluginFolder : TemporaryFolder {
  explicit PluginFolder(const std::string& plugin = "faulty.so") {
    fs::copy(kPlugins + plugin, *this / "p.so");
    std::ofstream(*this / "vehicle.yaml")
        << "cardan: 1\nbodies:\n  a: {mass: 1, inertia: [1, 1, 1], hinge: {type: faulty/slide, to: world}}\n";
    std::ofstream(*this / "scenario.lua") << "plugin 'p.so' vehicle 'vehicle.yaml' mission { duration = 1, integrator "
                                             "= { method = 'rk4', step = 0.25 } }\n"
                                             "initial { a = { rate = 1 } }\n";
  }
};

Finished with_fault(const std::string& fault, const std::vector<std::string>& arguments, const std::string& folder) {
  return run_program(arguments, folder, [&] { setenv("CARDAN_FAULT", fault.c_str(), 1); });
}

TEST(Plugins, InCAsPrintedInTheDocuments) {
  const TemporaryFolder dir;
  fs::copy(kPlugins + "arc.so", dir / "arc.so");
  const Finished check = run_program({"check-plugin", "arc.so"}, dir.path());
  EXPECT_EQ(check.exit_code, 0) << check.out << check.err;
  EXPECT_EQ(check.out, "ok    hinge acme/arc: motion along a circle\n");
  // One body of 2 kg on a circle of 0.4 m, at rate 3: it goes on, 0.4 m/rad * 3 rad/s, and a torque-free circle needs
  // no energy.
  std::ofstream(dir / "vehicle.yaml")
      << "cardan: 1\nbodies:\n  a: {mass: 2, inertia: [1, 1, 1], hinge: {type: acme/arc, radius: 0.4 m, to: world}}\n";
  std::ofstream(dir / "scenario.lua") << "plugin 'arc.so' vehicle 'vehicle.yaml' mission { duration = 1 } initial { a = { rate = 3 } }\n";
  const Finished run = run_program({"run", ".", "--out", "out", "--quiet", "--check-against-reference"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  EXPECT_NEAR(Hdf5File::open(dir / "out/run.h5").read_doubles("/channels/hinges/a/angle").values.back(), 3.0, 1e-8);
}

TEST(Plugins, AGoodOneIsUsed) {
  const PluginFolder dir;
  EXPECT_EQ(run_program({"check-plugin", "p.so"}, dir.path()).exit_code, 0);
  const Finished run = run_program({"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.err;
}

TEST(Plugins, WhatIsNoPluginIsAnswered) {
  const TemporaryFolder dir;
  std::ofstream(dir / "text.so") << "not a library\n";
  fs::copy(kPlugins + "faulty.so", dir / "short.so");
  fs::resize_file(dir / "short.so", fs::file_size(dir / "short.so") / 2);
  fs::create_directory(dir / "folder");
  ASSERT_EQ(mkfifo((dir / "pipe").c_str(), 0600), 0);
  for (const char* name : {"", "absent.so", "text.so", "short.so", "folder", "pipe", "/dev/null"}) {
    const Finished check = run_program({"check-plugin", name}, dir.path());
    EXPECT_EQ(check.exit_code, 2) << name << check.err;
    EXPECT_TRUE(has(check.err, "error[C0601]: plugin cannot be loaded")) << name << check.err;
  }
  const TemporaryFolder gone;
  const Finished deleted = run_program({"check-plugin", "p.so"}, gone.path(), [&] { fs::remove_all(gone.path()); });
  EXPECT_EQ(deleted.exit_code, 2) << deleted.err;
}

struct Fault {
  const char *name, *code, *text;
};
class FaultyPlugin : public testing::TestWithParam<Fault> {};

// `check` refuses it as an input; so does `check-plugin`, or it tells the list of what is wrong with a family.
TEST_P(FaultyPlugin, IsAnswered) {
  const auto& [name, code, text] = GetParam();
  const PluginFolder dir;
  const Finished check = with_fault(name, {"check", "."}, dir.path());
  EXPECT_EQ(check.exit_code, 2) << check.out << check.err;
  EXPECT_TRUE(has(check.err, std::string("error[") + code + "]")) << check.err;
  EXPECT_TRUE(has(check.err, text)) << check.err;
  EXPECT_TRUE(has(check.err, "scenario.lua:1")) << check.err;
  const Finished alone = with_fault(name, {"check-plugin", "p.so"}, dir.path());
  EXPECT_TRUE(alone.exit_code == 2 || alone.exit_code == 1) << alone.exit_code;
  EXPECT_TRUE(has(alone.exit_code == 1 ? alone.out : alone.err, text)) << alone.out << alone.err;
  EXPECT_FALSE(has(alone.err, "check-plugin p.so")) << "no hint at what ran just now";
}
INSTANTIATE_TEST_SUITE_P(Every, FaultyPlugin,
                         testing::Values(Fault{"refuses", "C0603", "it refused"}, Fault{"other_major", "C0603", "ABI 99."},
                                         Fault{"newer_minor", "C0603", "ABI 1.99"}, Fault{"null_name", "C0602", "a null pointer"},
                                         Fault{"null_family", "C0602", "a null pointer"}, Fault{"short_plugin", "C0602", "struct_size = 8"},
                                         Fault{"endless_families", "C0602", "a table again at index 1"},
                                         Fault{"null_type", "C0604", "type: null"}, Fault{"null_params", "C0604", "params: null"},
                                         Fault{"many_params", "C0604", "n_params: 1000000"}, Fault{"null_units", "C0604", "v_units: null"},
                                         Fault{"small_params", "C0604", "pack writes 8 bytes, params_size is 0"},
                                         Fault{"law", "C0604", "linear part of Ht v"},
                                         Fault{"crash_load", "C0601", "Segmentation fault, in the loading of the library"},
                                         Fault{"crash_entry", "C0604", "Segmentation fault, in cardan_plugin_entry"},
                                         Fault{"crash_family", "C0604", "Segmentation fault, in family(\"hinge\", 0)"},
                                         Fault{"crash_pack", "C0604", "Segmentation fault, in pack of hinge \"faulty/slide\""},
                                         Fault{"abort_kinematics", "C0604", "Aborted, in kinematics of hinge \"faulty/slide\""},
                                         Fault{"exit_pack", "C0604", "the process was ended (exit), in pack of"},
                                         Fault{"exit_kinematics", "C0604", "the process was ended (exit), in kinematics"},
                                         Fault{"throw_entry", "C0604", "an exception in cardan_plugin_entry"},
                                         Fault{"throw_qdot", "C0604", "an exception in hinge \"faulty/slide\""},
                                         Fault{"error_pack", "C0604", "no luck today"},
                                         Fault{"loop_kinematics", "C0604", ", in kinematics of hinge \"faulty/slide\""}),
                         [](const auto& tested) { return std::string(tested.param.name); });

// At 0.75 m, where no sample was: the run cannot be answered by a law any more, but it does not end with success.
TEST(Plugins, ThatEndTheProcessDoNotEndItWithSuccess) {
  const PluginFolder dir;
  const Finished run = with_fault("late_exit", {"run", ".", "--quiet", "--out", "out"}, dir.path());
  EXPECT_EQ(run.exit_code, 70) << run.out << run.err;
  EXPECT_TRUE(has(run.err, "exit")) << run.err;
}

}  // namespace
}  // namespace cardan
