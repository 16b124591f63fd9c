// The same input gives the same bits: wherever, in whatever surroundings, in whatever company it is run.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/io/hdf5_file.hpp"
#include "core/io/sha256.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Modes that are solved for, a plugin's hinges, a device with noise and states, loads, events and a controller.
struct Folder : TemporaryFolder {
  explicit Folder(const std::string& first = "arc.so", const std::string& second = "custom_cam.so") {
    for (const char* plugin : {"arc.so", "custom_cam.so"}) fs::copy(std::string(CARDAN_BINARY_DIR "/plugins/") + plugin, *this / plugin);
    write(*this / "vehicle.yaml", R"(cardan: 1
bodies:
  bus: {mass: 50, inertia: [9, 8, 7], nodes: {side: {position: [0.5, 0, 0]}, top: {position: [0, 0, 0.5]}}, hinge: {type: free, to: world}}
  boom:
    type: modal_flexible
    level: 1
    modal:
      beam: {length: 3 m, material: {E: 70 GPa, rho: 2700 kg/m^3}, section: {rectangle: {width: 4 cm, height: 2 cm}}}
      modes: {count: 4}
      damping: 0.5 %
    hinge: {type: locked, to: bus.side, at: root}
  mass: {mass: 2, inertia: [0.1, 0.1, 0.1], hinge: {type: acme/arc, radius: 0.4 m, to: bus.top}}
  cam: {mass: 1, inertia: [0.1, 0.1, 0.1], hinge: {type: custom_cam, axis: [0, 0, 1], a: 0.1, b: 0.05, c: 0.3, to: bus}}
devices:
  wheel: {type: momentum_wheel, at: bus, inertia: 0.01}
  gyro: {type: imu, at: bus.top, rate: 5 Hz, angle_random_walk: 1e-4}
)");
    write(*this / "scenario.lua", "plugin '" + first + "' plugin '" + second + R"('
local sat = vehicle "vehicle.yaml"
mission { duration = "20 s", integrator = { method = "dopri5", relative = 1e-8 }, output = { rate = "10 Hz" } }
initial { bus = { wx = 0.1, wy = 0.3, wz = -0.2 }, mass = { rate = 1 }, cam = { rate = 0.5 } }
local mass = sat:hinge "mass"
controller { name = "noise", rate = "5 Hz", step = function(t) mass:torque(0.01 * (math.random() - 0.5)) end }
event { name = "turn", when = function() return mass:angle() - 3 end, action = function(t) end }
)");
  }
};

/// Hashes of the final state and of every channel.
json hashes_of(const std::string& folder, const std::function<void()>& in_child = {}) {
  const Finished run = run_program({"run", "scenario.lua", "--out", "out", "--quiet"}, folder, in_child);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  if (run.exit_code != 0) return {};
  const json hashes = summary_of(folder + "/out")["hashes"];
  EXPECT_GT(hashes["channels"].size(), 10u);
  return hashes;
}

class Bits : public testing::Test {
 protected:
  const Folder folder_;
  const json expected_ = hashes_of(folder_.path());
};

TEST_F(Bits, AreThoseOfTheRunBefore) { EXPECT_EQ(hashes_of(folder_.path()), expected_); }

TEST_F(Bits, DoNotDependOnTheFolder) {
  const TemporaryFolder other;
  fs::copy(folder_.path(), other / "a folder with spaces", fs::copy_options::recursive);
  EXPECT_EQ(hashes_of(other / "a folder with spaces"), expected_);
}

TEST_F(Bits, DoNotDependOnLocaleTimeZoneOrSurroundings) {
  const TemporaryFolder home;  // modes are kept there: not in a place that other tests take for one that is not there
  const std::string elsewhere = home.path();
  for (const auto& [name, value] : {std::pair{"LC_ALL", "de_DE.UTF-8"},
                                    {"LC_ALL", "C.utf8"},
                                    {"TZ", "Pacific/Auckland"},
                                    {"HOME", elsewhere.c_str()},
                                    {"MALLOC_PERTURB_", "165"},
                                    {"LD_BIND_NOW", "1"},
                                    {"COLUMNS", "20"}})
    EXPECT_EQ(hashes_of(folder_.path(), [name = name, value = value] { setenv(name, value, 1); }), expected_) << name << "=" << value;
  EXPECT_EQ(hashes_of(folder_.path(), [] { clearenv(); }), expected_) << "no environment at all";
}

// Libraries of linear algebra under the modes may use more; memory that is not set is not looked at.
TEST_F(Bits, DoNotDependOnTheNumberOfThreads) {
  for (const char* n : {"1", "2", "8"})
    EXPECT_EQ(hashes_of(folder_.path(),
                        [&] {
                          for (const char* name : {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"}) setenv(name, n, 1);
                          setenv("CARDAN_CACHE", "off", 1);
                        }),
              expected_)
        << n;
}

TEST_F(Bits, DoNotDependOnTheOrderOfPlugins) { EXPECT_EQ(hashes_of(Folder("custom_cam.so", "arc.so").path()), expected_); }

TEST_F(Bits, AreThoseOfACacheOfModes) {
  const TemporaryFolder cache;
  const auto with_cache = [&] {
    setenv("XDG_CACHE_HOME", cache.path().c_str(), 1);
    unsetenv("CARDAN_CACHE");
  };
  EXPECT_EQ(hashes_of(folder_.path(), with_cache), expected_) << "which is filled";
  EXPECT_EQ(hashes_of(folder_.path(), with_cache), expected_) << "which is read";
}

TEST_F(Bits, OfRunsSideBySideAreTheSame) {
  const TemporaryFolder dir;
  for (const char* name : {"a", "b", "c", "d"}) {
    fs::copy(folder_.path(), dir / name, fs::copy_options::recursive);
    write(dir / name + "/golden.yaml",
          "cardan_golden: 1\ntruth: this run\nfigures: []\nchannels:\n  - channel: bodies/bus/rate\n    class: truth\n"
          "    absolute: 1e3 rad/s\n    why: any\n    reference: {always: [0, 0, 0], unit: rad/s}\n");
  }
  for (const char* jobs : {"1", "4"}) {
    EXPECT_EQ(run_program({"regress", ".", "-j", jobs}, dir.path()).exit_code, 0);
    for (const char* name : {"a", "b", "c", "d"}) EXPECT_EQ(summary_of(dir / "out/regress/" + name)["hashes"], expected_) << jobs;
  }
}

TEST_F(Bits, DependOnTheSeed) {
  const Finished run = run_program({"run", "scenario.lua", "--out", "out", "--quiet", "--seed", "1"}, folder_.path());
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_NE(summary_of(folder_ / "out")["hashes"], expected_);
}

TEST_F(Bits, AreHashedAsTheFileHasThem) {
  const Hdf5File file = Hdf5File::open(folder_ / "out/run.h5");
  const auto hash = [](const std::vector<double>& values) {
    return sha256({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double)});
  };
  for (const auto& [channel, expected] : expected_["channels"].items())
    EXPECT_EQ(hash(file.read_doubles(channel == "time" ? "/time" : "/channels/" + channel).values), expected) << channel;
  const json model = summary_of(folder_ / "out")["model"];
  EXPECT_EQ(file.shape("/restart/x")[0], model["n_q"].get<std::size_t>() + model["n_v"].get<std::size_t>() + 1)
      << "the wheel has one state";
  std::vector<double> state = file.read_doubles("/restart/t").values;
  const std::vector<double> x = file.read_doubles("/restart/x").values;
  state.insert(state.end(), x.begin(), x.end());
  EXPECT_EQ(hash(state), expected_["final_state"]);
}

}  // namespace
}  // namespace cardan
