// A free rotor whose matrices two finite-element programs wrote (tests/reference/data/rotor/ORIGIN.md): six rigid
// motions and many double frequencies.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include "core/linalg/eigenpairs.hpp"
#include "tests/bodies/modal/case_file.hpp"

namespace cardan {
namespace {

/// The lower triangle of the file, mirrored; its header (Matrix Market: comments and sizes) is passed over.
SparseMatrix matrix(const std::string& name) {
  std::ifstream in(CARDAN_SOURCE_DIR "/tests/reference/data/rotor/" + name + ".mtx");
  std::vector<Eigen::Triplet<double>> entries;
  bool sizes = name.rfind("ansys", 0) == 0;
  for (std::string line; std::getline(in, line);) {
    if (line[0] == '%') continue;
    if (std::exchange(sizes, false)) continue;
    std::istringstream text(line);
    int i = 0, j = 0;
    double value = 0.0;
    text >> i >> j >> value;
    if (i >= j) entries.emplace_back(i - 1, j - 1, value);
    if (i > j) entries.emplace_back(j - 1, i - 1, value);
  }
  SparseMatrix A(345, 345);
  A.setFromTriplets(entries.begin(), entries.end());
  return A;
}

struct Rotor {
  const char *name, *id, *listed;
  double scale;  // of the stiffness, as the source says
};
class FreeRotor : public testing::TestWithParam<Rotor> {};

// The first elastic frequency is published with all digits; the list was recomputed and printed with six places.
TEST_P(FreeRotor, HasThePublishedFrequencies) {
  const auto [name, id, listed, scale] = GetParam();
  const SparseMatrix M = matrix(std::string(name) + "_mass");
  double mass = 0.0;
  for (int i = 0; i < 345; i += 3) mass += M.col(i).sum();
  EXPECT_NEAR(mass, 77.96605, 1e-5);
  const Eigenpairs found = lowest_eigenpairs(scale * matrix(std::string(name) + "_stiffness"), M, 26, -1e4);
  const auto f = [&](int k) { return std::sqrt(std::abs(found.values[k])) / (2.0 * std::numbers::pi); };
  for (int k = 0; k < 6; ++k) EXPECT_LE(f(k), 0.01) << "rigid motion " << k + 1;
  test::expect_relative("f7 [Hz]", f(6), case_values(id, "f7 published")[0], 1e-9);
  const std::vector<double> want = case_values(id, listed);
  ASSERT_GE(want.size(), 14u);
  for (std::size_t k = 0; k < want.size(); ++k)
    test::expect_absolute(fmt::format("f{} [Hz], recomputed", 7 + k), f(6 + static_cast<int>(k)), want[k], 0.5e-6 + 1e-9 * want[k]);
}
INSTANTIATE_TEST_SUITE_P(Of, FreeRotor,
                         testing::Values(Rotor{"ansys", "modal-rotor-ansys-pair", "f7..f24", 1.0},
                                         Rotor{"abaqus", "modal-rotor-abaqus-pair", "f7..f20", 0.01}),
                         [](const auto& rotor) { return std::string(rotor.param.name); });

}  // namespace
}  // namespace cardan
