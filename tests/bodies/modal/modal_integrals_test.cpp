#include "bodies/modal/lumped.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/base/diagnostic.hpp"
#include "tests/support/worse.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using test::largest;
using Json = nlohmann::json;

double number(const Json& j) { return std::stod(j.get<std::string>()); }
Vector3d vector3(const Json& j) { return {number(j[0]), number(j[1]), number(j[2])}; }
MatrixXd matrix(const Json& j) {
  MatrixXd A(j.size(), j[0].size());
  for (Eigen::Index r = 0; r < A.rows(); ++r)
    for (Eigen::Index c = 0; c < A.cols(); ++c) A(r, c) = number(j[std::size_t(r)][std::size_t(c)]);
  return A;
}
Matrix3d tilde(const Vector3d& a) {
  Matrix3d T;
  T << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return T;
}

struct Case {
  Json file;
  ModalData data;
};

Case read_case(const std::string& name) {
  Case c;
  c.file = Json::parse(std::ifstream(CARDAN_SOURCE_DIR "/tests/reference/oracle/" + name + ".json"));
  const int m = c.file["nmodes"];
  std::vector<MassNode> nodes;
  for (const Json& j : c.file["nodes"]) {
    MassNode n;
    n.mass = number(j["mass"]);
    n.position = vector3(j["pos"]);
    n.Phi = matrix(j["Phi"]);
    if (j.contains("Psi")) n.Psi = matrix(j["Psi"]);
    if (j.contains("inertia")) n.inertia = matrix(j["inertia"]);
    nodes.push_back(n);
  }
  c.data = lumped_modal_data(nodes, MatrixXd::Identity(m, m), {}, {});
  return c;
}

/// Relative to the largest entry of the array: sums of at most 9 products of numbers of order one.
constexpr double kTolerance = 1e-14;

class OracleIntegrals : public testing::TestWithParam<const char*> {};

TEST_P(OracleIntegrals, AreReproduced) {
  const Case c = read_case(GetParam());
  const Json& e = c.file["expected"]["integrals"];
  const ModalIntegrals& I = c.data.integrals;
  const auto m = static_cast<std::size_t>(c.data.n_modes);
  const auto expect = [](const MatrixXd& got, const MatrixXd& want, double scale, const char* what) {
    EXPECT_LE(largest(got - want), kTolerance * scale) << what;
  };
  EXPECT_NEAR(I.I1, number(e["I1"]), kTolerance * I.I1);
  expect(I.I2, vector3(e["I2"]), largest(I.I2), "I2");
  for (const auto& [got, name] : {std::pair{I.I3, "I3"}, {I.I4, "I4"}, {I.I6, "I6"}, {MatrixXd(I.I7), "I7"}})
    expect(got, matrix(e[name]), largest(matrix(e[name])), name);
  for (std::size_t l = 0; l < m; ++l) {
    const MatrixXd I5_l = matrix(e["I5"][l]).transpose();
    expect(I.I5[l], I5_l, largest(I5_l), "I5");
    expect(I.I8[l], matrix(e["I8"][l]), largest(matrix(e["I8"][l])), "I8");
    for (std::size_t k = 0; k < m; ++k) {
      const MatrixXd I9_lk = matrix(e["I9"][l][k]);
      expect(I.I9[l * m + k], I9_lk, largest(I9_lk), "I9");
    }
  }
}

TEST_P(OracleIntegrals, GiveTheMassMatrixAndItsDerivativesOfLevelOne) {
  const Case c = read_case(GetParam());
  const ModalIntegrals& I = c.data.integrals;
  const Eigen::Index m = c.data.n_modes;
  const Json& level = c.file["expected"]["level1"];
  MatrixXd M = MatrixXd::Zero(6 + m, 6 + m);
  const auto fill = [m](MatrixXd& A, const Matrix3d& ww, const Matrix3d& wv, const MatrixXd& we, const MatrixXd& ve, const MatrixXd& ee) {
    A.block(0, 0, 3, 3) += ww;
    A.block(0, 3, 3, 3) += wv;
    A.block(3, 0, 3, 3) += wv.transpose();
    A.block(0, 6, 3, m) += we;
    A.block(6, 0, m, 3) += we.transpose();
    A.block(3, 6, 3, m) += ve;
    A.block(6, 3, m, 3) += ve.transpose();
    A.block(6, 6, m, m) += ee;
  };
  fill(M, I.I7, tilde(I.I2), I.I4, I.I3, I.I6);
  M.block(3, 3, 3, 3) += I.I1 * Matrix3d::Identity();
  for (Eigen::Index i = 0; i < m; ++i) {
    const auto s = static_cast<std::size_t>(i);
    MatrixXd we = I.I5[s], ee = MatrixXd::Zero(m, m), dM = MatrixXd::Zero(6 + m, 6 + m);
    Matrix3d ww = I.I8[s] + I.I8[s].transpose();
    if (!I.rotary_ww.empty()) {
      ww += I.rotary_ww[s];
      we += I.rotary_we[s];
      ee += I.rotary_ee[s];
    }
    fill(dM, ww, tilde(I.I3.col(i)), we, MatrixXd::Zero(3, m), ee);
    const MatrixXd want = matrix(level["dM_fl_deta"][s]);
    EXPECT_LE(largest(dM - want), kTolerance * largest(want));
    M += number(c.file["state"]["eta"][s]) * dM;
  }
  const MatrixXd want = matrix(level["M_fl"]);
  EXPECT_LE(largest(M - want), kTolerance * largest(want));
}

INSTANTIATE_TEST_SUITE_P(Files, OracleIntegrals,
                         testing::Values("53_body_levels_translational", "54_body_levels_rotary", "55_body_levels_6_modes"),
                         [](const auto& file) { return std::string(file.param); });

std::vector<MassNode> two_nodes() {
  MassNode a, b;
  a.mass = b.mass = 1.0;
  b.position = Vector3d::UnitX();
  b.Phi = Vector3d::UnitZ();
  return {a, b};
}

std::string code_of(const MatrixXd& K, const MatrixXd& C, std::vector<MassNode> nodes = two_nodes()) {
  try {
    lumped_modal_data(std::move(nodes), K, C, {});
  } catch (const InputError& e) {
    return std::string(number_of(e.diagnostics().front().code));
  }
  return "accepted";
}

TEST(LumpedModalData, AcceptsMissingShapesAndMissingDamping) {
  const ModalData d = lumped_modal_data(two_nodes(), MatrixXd::Constant(1, 1, 4.0), {}, {{"tip", {1, 0, 0}, Matrix3d::Identity(), {}, {}}});
  EXPECT_EQ(d.integrals.I3, Vector3d::UnitZ());
  EXPECT_EQ(d.integrals.I4, -Vector3d::UnitY());
  EXPECT_TRUE(d.C.isZero(0.0));
  EXPECT_TRUE(d.integrals.rotary_ww.empty());
  EXPECT_EQ(d.nodes[0].Phi.cols(), 1);
}

/// Points of |J0| = sqrt(2.01) that lie on z, where only J0 resists: of what it is there, 0.1 each, that is the largest part.
TEST(LumpedModalData, TellsTheLargestPartOfRotaryInertia) {
  std::vector<MassNode> nodes(2);
  for (int i = 0; i < 2; ++i) {
    MassNode& n = nodes[static_cast<std::size_t>(i)];
    n.mass = 1.0, n.position = {0.0, 0.0, 1.0 + 0.6 * i};
    n.Phi = Vector3d::UnitX(), n.Psi = (0.1 + 0.1 * i) * Vector3d::UnitX();
    n.inertia = Vector3d(1.0, 1.0, 0.1).asDiagonal();
  }
  const ModalIntegrals I = lumped_modal_data(nodes, MatrixXd::Identity(1, 1), {}, {}).integrals;
  EXPECT_NEAR(I.rotary_share, std::sqrt(2.01) / 0.1, 1e-13);  // of some ten operations
  EXPECT_EQ(I.rotary_turn[0], 0.2);
}

TEST(LumpedModalData, RefusesWhatDoesNotFit) {
  const MatrixXd one = MatrixXd::Identity(1, 1);
  EXPECT_EQ(code_of(one, one), "accepted");
  EXPECT_EQ(code_of(MatrixXd::Identity(2, 2), {}), "C0321");
  EXPECT_EQ(code_of(MatrixXd::Identity(1, 2), {}), "C0321");
  EXPECT_EQ(code_of(-one, {}), "C0321");
  EXPECT_EQ(code_of(one, -one), "C0321");
  EXPECT_EQ(code_of(one, {}, {}), "C0321");
  std::vector<MassNode> massless = two_nodes();
  massless[0].mass = 0.0;
  EXPECT_EQ(code_of(one, {}, massless), "C0321");
}

TEST(LumpedModalData, RefusesARigidBodyModeLeftIn) { EXPECT_EQ(code_of(MatrixXd::Zero(1, 1), {}), "C0322"); }

}  // namespace
}  // namespace cardan
