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

/// [angular; linear], world axes.
peer::RootMap root_map(const peer::Root& root) {
  peer::RootMap map;
  map.T << root.R, Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero(), root.R;
  map.b.tail<3>() = root.R * root.omega.cross(root.velocity);
  return map;
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
      const peer::Velocities all(m, offset, m.has_free_root() ? root_map(peer::Root(s)) : peer::RootMap());
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

  std::vector<Call> analyses() override {
    const auto at = [this](int k) -> const Set& { return sets[static_cast<std::size_t>(k)]; };
    struct Nodes {
      SimTK::Array_<SimTK::MobilizedBodyIndex> bodies;
      SimTK::Array_<SimTK::Vec3> origins;
    };
    const auto nodes_of = [this](const std::vector<int>& list) {
      Nodes nodes;
      for (const int i : list)
        nodes.bodies.push_back(bodies[static_cast<std::size_t>(i)].getMobilizedBodyIndex()), nodes.origins.push_back(SimTK::Vec3(0.0));
      return nodes;
    };
    // J M^-1 J*, the columns of M^-1 J* one after the other.
    const auto compliance = [this](int k, const Nodes& nodes) {
      set(k);
      system.realize(state, SimTK::Stage::Position);
      matter.calcFrameJacobian(state, nodes.bodies, nodes.origins, jacobian);
      const Eigen::Map<const Eigen::MatrixXd> J(jacobian.getContiguousScalarData(), jacobian.nrow(), jacobian.ncol());
      responses.resize(m.nv, J.rows());
      row.resize(m.nv);
      for (Eigen::Index r = 0; r < J.rows(); ++r) {
        for (int i = 0; i < m.nv; ++i) row[i] = J(r, i);
        matter.multiplyByMInv(state, row, response);
        for (int i = 0; i < m.nv; ++i) responses(i, r) = response[i];
      }
      product.noalias() = J * responses;
    };
    const auto turned = [this](const std::vector<int>& list, const Eigen::MatrixXd& C) {
      std::vector<Eigen::Matrix3d> R;
      for (const int i : list) {
        const SimTK::Rotation& of = bodies[static_cast<std::size_t>(i)].getBodyRotation(state);
        R.emplace_back();
        for (int r = 0; r < 3; ++r)
          for (int c = 0; c < 3; ++c) R.back()(r, c) = of[r][c];
      }
      return peer::in_node_axes(C, R);
    };
    // It has no derivatives of its own: differences of realize(Acceleration), q along each u by its own N.
    const auto derivatives = [this, at](bool centred, int k) {
      const double h = centred ? 1e-5 : 1e-7;
      const SimTK::Vector q = at(k).q, u = at(k).u;
      const auto acceleration = [&]() -> const SimTK::Vector& {
        system.realize(state, SimTK::Stage::Acceleration);
        return state.getUDot();
      };
      a_q.resize(m.nv, m.nv), a_v.resize(m.nv, m.nv);
      set(k);
      applied.setAllMobilityForces(state, at(k).tau);
      a = eigen(acceleration());
      SimTK::Vector along(m.nv, 0.0);
      SimTK::Matrix rates(state.getNQ(), m.nv);
      for (int j = 0; j < m.nv; ++j) {
        SimTK::Vector rate;
        along[j] = 1.0;
        matter.multiplyByN(state, false, along, rate);
        along[j] = 0.0;
        for (int i = 0; i < rate.size(); ++i) rates(i, j) = rate[i];
      }
      const auto slope = [&](Eigen::MatrixXd& to, int j, const auto& move) {
        move(h);
        Eigen::VectorXd change = eigen(acceleration());
        if (centred) {
          move(-h);
          change -= eigen(acceleration());
        } else {
          change -= a;
        }
        to.col(j) = change / (centred ? 2.0 * h : h);
      };
      for (int j = 0; j < m.nv; ++j)
        slope(a_q, j, [&](double s) {
          for (int i = 0; i < state.getNQ(); ++i) state.updQ()[i] = q[i] + s * rates(i, j);
        });
      set(k);
      for (int j = 0; j < m.nv; ++j) {
        slope(a_v, j, [&](double s) { state.updU()[j] = u[j] + s; });
        state.updU()[j] = u[j];
      }
      system.realize(state, SimTK::Stage::Position);
      matter.calcMInv(state, matrix);
    };
    const auto our = [this, at](int k) {
      return peer::our_derivatives(m, m.states[static_cast<std::size_t>(k)], at(k).map, root_map, a, a_q, a_v, eigen(matrix));
    };
    const std::vector<int> ends = m.ends(), hand{m.hand()};
    return {
        {"node_compliance", "calcFrameJacobian + multiplyByMInv", [=, n = nodes_of(ends)](int k) { compliance(k, n); },
         [=, this](int) { return turned(ends, product); }},
        {"operational_inertia", "calcFrameJacobian + multiplyByMInv, inverted",
         [=, this, n = nodes_of(hand)](int k) {
           compliance(k, n);
           inertia = product.topLeftCorner<6, 6>().llt().solve(peer::Matrix6d::Identity());
         },
         [=, this](int) { return turned(hand, inertia); }},
        {"forward_derivatives", "differences of realize(Acceleration)", [=](int k) { derivatives(false, k); }, our},
        {"forward_derivatives", "centred differences of realize(Acceleration)", [=](int k) { derivatives(true, k); }, our},
    };
  }

  SimTK::Matrix jacobian;
  SimTK::Vector row, response;
  Eigen::MatrixXd responses, product, a_q, a_v;
  Eigen::VectorXd a;
  peer::Matrix6d inertia;
};

}  // namespace

int main(int argc, char** argv) {
  int major = 0, minor = 0, build = 0;
  SimTK_version_simbody(&major, &minor, &build);
  return peer::run(argc, argv, "simbody", std::to_string(major) + "." + std::to_string(minor),
                   [](const Model& m) { return std::make_unique<Simbody>(m); });
}
