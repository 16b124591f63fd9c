// Simbody: the recursive O(N) of its matter subsystem, stage by stage.
#include <Simbody.h>

#include "bench/peers/peer.hpp"

namespace {

using peer::Call;
using peer::Model;

SimTK::Vec3 vec3(const Eigen::Vector3d& x) { return {x[0], x[1], x[2]}; }
SimTK::Vector vector(const Eigen::VectorXd& x) { return {static_cast<int>(x.size()), x.data()}; }
Eigen::VectorXd eigen(const SimTK::Vector& x) {
  Eigen::VectorXd y(x.size());
  for (int i = 0; i < x.size(); ++i) y[i] = x[i];
  return y;
}
Eigen::MatrixXd eigen(const SimTK::Matrix& x) {
  Eigen::MatrixXd y(x.nrow(), x.ncol());
  for (int r = 0; r < x.nrow(); ++r)
    for (int c = 0; c < x.ncol(); ++c) y(r, c) = x(r, c);
  return y;
}
SimTK::Rotation rotation(const Eigen::Matrix3d& R) {
  return {SimTK::Mat33(R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)), true};
}

struct Simbody : peer::Peer {
  struct Set {
    SimTK::Vector q, u, tau, udot;
    peer::Velocities map;
  };
  const Model& m;
  SimTK::MultibodySystem system;
  SimTK::SimbodyMatterSubsystem matter{system};
  SimTK::GeneralForceSubsystem forces{system};
  SimTK::Force::DiscreteForces applied{forces, matter};
  SimTK::Force::Gravity gravity;
  std::vector<SimTK::MobilizedBody> bodies;
  SimTK::State state;
  std::vector<Set> sets;
  SimTK::Vector residual;
  SimTK::Matrix matrix;

  Simbody(const Model& model) : m(model), gravity(forces, matter, vec3(m.gravity)) {
    for (const peer::Body& b : m.bodies) {
      const Eigen::Matrix3d c = peer::cross_matrix(b.com);
      const Eigen::Matrix3d J = b.inertia - b.mass * c * c;  // about the body origin
      const SimTK::Body::Rigid body(
          SimTK::MassProperties(b.mass, vec3(b.com), SimTK::Inertia(J(0, 0), J(1, 1), J(2, 2), J(0, 1), J(0, 2), J(1, 2))));
      SimTK::MobilizedBody& parent = b.parent < 0 ? matter.updGround() : bodies[static_cast<std::size_t>(b.parent)];
      if (b.free) {
        bodies.push_back(SimTK::MobilizedBody::Free(parent, SimTK::Transform(), body, SimTK::Transform()));
      } else {  // a pin turns about the z axes of its two frames
        Eigen::Matrix3d Z;
        for (int i = 0; i < 3; ++i) Z.col(i) = Eigen::Vector3d::Unit((b.axis + 1 + i) % 3);
        bodies.push_back(
            SimTK::MobilizedBody::Pin(parent, SimTK::Transform(rotation(b.R * Z), vec3(b.p)), body, SimTK::Transform(rotation(Z))));
      }
    }
    state = system.realizeTopology();
    matter.setUseEulerAngles(state, false);
    system.realizeModel(state);
  }

  void set(int k) {
    state.updQ() = sets[static_cast<std::size_t>(k)].q;
    state.updU() = sets[static_cast<std::size_t>(k)].u;
  }

  std::vector<Call> calls() override {
    std::vector<int> offset;
    for (const auto& b : bodies) offset.push_back(b.getFirstUIndex(state));
    for (const peer::State& s : m.states) {
      peer::RootMap map;
      if (m.has_free_root()) {  // [angular; linear], world axes
        const peer::Root root(s);
        map.T << root.R, Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero(), root.R;
        map.b.tail<3>() = root.R * root.omega.cross(root.velocity);
      }
      const peer::Velocities all(m, offset, map);
      SimTK::Vector q(state.getNQ(), 0.0);  // of a free body: quaternion, then position
      for (std::size_t i = 0; i < m.bodies.size(); ++i) {
        const int from = m.bodies[i].q, to = bodies[i].getFirstQIndex(state);
        for (int j = 0; j < (m.bodies[i].free ? 7 : 1); ++j) q[to + j] = s.q[m.bodies[i].free ? from + (j + 3) % 7 : from];
      }
      sets.push_back({q, vector(all.velocity(s.v)), vector(all.force(s.tau)), vector(all.acceleration(s.vdot)), all});
    }
    const auto at = [this](int k) -> const Set& { return sets[static_cast<std::size_t>(k)]; };
    const auto given = [this](int k) -> const peer::State& { return m.states[static_cast<std::size_t>(k)]; };
    return {
        {"forward_dynamics", "realize(Acceleration)",
         [this, at](int k) {
           set(k);
           applied.setAllMobilityForces(state, at(k).tau);
           system.realize(state, SimTK::Stage::Acceleration);
         },
         [this, at](int k) { return at(k).map.our_acceleration(eigen(SimTK::Vector(state.getUDot()))); }},
        {"inverse_dynamics", "calcResidualForceIgnoringConstraints",
         [this, at](int k) {
           set(k);
           system.realize(state, SimTK::Stage::Velocity);
           matter.calcResidualForceIgnoringConstraints(state, SimTK::Vector(), gravity.getBodyForces(state), at(k).udot, residual);
         },
         [this, at](int k) { return at(k).map.our_force(eigen(residual)); }},
        {"mass_matrix", "calcM",
         [this](int k) {
           set(k);
           system.realize(state, SimTK::Stage::Position);
           matter.calcM(state, matrix);
         },
         [this, at, given](int k) { return at(k).map.mass_times(eigen(matrix), given(k).vdot); }},
        {"mass_matrix_inverse", "calcMInv",
         [this](int k) {
           set(k);
           system.realize(state, SimTK::Stage::Position);
           matter.calcMInv(state, matrix);
         },
         [this, at, given](int k) { return at(k).map.inverse_mass_times(eigen(matrix), given(k).tau); }},
    };
  }
};

}  // namespace

int main(int argc, char** argv) {
  int major = 0, minor = 0, build = 0;
  SimTK_version_simbody(&major, &minor, &build);
  return peer::run(argc, argv, "simbody", std::to_string(major) + "." + std::to_string(minor),
                   [](const Model& m) { return std::make_unique<Simbody>(m); });
}
