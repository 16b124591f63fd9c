// Published frequencies of plates (tests/reference/cases/modal-plate-leissa.yaml, modal-nafems-fv12.yaml,
// modal-nafems-fv16.yaml).
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/elements.hpp"
#include "tests/bodies/modal/case_file.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// A square plate, thin as in NAFEMS FV12 and FV16, corner at (0, -side / 2).
FeModel square(int n, bool rotary_inertia = true) {
  PlateModel p;
  p.length = p.width = 10.0;
  p.panel = SolidPanel{{200e9, 0.3, 8000.0}, 0.05};
  p.elements_x = p.elements_y = n;
  p.rotary_inertia = rotary_inertia;
  return plate_mesh(p, {}, {});
}

/// Nodes for which the predicate holds.
template <class F>
std::vector<int> nodes_where(const FeModel& model, F&& predicate) {
  std::vector<int> out;
  for (int i = 0; i < static_cast<int>(model.nodes.size()); ++i)
    if (predicate(model.nodes[i])) out.push_back(i);
  return out;
}

/// The dofs of `directions` at `nodes`, and all membrane and drilling dofs of the model.
std::vector<int> bending_only(const FeModel& model, const std::vector<int>& nodes, const std::vector<int>& directions) {
  std::vector<int> held;
  for (int i = 0; i < static_cast<int>(model.nodes.size()); ++i)
    for (int d : {0, 1, 5}) held.push_back(6 * i + d);
  for (int node : nodes)
    for (int d : directions) held.push_back(6 * node + d);
  return held;
}

VectorXd frequencies(const FeModel& model, const std::vector<int>& held, int count) {
  return normal_modes(model, held, count, RigidModes::remove, {}).omega2.cwiseSqrt() / (2 * std::numbers::pi);
}

bool on_edge(const Vector3d& p) { return p.x() < 1e-9 || p.x() > 10 - 1e-9 || std::abs(p.y()) > 5 - 1e-9; }

// lambda = omega a^2 sqrt(rho h / D)
double leissa(double f) {
  const double D = 200e9 * std::pow(0.05, 3) / (12 * (1 - 0.09));
  return 2 * std::numbers::pi * f * 100 * std::sqrt(8000 * 0.05 / D);
}

TEST(PlateModes, SimplySupportedSquareConvergesWithOrderTwo) {
  const std::vector<double> want = case_values("modal-plate-leissa", "SSSS");
  double previous = 0.0;
  for (int n : {8, 16, 32}) {
    const FeModel model = square(n);
    const std::vector<int> edge = nodes_where(model, on_edge);
    const double error = leissa(frequencies(model, bending_only(model, edge, {2}), 1)(0)) / want[0] - 1;
    if (previous != 0.0) {
      EXPECT_NEAR(std::log2(previous / error), 2.0, 0.15) << n;
    }
    previous = error;
  }
}

// The case states 1e-6 against the exact roots of a thin plate (no rotary inertia). The element's error is even in its
// size, c2 h^2 + c4 h^4 + ..., up to 4e-3 with 32 elements, so one mesh cannot reach it: of n, 2 n and 4 n elements the
// first two terms cancel (Romberg 1955), and c6 h^6 is left, below 1e-7; rounding of K, as (4 n)^4, stays below 1e-8.
TEST(PlateModes, SimplySupportedSquareConvergesToTheExactRoots) {
  const std::vector<double> want = case_values("modal-plate-leissa", "SSSS");
  std::vector<VectorXd> level;
  for (int n : {16, 32, 64}) {
    const FeModel model = square(n, false);
    level.push_back(frequencies(model, bending_only(model, nodes_where(model, on_edge), {2}), 6));
  }
  const VectorXd first = (4.0 * level[1] - level[0]) / 3.0, second = (4.0 * level[2] - level[1]) / 3.0;
  const VectorXd limit = (16.0 * second - first) / 15.0;
  for (int k = 0; k < 6; ++k) test::expect_relative(fmt::format("SSSS, mode {}", k + 1), leissa(limit(k)), want[k], 1e-6);
}

TEST(PlateModes, SquaresReachTheFrequenciesOfLeissa) {
  const FeModel model = square(32);
  const std::vector<int> edge = nodes_where(model, on_edge);
  const auto compare = [&](const std::vector<int>& held, const char* quantity, double tolerance) {
    const std::vector<double> want = case_values("modal-plate-leissa", quantity);
    const VectorXd f = frequencies(model, held, 6);
    for (int k = 0; k < 6; ++k) {
      test::expect_relative(fmt::format("{}, mode {}", quantity, k + 1), leissa(f(k)), want[k], tolerance);
    }
  };
  compare(bending_only(model, edge, {2, 3, 4}), "CCCC", 1e-2);
  compare(bending_only(model, model.root_nodes, {2, 3, 4}), "CFFF", 1e-2);
  compare(bending_only(model, {}, {}), "FFFF converged", 1e-2);
}

TEST(PlateModes, FreeSquareHasTheFrequenciesOfNafemsFv12) {
  const std::vector<double> want = case_values("modal-nafems-fv12", "elastic");
  const VectorXd f = frequencies(square(24), {}, 8);  // all six dofs of a node: in-plane motion is far higher
  for (int k = 0; k < 8; ++k) test::expect_relative(fmt::format("mode {} [Hz]", k + 1), f(k), want[k], 0.01);
}

TEST(PlateModes, CantileveredSquareHasTheFrequenciesOfNafemsFv16) {
  const std::vector<double> want = case_values("modal-nafems-fv16", "f [Hz]");
  const FeModel model = square(24);
  const VectorXd f = frequencies(model, dofs_of(model.root_nodes), 6);
  for (int k = 0; k < 6; ++k) test::expect_relative(fmt::format("mode {} [Hz]", k + 1), f(k), want[k], 0.01);
}

}  // namespace
}  // namespace cardan
