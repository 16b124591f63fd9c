// The sweeps against every reference vector (tests/reference/oracle/README.md): one program that takes a file, so that ctest
// has one case per file, found when it starts, also in the folder CARDAN_ORACLE_DIR. A field that a file of its schema must
// have and lacks fails, and so does one that it has and nobody looks at. The error of each field is appended to
// oracle_errors.txt in the build folder, or to the second argument.
#include <fmt/format.h>

#include <Eigen/Core>
#include <cstdio>
#include <fstream>
#include <set>

#include "bodies/register.hpp"
#include "core/abi/registry.hpp"
#include "core/dynamics/inverse.hpp"
#include "core/dynamics/loops.hpp"
#include "core/dynamics/observe.hpp"
#include "core/linalg/dense.hpp"
#include "core/model/loops.hpp"
#include "core/operators/apply.hpp"
#include "core/operators/diagonalised.hpp"
#include "core/operators/hybrid.hpp"
#include "core/operators/log_det.hpp"
#include "core/operators/sensitivity.hpp"
#include "core/operators/system_properties.hpp"
#include "hinges/register.hpp"
#include "tests/support/tolerance.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;

const Registry& registry() {
  static const Registry r = [] {
    Registry all;
    register_hinges(all);
    register_bodies(all);
    load_plugin(CARDAN_BINARY_DIR "/plugins/custom_cam.so", all);
    return all;
  }();
  return r;
}

class Check {
 public:
  explicit Check(const oracle::Case& c) : case_(c), compare_(c.json) {}

  void run() {
    if (case_.schema == "cardan-oracle/1" && case_.has_loops())
      tree(case_.spec), of_loops_ = true, loops_in_each_form(oracle::with_loops(case_));
    else if (case_.schema == "cardan-oracle/1")
      tree(case_.spec);
    else
      all_levels();
    unseen(case_.json.at("expected"), "");
  }

  int failures = 0, fields = 0;
  std::string report;

 private:
  void all_levels() {
    for (int level = 0; level < 3; ++level) {
      const std::string at = fmt::format("level{}/", level);
      const SystemSpec spec = oracle::at_level(case_.spec, level);
      case_.schema == "cardan-oracle-body/1" ? body(spec, at) : levels(spec, at);
    }
  }

  /// With loops, what contains v' is that of the closed system.
  bool of_closed_system(const std::string& field) const {
    return case_.has_loops() && !of_loops_ &&
           (field.find("vdot") != std::string::npos || field.find("acceleration") != std::string::npos ||
            field.rfind("hinge_wrench", 0) == 0 || field.rfind("hybrid", 0) == 0);
  }
  void fail(const std::string& field, const std::string& why) {
    ++failures;
    fmt::print("FAIL {} {}: {}\n", case_.name, field, why);
    report += fmt::format("{} {} {} FAIL\n", case_.name, field, why);
  }
  /// Whether the file has it, as it must.
  bool expects(const std::string& field) {
    if (of_closed_system(field)) return false;
    if (compare_.has(field)) return true;
    fail(field, "the file lacks it");
    return false;
  }
  /// Fields of the file, by their names without indices, that nothing was compared with.
  void unseen(const json& expected, const std::string& at) {
    for (const auto& [key, value] : expected.items()) {
      const std::string field = at + key;
      const bool elsewhere = key == "integrals" || key == "dM_fl_deta" ||  // test_modal
                             key == "residual_max" || key == "independent_rows" || key == "osi" ||
                             key == "gamma";  // follow from the others
      if (elsewhere || seen_.contains(field) || of_closed_system(field) || key == "derivative_point_vdot") continue;
      if (value.is_object())
        unseen(value, field + "/");
      else
        fail(field, "nothing is compared with it");
    }
  }
  void judge(const std::string& field, double error) {
    const double limit = oracle::reachable(case_.name, field);
    ++fields;
    const bool ok = error <= limit;
    const std::string what = form_.empty() ? field : form_ + ":" + field;
    if (!ok) {
      ++failures;
      fmt::print("FAIL {} {}: error {:.2e}, limit {:.0e}\n", case_.name, what, error, limit);
    }
    report += fmt::format("{} {} {:.3e} {:.0e} {}\n", case_.name, what, error, limit, ok ? "pass" : "FAIL");
  }
  template <class Derived>
  void array(const std::string& field, const Eigen::MatrixBase<Derived>& got) {
    if (!expects(field)) return;
    seen(field);
    judge(field, compare_.error(field, got));
  }
  void scalar(const std::string& field, double got) {
    if (!expects(field)) return;
    seen(field);
    judge(field, compare_.scalar_error(field, got));
  }
  /// "nodes/2/velocity" looks at the field "nodes".
  void seen(const std::string& field) {
    const std::size_t digit = field.find_first_of("0123456789", field.rfind("level", 0) == 0 ? 6 : 0);
    seen_.insert(digit == std::string::npos || field[digit - 1] != '/' ? field : field.substr(0, digit - 1));
  }
  json input(const char* field) const {
    return case_.json.contains("input") && case_.json["input"].contains(field) ? case_.json["input"][field] : json();
  }

  // M and bias of one body: B = P on free_body, so that M_fl is the mass matrix. The file's bias is the textbook one;
  // the system's bias is the same in both forms.
  void body(const SystemSpec& spec, const std::string& at) {
    const auto model = compile(spec, registry());
    Workspace ws(*model);
    array(at + "M_fl", mass_matrix(*model, ws, case_.q.data()));
    array(at + "bias", bias_force(*model, ws, case_.q.data(), case_.v.data()));
  }

  void levels(const SystemSpec& spec, const std::string& at) {
    const auto model = compile(spec, registry());
    Workspace ws(*model);
    const double *q = case_.q.data(), *v = case_.v.data();
    array(at + "M", mass_matrix(*model, ws, q));
    array(at + "bias", bias_force(*model, ws, q, v));
    array(at + "gravity_force", gravity_force(*model, ws, q));
    array(at + "elastic_force", elastic_force(*model, q, v));
    VectorXd vdot(model->nv);
    Inputs in;
    in.q = q, in.v = v, in.tau = case_.tau.data();
    run_forward(*model, ws, in, vdot);
    array(at + "vdot", vdot);
    Observer observer(*model, ws);
    observer.update(in, vdot.data());
    scalar(at + "kinetic_energy", observer.energy().kinetic);
  }

  void run_forward(const Model& model, Workspace& ws, const Inputs& in, VectorXd& vdot) {
    if (forward_dynamics(model, ws, in, vdot.data())) return;
    ++failures;
    fmt::print("FAIL {}: {}\n", case_.name, render(describe_breakdown(model, ws.breakdown, 0.0)));
    vdot.setConstant(std::nan(""));
  }

  void loops_in_each_form(SystemSpec spec) {
    for (const LoopForm form : {LoopForm::embedding, LoopForm::multipliers, LoopForm::dae}) {
      spec.loop_form = form;
      form_ = loop_forms()[static_cast<std::size_t>(form)];
      loops(spec);
    }
    form_.clear();
  }

  // What the loops change: v', accelerations, hinge forces; G, multipliers and rank, in the rows of the file.
  void loops(const SystemSpec& spec) {
    const auto model = compile(spec, registry());
    Workspace ws(*model);
    std::vector<NodeWrench> wrenches;
    for (const auto& p : case_.points) wrenches.push_back({model->find_node(p.body + "." + p.node), false, force(p.wrench.data())});
    const Inputs in{.q = case_.q.data(), .v = case_.v.data(), .tau = case_.tau.data(), .wrenches = wrenches};
    VectorXd vdot(model->nv);
    run_forward(*model, ws, in, vdot);
    array("vdot", vdot);
    Observer observer(*model, ws);
    observer.update(in, vdot.data());
    for (std::size_t i = 0; i < wrenches.size(); ++i)
      array(fmt::format("nodes/{}/classical_acceleration", i), observer.node(wrenches[i].node).acceleration);

    const LoopForces forces = loop_forces(ws);
    const VectorXd lambda = Eigen::Map<const VectorXd>(forces.multipliers.data(), model->loops.rows);
    const MatrixXd T = rows_of_file(*model, observer, forces), G = T * loop_matrix(*model, ws, in.q);
    array("constraints/G", G);
    array("constraints/lambda_min_norm", VectorXd(lu_solve(T.transpose(), lambda).x));
    const int rank = loop_rank(*model, ws, in.q).rank;
    scalar("constraints/rank", rank);
    scalar("constraints/mobility", model->nv - rank);
  }

  // Rows of the file = T (rows of the sweeps).
  MatrixXd rows_of_file(const Model& model, const Observer& observer, const LoopForces& forces) const {
    MatrixXd T = MatrixXd::Zero(model.loops.rows, model.loops.rows);
    for (std::size_t l = 0; l < model.loops.all.size(); ++l) {
      const Loop& loop = model.loops.all[l];
      const std::string type = case_.json["constraints"][l]["type"];
      const Eigen::Matrix3d R = loop.from.node >= 0 ? observer.node(loop.from.node).R_WN : to_eigen(loop.from.pose.R);
      MatrixXd W = MatrixXd::Zero(6, loop.rows);  // on the end B, axes of A, per row of the file
      const auto point = [&](int at) { W.block<3, 3>(3, at) = R.transpose(); };
      if (type == "point") point(0);
      if (type == "weld") W.topLeftCorner<3, 3>().setIdentity(), point(3);
      if (type == "hinge") W(1, 0) = 1.0, W(0, 1) = -1.0, point(2);
      if (type == "slider") W(3, 0) = W(4, 1) = 1.0;
      for (int i = 0; i < loop.rows; ++i)
        for (int j = 0; j < loop.rows; ++j)
          T(loop.first + i, loop.first + j) = W.col(i).dot(to_eigen(forces.unit[static_cast<std::size_t>(loop.first + j)]));
      if (type == "distance") T(loop.first, loop.first) = loop.length;
      if (type == "coupling") T(loop.first, loop.first) = 1.0;
    }
    return T;
  }

  void tree(const SystemSpec& spec) {
    const auto model = compile(spec, registry());
    Workspace ws(*model);
    const double *q = case_.q.data(), *v = case_.v.data();
    std::vector<NodeWrench> wrenches;
    std::vector<int> nodes;
    for (const auto& p : case_.points) {
      nodes.push_back(model->find_node(p.body + "." + p.node));
      NodeWrench w;
      w.node = nodes.back();
      w.f = force(p.wrench.data());
      wrenches.push_back(w);
    }
    array("M", mass_matrix(*model, ws, q));
    array("bias", bias_force(*model, ws, q, v));
    array("gravity_force", gravity_force(*model, ws, q));
    array("elastic_force", elastic_force(*model, q, v));
    array("external_force", external_force(*model, ws, q, wrenches));
    VectorXd qdot(model->nq);
    model->qdot(q, v, qdot.data());
    array("qdot", qdot);

    Inputs in;
    in.q = q, in.v = v, in.tau = case_.tau.data(), in.wrenches = wrenches;
    if (!case_.has_loops()) {
      const VectorXd vdot = oracle::vector<double>(input("vdot_for_inverse_dynamics"));
      VectorXd tau(model->nv);
      Inputs inverse = in;
      inverse.vdot = vdot.data();
      inverse_dynamics(*model, ws, inverse, tau.data());
      array("inverse_dynamics_tau", tau);
    }
    VectorXd vdot(model->nv);
    run_forward(*model, ws, in, vdot);
    if (case_.name == "37_gimbal_near_lock")
      seen("vdot"), judge("vdot", compare_.residual(vdot));
    else
      array("vdot", vdot);
    Observer observer(*model, ws);
    observer.update(in, vdot.data());
    const Energy energy = observer.energy();
    scalar("kinetic_energy", energy.kinetic);
    scalar("gravity_potential", energy.gravity);
    scalar("elastic_energy", energy.modal);
    const Momentum momentum = observer.momentum();
    array("linear_momentum", momentum.linear);
    array("angular_momentum_about_ground_origin", momentum.angular);
    scalar("total_mass", momentum.mass);
    array("com", momentum.com);
    for (std::size_t k = 0; k < model->user.size(); ++k) {
      const Pose<double> pose = observer.body_pose(static_cast<int>(k));
      array(fmt::format("body_poses/{}/R", k), to_eigen(pose.R));
      array(fmt::format("body_poses/{}/x", k), to_eigen(pose.p));
      array(fmt::format("hinge_wrench_on_body_at_pnode/{}", k), to_eigen(observer.hinge_wrench(static_cast<int>(k))));
    }
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const NodeState n = observer.node(nodes[i]);
      array(fmt::format("nodes/{}/x", i), n.position);
      array(fmt::format("nodes/{}/R", i), n.R_WN);
      array(fmt::format("nodes/{}/velocity", i), n.velocity);
      array(fmt::format("nodes/{}/classical_acceleration", i), n.acceleration);
    }
    operators(model, nodes);
    hybrid(in);
    derivatives(model, in);
    diagonalised(model, in);
  }

  // Along every component: of M by the operator expression, of log det M, of the forces of inverse dynamics.
  void derivatives(const std::shared_ptr<const Model>& model, const Inputs& in) {
    if (model->nv > 9) return;  // then the files have none
    operators::TreeOperators tree(model);
    tree.at(in.q);
    tree.articulate();
    tree.operational_space();
    array("grad_log_det_M", operators::log_det_gradient(tree));
    VectorXd unit = VectorXd::Zero(model->nv);
    for (int i = 0; i < model->nv; ++i) {
      unit[i] = 1.0;
      tree.along(unit.data());
      array(fmt::format("dM_dtheta/{}", i), operators::dense(operators::letters::mass_derivative, tree));
      unit[i] = 0.0;
    }
    const VectorXd vdot = oracle::vector<double>(compare_.at("derivative_point_vdot"));
    Inputs point = in;
    point.vdot = vdot.data(), point.wrenches = {};
    operators::Sensitivities sensitivities(model);
    sensitivities.at(point);
    const operators::InverseDerivatives d = sensitivities.inverse();
    array("dtau_dtheta", d.q);
    array("dtau_dv", d.v);
  }

  void diagonalised(const std::shared_ptr<const Model>& model, const Inputs& in) {
    operators::TreeOperators tree(model);
    tree.at(in.q);
    tree.articulate();
    operators::Diagonalised form(tree);
    const VectorXd nu = form.from_velocity(case_.v), C = form.coriolis(case_.v);
    array("diagonalised/nu", nu);
    array("diagonalised/C", C);
    array("diagonalised/epsilon_for_tau", form.eps(case_.tau));
    scalar("diagonalised/power_nuC", nu.dot(C));
  }

  // The operators at q, their analyses and what the file knows of them.
  void operators(const std::shared_ptr<const Model>& model, const std::vector<int>& nodes) {
    operators::TreeOperators tree(model);
    tree.at(case_.q.data());
    tree.articulate();
    tree.operational_space();
    std::vector<int> moving;  // nodes that are fixed to the ground have no rows of their own
    std::vector<Eigen::Index> rows;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (model->nodes[static_cast<std::size_t>(nodes[i])].sweep == 0) continue;
      moving.push_back(nodes[i]);
      for (std::size_t r = 0; r < 6; ++r) rows.push_back(static_cast<Eigen::Index>(6 * i + r));
    }
    MatrixXd osi = MatrixXd::Zero(6 * static_cast<Eigen::Index>(nodes.size()), 6 * static_cast<Eigen::Index>(nodes.size()));
    osi(rows, rows) = operators::compliance(tree, moving);
    array("osi_nodes", osi);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const std::string field = fmt::format("nodes/{}/J", i);
      if (model->nodes[static_cast<std::size_t>(nodes[i])].sweep > 0) array(field, operators::task_jacobian(tree, {{nodes[i]}, {}}));
    }
    scalar("log_det_M", tree.log_det());
    for (std::size_t k = 0; k < model->user.size(); ++k) {
      const UserBody& u = model->user[k];
      if (u.merged || u.nv + u.n_modes == 0) continue;
      array(fmt::format("D_blocks/{}", k), tree.D(tree.index_of(u.sweep)));
    }
    const operators::MassProperties whole = operators::mass_properties(tree);
    scalar("total_mass", whole.mass);
    array("com", whole.com);
    const Vector6d h = operators::momentum(tree, operators::About::world_origin, case_.v);
    array("linear_momentum", h.tail<3>());
    array("angular_momentum_about_ground_origin", h.head<3>());
  }

  // Some components follow a given motion, the others are free: their forces come out.
  void hybrid(const Inputs& free_in) {
    if (case_.has_loops() || case_.v.size() < 2) return;  // of one component nothing is left when it is prescribed
    const json h = input("hybrid");
    SystemSpec spec = case_.spec;
    const VectorXd given = oracle::vector<double>(h["prescribed_vdot"]);
    VectorXd vdot_in = VectorXd::Zero(case_.v.size());
    const auto whole = compile(spec, registry());
    std::vector<int> indices;
    for (std::size_t i = 0; i < h["prescribed_v_indices"].size(); ++i) {
      const int index = static_cast<int>(oracle::number<double>(h["prescribed_v_indices"][i]));
      indices.push_back(index);
      vdot_in[index] = given[static_cast<Eigen::Index>(i)];
      for (std::size_t k = 0; k < spec.bodies.size(); ++k) {
        const UserBody& u = whole->user[k];
        if (index >= u.v && index < u.v + u.nv) spec.bodies[k].hinge.prescribed.push_back(index - u.v);
        if (index >= u.etadot && index < u.etadot + u.n_modes) spec.bodies[k].prescribed_modes.push_back(index - u.etadot);
      }
    }
    const auto model = compile(spec, registry());
    Workspace ws(*model);
    Inputs in = free_in;
    in.vdot = vdot_in.data();
    VectorXd vdot(model->nv), tau(model->nv);
    run_forward(*model, ws, in, vdot);
    if (case_.name == "37_gimbal_near_lock") {
      std::vector<bool> free(static_cast<std::size_t>(model->nv), true);
      for (const int i : indices) free[static_cast<std::size_t>(i)] = false;
      seen("hybrid/vdot"), judge("hybrid/vdot", compare_.residual(vdot, free));
    } else {
      array("hybrid/vdot", vdot);
    }
    Observer observer(*model, ws);
    observer.update(in, vdot.data());
    observer.prescribed_forces(tau.data());
    VectorXd got(static_cast<Eigen::Index>(indices.size()));
    for (std::size_t i = 0; i < indices.size(); ++i) got[static_cast<Eigen::Index>(i)] = tau[indices[i]];
    array("hybrid/tau_prescribed", got);
    by_operators(free_in, indices, vdot_in);
  }

  // The same with the mask given to the operators of the free system.
  void by_operators(const Inputs& in, const std::vector<int>& given, const VectorXd& vdot) {
    const auto model = compile(case_.spec, registry());
    operators::TreeOperators tree(model);
    tree.at(case_.q.data());
    std::vector<std::uint8_t> mask(static_cast<std::size_t>(model->nv), 1);
    std::vector<bool> free(mask.size(), true);
    for (const int i : given) mask[static_cast<std::size_t>(i)] = 0, free[static_cast<std::size_t>(i)] = false;
    tree.articulate({.free = mask});
    Workspace ws(*model);
    const operators::Hybrid out = operators::hybrid_dynamics(tree, operators::bias(tree, ws, in), case_.tau, vdot);
    judge("hybrid_by_operators/vdot",
          case_.name == "37_gimbal_near_lock" ? compare_.residual(out.vdot, free) : compare_.error("hybrid/vdot", out.vdot));
    judge("hybrid_by_operators/tau_prescribed", compare_.error("hybrid/tau_prescribed", VectorXd(out.tau(given))));
  }

  const oracle::Case& case_;
  oracle::Comparator compare_;
  std::set<std::string> seen_;
  bool of_loops_ = false;
  std::string form_;  // of `loop_form`, while loops are closed by it
};

int run(const char* path, const char* report) {
  const oracle::Case c = oracle::read(path);
  Check check(c);
  check.run();
  std::ofstream(report, std::ios::app) << check.report;
  fmt::print("{}: {} fields, {} failed\n", c.name, check.fields, check.failures);
  return check.failures > 0 || check.fields == 0 ? 1 : 0;
}

}  // namespace
}  // namespace cardan

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::fprintf(stderr, "usage: oracle_check FILE.json [REPORT]\n");
    return 2;
  }
  try {
    return cardan::run(argv[1], argc > 2 ? argv[2] : CARDAN_BINARY_DIR "/oracle_errors.txt");
  } catch (const std::exception& e) {
    fmt::print("FAIL {}: {}\n", argv[1], e.what());
    return 1;
  }
}
