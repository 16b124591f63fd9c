// docs/cpp.md: its program runs its vehicle.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "core/io/hdf5_file.hpp"
#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

TEST(CppPage, ItsProgramRunsAVehicleWithAWingAndRecordsIt) {
  const TemporaryFolder folder;
  std::filesystem::copy(CARDAN_PRINTED "/satellite.yaml", folder.path());
  ASSERT_EQ(std::system(("cd " + folder.path() + " && " CARDAN_CPP_PROGRAM).c_str()), 0);
  const Hdf5File run = Hdf5File::open(folder / "run.h5");
  const std::size_t rows = 201;  // 20 s, ten rows a second, and the last
  EXPECT_EQ(run.shape("/time"), std::vector<std::size_t>{rows});
  EXPECT_EQ(run.shape("/channels/modes/wing/eta"), (std::vector<std::size_t>{rows, 4}));
  const Hdf5Array<double> rate = run.read_doubles("/channels/bodies/bus/rate"), tip = run.read_doubles("/channels/nodes/wing.tip/position");
  // Torque over inertia about x, with the wing (27 kg/m of 2 m width): 0.5 N m * 20 s / (120 + 162 * 4 / 12) kg m^2, give or take its
  // bending.
  EXPECT_NEAR(rate.values[3 * (rows - 1)], 0.5 * 20.0 / (120.0 + 162.0 * 4.0 / 12.0), 5e-3);
  EXPECT_NEAR(std::hypot(tip.values[0], tip.values[1], tip.values[2]), 6.5, 1e-6) << "at the start, undeformed";
}

}  // namespace
}  // namespace cardan
