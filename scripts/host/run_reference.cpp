// --check-against-reference: v' of the sweeps against the dense twin, which shares no formula with them.
#include "core/reference/dense_dynamics.hpp"
#include "scripts/host/run_mission.hpp"

namespace cardan {
namespace {

using reference::ForeignHinge;
using reference::ForeignHinges;
using reference::ForeignMotion;

/// A hinge type that the twin does not know, by the kinematics of its family: one link of the chain is not independent
/// then.
ForeignHinges foreign_hinges(const Model& m) {
  ForeignHinges all;
  for (std::size_t i = 0; i < m.user.size(); ++i) {
    const UserBody& u = m.user[i];
    if (reference::hinge_size(u.hinge_type).nq >= 0) continue;
    // Instances of one type differ in their parameters: found again by the place of their description.
    const auto motion = [&m](const HingeSpec& hinge, const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
      std::size_t at = 0;
      while (m.spec->bodies[at].hinge.at.key_path != hinge.at.key_path) ++at;
      const UserBody& user = m.user[at];
      cardan_hinge_out out{};
      const std::uint32_t zero = 0;
      user.hinge->kinematics(user.hinge_packed.data(), 1, &zero, &zero, q.data(), v.data(), &out);
      ForeignMotion f;
      f.R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.R_OP);
      f.p = Eigen::Map<const Eigen::Vector3d>(out.p_OP);
      f.Ht = Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(out.Ht, 6, user.hinge->nv);
      f.Hdot_v = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(out.Hdot_v);
      f.qdot.resize(user.hinge->nq);
      user.hinge->qdot(user.hinge_packed.data(), q.data(), v.data(), f.qdot.data());
      return f;
    };
    all[u.hinge_type] = ForeignHinge{static_cast<int>(u.hinge->nq), static_cast<int>(u.hinge->nv), motion};
  }
  return all;
}

/// Largest |v' - v'_twin| over the largest |v'| that any one force (gravity, velocity terms, springs, modes, commands)
/// causes by itself: v' may be small because large forces cancel, and rounding is of the size of each of them.
double difference(Scenario& s, const reference::DenseTwin<double>& twin) {
  if (s.model->nv == 0) return 0.0;  // nothing can move
  Simulation& sim = *s.sim;
  const Model& m = *s.model;
  const reference::DenseState<double> state = twin.at(sim.state().q, sim.state().v);
  const Observer& observer = sim.observe();
  Eigen::VectorXd tau(m.nv);
  for (int i = 0; i < m.nv; ++i) tau[i] = sim.force(i);
  reference::NodeWrenches<double> wrenches;
  for (const NodeWrench& w : sim.wrenches()) {
    const UserNode& node = m.nodes[static_cast<std::size_t>(w.node)];
    const std::string& body = m.user[static_cast<std::size_t>(node.body)].name;
    Eigen::VectorXd f = to_eigen(w.f);
    if (w.world_axes) {
      const Eigen::Matrix3d R = observer.node(w.node).R_WN.transpose();
      f << R * f.head<3>(), R * f.tail<3>();
    }
    wrenches.push_back({body, node.name == body ? "" : node.name.substr(body.size() + 1), f});
  }
  const Eigen::VectorXd& vdot = sim.vdot();
  std::vector<bool> prescribed(static_cast<std::size_t>(m.nv), false);
  for (std::size_t i = 0; i < m.prescribed.size(); ++i) prescribed[i] = m.prescribed[i] != 0;
  const Eigen::VectorXd reference = state.hybrid(tau, prescribed, vdot, wrenches).vdot;

  double scale = vdot.cwiseAbs().maxCoeff();
  const Eigen::LLT<Eigen::MatrixXd> M(state.M);
  for (const Eigen::VectorXd& force :
       {tau, state.bias, state.gravity_force, state.elastic_force, state.hinge_force, state.external_force(wrenches)})
    scale = std::max(scale, M.solve(force).cwiseAbs().maxCoeff());
  return scale > 0 ? (vdot - reference).cwiseAbs().maxCoeff() / scale : 0.0;
}

}  // namespace

Output reference_output(Scenario& s) {
  const auto twin = std::make_shared<reference::DenseTwin<double>>(*s.model->spec, foreign_hinges(*s.model));
  return {{"reference/difference", {"difference"}, "1", "", "largest difference of v' from the dense twin, relative"},
          [&s, twin](double* x) { *x = difference(s, *twin); }};
}

}  // namespace cardan
