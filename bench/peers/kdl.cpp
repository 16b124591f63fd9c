// KDL of Orocos: serial chains on a fixed base only.
#include <kdl/chaindynparam.hpp>
#include <kdl/chainfdsolver_recursive_newton_euler.hpp>
#include <kdl/chainhdsolver_vereshchagin.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "bench/peers/peer.hpp"

namespace {

using namespace peer;

KDL::Vector vector(const Eigen::Vector3d& x) { return {x[0], x[1], x[2]}; }
KDL::Frame frame(const Body& b) {
  const Eigen::Matrix3d& R = b.R;
  return {KDL::Rotation(R(0, 0), R(0, 1), R(0, 2), R(1, 0), R(1, 1), R(1, 2), R(2, 0), R(2, 1), R(2, 2)), vector(b.p)};
}
KDL::JntArray joints(const Eigen::VectorXd& x) {
  KDL::JntArray y(static_cast<unsigned>(x.size()));
  y.data = x;
  return y;
}

/// A segment is a joint and, outboard of it, a fixed frame: that of the next body. Its inertia is given in that frame.
KDL::Chain chain_of(const Model& m) {
  if (m.has_free_root()) throw Refused("fixed bases only");
  if (!m.is_serial()) throw Refused("serial chains only");
  if (!m.bodies[0].R.isIdentity(0) || !m.bodies[0].p.isZero(0)) throw Refused("the first joint has to be at the origin");
  constexpr KDL::Joint::JointType type[] = {KDL::Joint::RotX, KDL::Joint::RotY, KDL::Joint::RotZ};
  KDL::Chain chain;
  for (std::size_t i = 0; i < m.bodies.size(); ++i) {
    const Body& b = m.bodies[i];
    const KDL::Frame tip = i + 1 < m.bodies.size() ? frame(m.bodies[i + 1]) : KDL::Frame::Identity();
    const Eigen::Matrix3d& J = b.inertia;
    const KDL::RigidBodyInertia inertia(b.mass, vector(b.com),
                                        KDL::RotationalInertia(J(0, 0), J(1, 1), J(2, 2), J(0, 1), J(0, 2), J(1, 2)));
    chain.addSegment(KDL::Segment(KDL::Joint(type[b.axis]), tip, tip.Inverse() * inertia));
  }
  return chain;
}

struct Kdl : Peer {
  struct Set {
    KDL::JntArray q, v, tau, vdot;
  };
  const Model& m;
  KDL::Chain chain;
  KDL::Vector gravity;
  KDL::ChainHdSolver_Vereshchagin hybrid;
  KDL::ChainFdSolver_RNE forward;
  KDL::ChainIdSolver_RNE inverse;
  KDL::ChainDynParam matrices;
  KDL::JntArray result, constraint_torque;
  KDL::JntSpaceInertiaMatrix mass;
  KDL::Jacobian constraints{1};  // of the tip: one that does nothing, fewer it does not take
  KDL::JntArray constraint_energy{1};
  KDL::Wrenches wrenches;
  std::vector<Set> sets;

  Kdl(const Model& model)
      : m(model),
        chain(chain_of(m)),
        gravity(vector(m.gravity)),
        hybrid(chain, KDL::Twist(-gravity, KDL::Vector::Zero()), 1),
        forward(chain, gravity),
        inverse(chain, gravity),
        matrices(chain, gravity),
        result(static_cast<unsigned>(m.nv)),
        constraint_torque(static_cast<unsigned>(m.nv)),
        mass(m.nv),
        wrenches(m.bodies.size(), KDL::Wrench::Zero()) {
    KDL::SetToZero(constraints);
  }

  std::vector<Call> calls() override {
    for (const State& s : m.states) sets.push_back({joints(s.q), joints(s.v), joints(s.tau), joints(s.vdot)});
    const auto at = [this](int k) -> const Set& { return sets[static_cast<std::size_t>(k)]; };
    const auto out = [this](int) -> Eigen::VectorXd { return result.data; };
    return {
        {"forward_dynamics", "ChainHdSolver_Vereshchagin",
         [this, at](int k) {
           const Set& s = at(k);
           hybrid.CartToJnt(s.q, s.v, result, constraints, constraint_energy, wrenches, s.tau, constraint_torque);
         },
         out},
        {"forward_dynamics", "ChainFdSolver_RNE",
         [this, at](int k) {
           const Set& s = at(k);
           forward.CartToJnt(s.q, s.v, s.tau, wrenches, result);
         },
         out},
        {"inverse_dynamics", "ChainIdSolver_RNE",
         [this, at](int k) {
           const Set& s = at(k);
           inverse.CartToJnt(s.q, s.v, s.vdot, wrenches, result);
         },
         out},
        {"mass_matrix", "ChainDynParam::JntToMass", [this, at](int k) { matrices.JntToMass(at(k).q, mass); },
         [this](int k) -> Eigen::VectorXd { return mass.data * m.states[static_cast<std::size_t>(k)].vdot; }},
    };
  }
};

}  // namespace

int main(int argc, char** argv) {
  return peer::run(argc, argv, "kdl", PEER_VERSION, [](const peer::Model& m) { return std::make_unique<Kdl>(m); });
}
