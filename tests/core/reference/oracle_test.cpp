// The twin against every reference vector that is an open tree: in double to 1e-12, and in 113 bits with the numbers of
// the file at full length to 1e-28, which leaves no room for a formula that is nearly right.
#include <gtest/gtest.h>

#include <Eigen/Core>

#include "core/reference/dense_dynamics.hpp"
#include "core/reference/factor.hpp"
#include "core/reference/quad.hpp"
#include "tests/support/tolerance.hpp"

namespace cardan::reference {
namespace {
using nlohmann::json;

/// The plugin example of the vectors: R = exp(u~ c s), p = (s, a s^2, b sin s).
ForeignHinge custom_cam() {
  return {1, 1, [](const HingeSpec& h, const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
            const auto param = [&](const char* name) { return std::get<double>(h.params.find(name)->second.value); };
            const double a = param("a"), b = param("b"), c = param("c"), s = q[0];
            const auto& axis = std::get<std::vector<double>>(h.params.find("axis")->second.value);
            const Eigen::Vector3d u = Eigen::Vector3d(axis.data()).normalized();
            const Eigen::Vector3d slope(1, 2 * a * s, b * std::cos(s)), curve(0, 2 * a, -b * std::sin(s));
            ForeignMotion m{Eigen::AngleAxisd(c * s, u).toRotationMatrix(), {s, a * s * s, b * std::sin(s)}, {}, {}, v};
            const Eigen::Vector3d shift = m.R.transpose() * slope;
            m.Ht.resize(6, 1);
            m.Ht << c * u, shift;
            m.Hdot_v << Eigen::Vector3d::Zero(), (m.R.transpose() * curve - c * u.cross(shift)) * v[0] * v[0];
            return m;
          }};
}

template <class T>
void sharpen(ModalPoint<T>& p, const json& j) {
  p.position = oracle::vector<T>(j["pos"]);
  if (j.contains("rotvec")) {
    const Vec3<T> t = oracle::vector<T>(j["rotvec"]);
    using std::sqrt;
    const T angle = t.norm();
    p.R = angle == 0 ? Mat3<T>::Identity() : rotation<T>(t / angle, angle);
  }
  if (j.contains("Phi")) p.Phi = oracle::matrix<T>(j["Phi"]);
  if (j.contains("Psi")) p.Psi = oracle::matrix<T>(j["Psi"]);
  if (j.contains("Q"))
    for (int i = 0; i < 3; ++i) p.Q[i] = oracle::matrix<T>(j["Q"][i]);
}

template <class T>
void sharpen_masses(DenseBody<T>& b, const json& nodes) {
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    MassPoint<T>& m = b.masses[i];
    m.mass = oracle::number<T>(nodes[i]["mass"]);
    if (nodes[i].contains("inertia")) m.inertia = oracle::matrix<T>(nodes[i]["inertia"]);
    sharpen(m.point, nodes[i]);
  }
}

/// The model of a file with its numbers at the full length of T instead of that of a double.
template <class T>
DenseModel<T> sharp_model(const oracle::Case& c, int level) {
  DenseModel<T> model = dense_model<T>(oracle::at_level(c.spec, level), {{"custom_cam", custom_cam()}});
  if (!c.json.contains("model")) {
    sharpen_masses(model.bodies[0], c.json["nodes"]);
    return model;
  }
  const json& bodies = c.json["model"]["bodies"];
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    DenseBody<T>& b = model.bodies[k];
    const json& j = bodies[k];
    sharpen_masses(b, j["nodes"]);
    sharpen(b.onode, j["attach"]);
    sharpen(b.pnode, j["pnode"]);
    if (j.contains("K")) b.K = oracle::matrix<T>(j["K"]);
    if (j.contains("C")) b.C = oracle::matrix<T>(j["C"]);
    if (j["hinge"].contains("axes")) {
      b.shape.axes = oracle::matrix<T>(j["hinge"]["axes"]).transpose();
      b.shape.axes.colwise().normalize();
    }
    if (j["hinge"].contains("pitch")) b.shape.pitch = oracle::number<T>(j["hinge"]["pitch"]);
  }
  for (std::size_t i = 0; i < c.points.size(); ++i) {
    std::vector<ModalPoint<T>>& nodes = model.bodies[c.json["nodes"][i]["body"].get<int>() - 1].nodes;
    for (ModalPoint<T>& n : nodes)
      if (n.name == c.points[i].node) sharpen(n, c.json["nodes"][i]);
  }
  model.gravity.g = oracle::vector<T>(c.json["model"]["gravity"]);
  return model;
}

/// One evaluation of a file at one level, and the comparison of its fields.
template <class T>
class Evaluation {
 public:
  Evaluation(const oracle::Case& c, int level, DenseModel<T> model)
      : case_(c), compare_(c.json), level_(level), twin_(std::move(model)), state_(twin_.at(q(), v())) {}

  void check_all() {
    if (case_.schema == "cardan-oracle-body/1") return check_body();
    if (case_.schema == "cardan-oracle-levels/1") return check_level();
    check_open_tree();
  }

 private:
  const json& input() const { return case_.json["input"]; }
  VecX<T> q() const {
    if (!case_.json["state"].contains("eta")) return oracle::vector<T>(case_.json["state"]["q"]);
    VecX<T> out = case_.q.cast<T>();
    const VecX<T> eta = oracle::vector<T>(case_.json["state"]["eta"]);
    out.tail(eta.size()) = eta;
    return out;
  }
  VecX<T> v() const {
    if (!case_.json["state"].contains("eta")) return oracle::vector<T>(case_.json["state"]["v"]);
    VecX<T> out(case_.v.size());
    out << oracle::vector<T>(case_.json["state"]["V"]), oracle::vector<T>(case_.json["state"]["etadot"]);
    return out;
  }

  /// 1e-12 in double; in 113 bits the 28 digits that the README vouches for. A foreign hinge enters in double.
  double limit(const std::string& field) const {
    const double reachable = oracle::reachable(case_.name, field) * lost_in_world_axes(field);
    if (std::is_same_v<T, double>) return reachable;
    for (const BodySpec& b : case_.spec.bodies)
      if (b.hinge.type == "custom_cam") return 1e-14;
    return 1e-16 * reachable;
  }
  /// World axes mix the components of a body, so a result far smaller than the terms it comes from keeps their
  /// round-off.
  double lost_in_world_axes(const std::string& field) const {
    // 39: a bias of 5e-8 out of centrifugal terms m v^2 of order 1.
    if (case_.name == "39_collinear_chain" && field == "bias") return 1e5;
    // 40: a hinge inertia of 1e-10 as a projection of one of 1 kg m^2, in everything that contains M^-1.
    const bool contains_inverse = field == "vdot" || field == "osi_nodes" || field.rfind("hybrid/", 0) == 0 ||
                                  field.rfind("hinge_wrench", 0) == 0 || field.find("acceleration") != std::string::npos;
    return case_.name == "40_tiny_inertia_about_hinge" && contains_inverse ? 1e7 : 1.0;
  }
  void judge(const std::string& field, double error) {
    ::testing::Test::RecordProperty(field, std::to_string(error == 0 ? -99.0 : std::log10(error)));
    EXPECT_LE(error, limit(field)) << field << " of " << case_.name << ", level " << level_;
  }
  template <class Derived>
  void array(const std::string& field, const Eigen::MatrixBase<Derived>& got) {
    if (compare_.has(field)) judge(field, compare_.error(field, got));
  }
  void scalar(const std::string& field, const T& got) {
    if (compare_.has(field)) judge(field, compare_.scalar_error(field, got));
  }

  void check_body() {
    const std::string at = "level" + std::to_string(level_) + "/";
    array(at + "M_fl", state_.M);
    array(at + "bias", state_.bias);
  }

  void check_level() {
    const std::string at = "level" + std::to_string(level_) + "/";
    array(at + "M", state_.M);
    array(at + "bias", state_.bias);
    array(at + "gravity_force", state_.gravity_force);
    array(at + "elastic_force", state_.elastic_force);
    array(at + "vdot", state_.forward(oracle::vector<T>(input()["tau"])));
    scalar(at + "kinetic_energy", state_.kinetic_energy);
  }

  void check_open_tree() {
    NodeWrenches<T> wrenches;
    for (std::size_t i = 0; i < case_.points.size(); ++i)
      wrenches.push_back({case_.points[i].body, case_.points[i].node, oracle::vector<T>(input()["node_wrenches"][i])});
    const VecX<T> tau = oracle::vector<T>(input()["tau"]);
    array("M", state_.M);
    array("bias", state_.bias);
    array("gravity_force", state_.gravity_force);
    array("elastic_force", state_.elastic_force);
    array("external_force", state_.external_force(wrenches));
    array("qdot", state_.qdot);
    scalar("kinetic_energy", state_.kinetic_energy);
    scalar("gravity_potential", state_.gravity_energy);
    scalar("elastic_energy", state_.elastic_energy);
    scalar("total_mass", state_.total_mass);
    array("com", state_.com);
    array("linear_momentum", state_.linear_momentum);
    array("angular_momentum_about_ground_origin", state_.angular_momentum);
    for (std::size_t k = 0; k < state_.bodies.size(); ++k) {
      array("body_poses/" + std::to_string(k) + "/R", state_.bodies[k].R);
      array("body_poses/" + std::to_string(k) + "/x", state_.bodies[k].x);
    }
    const VecX<T> vdot = check_vdot(state_.forward(tau, wrenches));
    check_nodes(vdot);
    if (input().contains("vdot_for_inverse_dynamics"))
      array("inverse_dynamics_tau", state_.inverse(oracle::vector<T>(input()["vdot_for_inverse_dynamics"]), wrenches));
    const std::vector<VecX<T>> hinge = state_.hinge_wrenches(vdot, wrenches);
    for (std::size_t k = 0; k < hinge.size(); ++k) array("hinge_wrench_on_body_at_pnode/" + std::to_string(k), hinge[k]);
    if (input().contains("hybrid")) check_hybrid(tau, wrenches);
  }

  bool by_residual() const { return case_.name == "37_gimbal_near_lock"; }
  VecX<T> check_vdot(const VecX<T>& vdot) {
    if (by_residual())
      judge("vdot", compare_.residual(vdot));
    else
      array("vdot", vdot);
    return vdot;
  }

  void check_nodes(const VecX<T>& vdot) {
    MatX<T> J(6 * case_.points.size(), state_.M.cols());
    for (std::size_t i = 0; i < case_.points.size(); ++i) {
      const NodeMotion<T> n = state_.node(case_.points[i].body, case_.points[i].node);
      const std::string at = "nodes/" + std::to_string(i) + "/";
      array(at + "x", n.x);
      array(at + "R", n.R);
      array(at + "velocity", n.velocity);
      array(at + "classical_acceleration", n.acceleration(vdot));
      array(at + "J", n.J);
      J.middleRows(6 * i, 6) = n.J;
    }
    if (J.rows() > 0) array("osi_nodes", J * Factor<T>(state_.M).solve(MatX<T>(J.transpose())));
  }

  void check_hybrid(const VecX<T>& tau, const NodeWrenches<T>& wrenches) {
    const json& hybrid = input()["hybrid"];
    const VecX<T> given = oracle::vector<T>(hybrid["prescribed_vdot"]);
    std::vector<bool> prescribed(tau.size(), false), free(tau.size(), true);
    VecX<T> vdot = VecX<T>::Zero(tau.size());
    std::vector<int> indices;
    for (std::size_t i = 0; i < hybrid["prescribed_v_indices"].size(); ++i) {
      indices.push_back(static_cast<int>(oracle::number<double>(hybrid["prescribed_v_indices"][i])));
      prescribed[indices.back()] = true;
      free[indices.back()] = false;
      vdot[indices.back()] = given[i];
    }
    const HybridResult<T> got = state_.hybrid(tau, prescribed, vdot, wrenches);
    if (by_residual())
      judge("hybrid/vdot", compare_.residual(got.vdot, free));
    else
      array("hybrid/vdot", got.vdot);
    array("hybrid/tau_prescribed", got.tau(indices));
  }

  const oracle::Case& case_;
  oracle::Comparator compare_;
  int level_;
  DenseTwin<T> twin_;
  DenseState<T> state_;
};

class TwinOracle : public ::testing::TestWithParam<std::filesystem::path> {
 protected:
  oracle::Case case_ = oracle::read(GetParam());
  std::vector<int> levels() const { return case_.schema == "cardan-oracle/1" ? std::vector<int>{2} : std::vector<int>{0, 1, 2}; }
};

class TwinOracleLevels : public TwinOracle {};

TEST_P(TwinOracle, DoubleReproducesTheFile) {
  for (const int level : levels())
    Evaluation<double>(case_, level, dense_model<double>(oracle::at_level(case_.spec, level), {{"custom_cam", custom_cam()}})).check_all();
}

TEST_P(TwinOracle, QuadReproducesAllItsDigits) {
  for (const int level : levels()) Evaluation<Quad>(case_, level, sharp_model<Quad>(case_, level)).check_all();
}

// With the integrals I1 ... I9 alone, as of a consistent-mass model: levels 0 and 1 are complete, level 2 takes rotary
// inertia to first order and so equals the file where there is none.
TEST_P(TwinOracleLevels, ComeFromIntegralsAlone) {
  bool rotary = false;
  for (BodySpec& b : case_.spec.bodies) {
    if (!b.modal) continue;
    auto bare = std::make_shared<ModalData>(*b.modal);
    bare->mass_nodes.clear();
    rotary = rotary || !bare->integrals.rotary_ww.empty();
    b.modal = bare;
  }
  for (const int level : levels())
    if (level < 2 || !rotary) Evaluation<double>(case_, level, dense_model<double>(oracle::at_level(case_.spec, level))).check_all();
}

std::vector<std::filesystem::path> open_trees(bool with_levels) {
  struct Tree {
    std::filesystem::path path;
    bool has_levels;
  };
  static const std::vector<Tree> trees = [] {  // read once in each process of a test
    std::vector<Tree> all;
    for (const auto& path : oracle::files())
      if (const oracle::Case c = oracle::read(path); !c.has_loops()) all.push_back({path, c.schema != "cardan-oracle/1"});
    return all;
  }();
  std::vector<std::filesystem::path> out;
  for (const Tree& tree : trees)
    if (tree.has_levels || !with_levels) out.push_back(tree.path);
  return out;
}
std::string name_of(const ::testing::TestParamInfo<std::filesystem::path>& info) { return info.param.stem().string(); }

INSTANTIATE_TEST_SUITE_P(Files, TwinOracle, ::testing::ValuesIn(open_trees(false)), name_of);
INSTANTIATE_TEST_SUITE_P(Files, TwinOracleLevels, ::testing::ValuesIn(open_trees(true)), name_of);

}  // namespace
}  // namespace cardan::reference
