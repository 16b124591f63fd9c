// Bullet: btMultiBody in double precision, articulated bodies. Forward dynamics alone: Debian's package leaves out the headers of
// its inverse dynamics.
#include <BulletDynamics/Featherstone/btMultiBody.h>

#include "bench/peers/peer.hpp"

namespace {

using namespace peer;

btVector3 vector(const Eigen::Vector3d& x) { return {x[0], x[1], x[2]}; }
btQuaternion quaternion(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  return {q.x(), q.y(), q.z(), q.w()};
}

/// Link frames lie in the mass centre, along the principal axes. A free root is Bullet's base; else the base is fixed.
struct Bullet : Peer {
  struct Set {
    btVector3 position, omega, velocity, force, torque;  // of a free base: mass centre, world axes
    btQuaternion world_to_base;
    Velocities map;
  };
  const Model& m;
  int base;  // number of bodies in the base
  std::unique_ptr<btMultiBody> mb;
  std::vector<Eigen::Matrix3d> axes;  // principal to body axes
  std::vector<Set> sets;
  btAlignedObjectArray<btScalar> scratch_r;
  btAlignedObjectArray<btVector3> scratch_v;
  btAlignedObjectArray<btMatrix3x3> scratch_m;

  Bullet(const Model& model) : m(model), base(model.has_free_root() ? 1 : 0) {
    std::vector<Eigen::Vector3d> moments;
    for (const Body& b : m.bodies) {
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(b.inertia);
      axes.push_back(principal.eigenvectors());
      if (axes.back().determinant() < 0) axes.back().col(0) *= -1;
      moments.push_back(principal.eigenvalues());
    }
    mb = std::make_unique<btMultiBody>(static_cast<int>(m.bodies.size()) - base, base ? m.bodies[0].mass : 0.0,
                                       base ? vector(moments[0]) : btVector3(0, 0, 0), !base, false);
    for (std::size_t i = static_cast<std::size_t>(base); i < m.bodies.size(); ++i) {
      const Body& b = m.bodies[i];
      const bool root = b.parent < 0;
      const Eigen::Matrix3d parent_axes = root ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : axes[static_cast<std::size_t>(b.parent)];
      const Eigen::Vector3d parent_com = root ? Eigen::Vector3d(0, 0, 0) : m.bodies[static_cast<std::size_t>(b.parent)].com;
      mb->setupRevolute(static_cast<int>(i) - base, b.mass, vector(moments[i]), b.parent - base,
                        quaternion((parent_axes.transpose() * b.R * axes[i]).transpose()), vector(axes[i].row(b.axis).transpose()),
                        vector(parent_axes.transpose() * (b.p - parent_com)), vector(axes[i].transpose() * b.com), true);
    }
    mb->finalizeMultiDof();
    mb->setLinearDamping(0);
    mb->setAngularDamping(0);
    mb->setUseGyroTerm(true);
    mb->setMaxCoordinateVelocity(1e300);
    weigh();
  }

  void weigh() {
    mb->clearForcesAndTorques();
    for (std::size_t i = static_cast<std::size_t>(base); i < m.bodies.size(); ++i)
      mb->addLinkForce(static_cast<int>(i) - base, vector(m.bodies[i].mass * m.gravity));
  }

  void forward_dynamics(int k) {
    const Set& set = sets[static_cast<std::size_t>(k)];
    const State& s = m.states[static_cast<std::size_t>(k)];
    if (base) {
      mb->setBasePos(set.position);
      mb->setWorldToBaseRot(set.world_to_base);
      mb->setBaseOmega(set.omega);
      mb->setBaseVel(set.velocity);
      weigh();
      mb->addBaseForce(set.force);
      mb->addBaseTorque(set.torque);
    }
    for (std::size_t i = static_cast<std::size_t>(base); i < m.bodies.size(); ++i) {
      const int link = static_cast<int>(i) - base;
      mb->setJointPosMultiDof(link, s.q.data() + m.bodies[i].q);
      mb->setJointVelMultiDof(link, s.v.data() + m.bodies[i].v);
      mb->getLink(link).m_jointTorque[0] = s.tau[m.bodies[i].v];
    }
    // A step of 1 s: it adds v' to v. No velocity of the step before is left, all are set above.
    mb->computeAccelerationsArticulatedBodyAlgorithmMultiDof(1.0, scratch_r, scratch_v, scratch_m, false, false, false);
  }

  std::vector<Call> calls() override {
    std::vector<int> offset;
    for (const Body& b : m.bodies) offset.push_back(b.v);
    for (const State& s : m.states) {
      RootMap map;
      if (!base) {
        sets.push_back({{}, {}, {}, {}, {}, {}, Velocities(m, offset)});
        continue;
      }
      const Root root(s);  // [angular; linear of the mass centre], world axes
      const Body& b = m.bodies[0];
      map.T << root.R, Eigen::Matrix3d::Zero(), -root.R * cross_matrix(b.com), root.R;
      map.b.tail<3>() = root.R * root.omega.cross(root.velocity + root.omega.cross(b.com));
      const Velocities all(m, offset, map);
      const Vector6d v = all.velocity(s.v).head<6>(), f = all.force(s.tau).head<6>();
      sets.push_back({vector(root.position + root.R * b.com), vector(v.head<3>()), vector(v.tail<3>()),
                      vector(f.tail<3>() + b.mass * m.gravity), vector(f.head<3>()), quaternion((root.R * axes[0]).transpose()), all});
    }
    return {{"forward_dynamics", "computeAccelerationsArticulatedBodyAlgorithm", [this](int k) { forward_dynamics(k); },
             [this](int k) {
               // v' itself, base first, is left in the scratch behind one number per hinge; a fixed base has six zeros there
               const double* vdot = &scratch_r[mb->getNumDofs() + (base ? 0 : 6)];
               return sets[static_cast<std::size_t>(k)].map.our_acceleration(Eigen::Map<const Eigen::VectorXd>(vdot, m.nv));
             }}};
  }
};

}  // namespace

int main(int argc, char** argv) {
  const std::string version = std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100) + " float64";
  return peer::run(argc, argv, "bullet", version, [](const peer::Model& m) { return std::make_unique<Bullet>(m); });
}
