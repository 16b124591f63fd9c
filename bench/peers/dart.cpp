// DART: articulated bodies on a skeleton.
#include <dart/config.hpp>
#include <dart/dynamics/BodyNode.hpp>
#include <dart/dynamics/FreeJoint.hpp>
#include <dart/dynamics/RevoluteJoint.hpp>
#include <dart/dynamics/Skeleton.hpp>

#include "bench/peers/peer.hpp"

namespace {

using namespace peer;
using namespace dart::dynamics;

Eigen::Isometry3d pose(const Eigen::Matrix3d& R, const Eigen::Vector3d& p) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() = R;
  X.translation() = p;
  return X;
}

struct Dart : Peer {
  struct Set {
    Eigen::VectorXd q, v, tau, vdot;
    Velocities map;
  };
  const Model& m;
  SkeletonPtr skeleton = Skeleton::create();
  std::vector<int> offset;
  std::vector<Set> sets;

  Dart(const Model& model) : m(model) {
    skeleton->setGravity(m.gravity);
    std::vector<BodyNode*> bodies;
    std::vector<Joint*> joints;
    for (std::size_t i = 0; i < m.bodies.size(); ++i) {
      const Body& b = m.bodies[i];
      const std::string name = std::to_string(i);
      BodyNode* parent = b.parent < 0 ? nullptr : bodies[static_cast<std::size_t>(b.parent)];
      if (b.free) {
        const auto [joint, body] = skeleton->createJointAndBodyNodePair<FreeJoint>(parent);
        joints.push_back(joint), bodies.push_back(body);
      } else {
        const auto [joint, body] = skeleton->createJointAndBodyNodePair<RevoluteJoint>(parent);
        joint->setAxis(Eigen::Vector3d::Unit(b.axis));
        joints.push_back(joint), bodies.push_back(body);
      }
      joints[i]->setName("joint " + name);
      joints[i]->setTransformFromParentBodyNode(pose(b.R, b.p));
      bodies[i]->setName("body " + name);
      bodies[i]->setInertia(Inertia(b.mass, b.com, b.inertia));
    }
    for (const Joint* joint : joints) offset.push_back(static_cast<int>(joint->getIndexInSkeleton(0)));
  }

  std::vector<Call> calls() override {
    const Velocities map(m, offset);  // its free joint has [angular; linear] in body axes as well
    for (const State& s : m.states) {
      Eigen::VectorXd q(m.nv);  // the rotation of a free joint as a vector
      for (std::size_t i = 0; i < m.bodies.size(); ++i) {
        if (m.bodies[i].free) {
          const Root root(s);
          q.segment<6>(offset[i]) = FreeJoint::convertToPositions(pose(root.R, root.position));
        } else {
          q[offset[i]] = s.q[m.bodies[i].q];
        }
      }
      sets.push_back({q, map.velocity(s.v), map.force(s.tau), map.acceleration(s.vdot), map});
    }
    const auto at = [this](int k) -> const Set& { return sets[static_cast<std::size_t>(k)]; };
    const auto given = [this](int k) -> const State& { return m.states[static_cast<std::size_t>(k)]; };
    return {
        {"forward_dynamics", "computeForwardDynamics",
         [this, at](int k) {
           skeleton->setPositions(at(k).q);
           skeleton->setVelocities(at(k).v);
           skeleton->setForces(at(k).tau);
           skeleton->computeForwardDynamics();
         },
         [this, at](int k) { return at(k).map.our_acceleration(skeleton->getAccelerations()); }},
        {"inverse_dynamics", "computeInverseDynamics",
         [this, at](int k) {
           skeleton->setPositions(at(k).q);
           skeleton->setVelocities(at(k).v);
           skeleton->setAccelerations(at(k).vdot);
           skeleton->computeInverseDynamics();
         },
         [this, at](int k) { return at(k).map.our_force(skeleton->getForces()); }},
        {"mass_matrix", "getMassMatrix",
         [this, at](int k) {
           skeleton->setPositions(at(k).q);
           skeleton->getMassMatrix();
         },
         [this, at, given](int k) { return at(k).map.mass_times(skeleton->getMassMatrix(), given(k).vdot); }},
        {"mass_matrix_inverse", "getInvMassMatrix",
         [this, at](int k) {
           skeleton->setPositions(at(k).q);
           skeleton->getInvMassMatrix();
         },
         [this, at, given](int k) { return at(k).map.inverse_mass_times(skeleton->getInvMassMatrix(), given(k).tau); }},
    };
  }
};

}  // namespace

int main(int argc, char** argv) {
  return peer::run(argc, argv, "dart", DART_VERSION, [](const peer::Model& m) { return std::make_unique<Dart>(m); });
}
