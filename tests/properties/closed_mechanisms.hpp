#pragma once
// Mechanisms with closed loops: random trees whose outermost hinges close loops instead, and chains of loops that share links, rigid and
// such that bend.
#include "bodies/modal/lumped.hpp"
#include "tests/properties/trees.hpp"

namespace cardan::test {

/// Bodies that nothing hangs on fly freely, and their hinges close loops. Without springs, stops and forces on those hinges. Their place is
/// told from the ground (0), from the body that the hinge is on (1), from that inboard of it (2).
struct Cut {
  RandomTree tree, closed;
  std::vector<std::string> bodies;
};
inline Cut cut(const RandomTree& given, unsigned from = 0) {
  Cut out{given, {}, {}};
  const auto carries = [&](const std::string& name) {
    return std::ranges::any_of(given.spec.bodies, [&](const BodySpec& b) { return b.hinge.inboard_body == name; });
  };
  for (BodySpec& b : out.tree.spec.bodies) {
    if (carries(b.name) || b.hinge.locked || b.hinge.type == "free" || b.hinge.type == "free_body") continue;
    b.hinge.springs.clear(), b.hinge.loads.clear(), b.hinge.prescribed.clear();
    out.bodies.push_back(b.name);
    VectorXd& tau = out.tree.tau[b.name];
    tau.head(tau.size() - static_cast<Eigen::Index>(b.modal ? b.modal->n_modes : 0)).setZero();
  }
  out.closed = out.tree;
  Loaded whole(out.tree);
  whole.forward();
  Observer observer(*whole.model, whole.ws);
  observer.update(whole.in(), nullptr);
  for (BodySpec& b : out.closed.spec.bodies) {
    if (std::ranges::find(out.bodies, b.name) == out.bodies.end()) continue;
    LoopSpec loop;
    loop.name = "hinge_of_" + b.name;
    loop.type = b.hinge.type;
    loop.params = b.hinge.params;
    loop.from = {b.hinge.inboard_body, b.hinge.inboard_node, b.hinge.onode_position, b.hinge.onode_R, {}};
    loop.to = {b.name, b.hinge.body_node, b.hinge.pnode_position, b.hinge.pnode_R, {}};
    out.closed.spec.loops.push_back(loop);
    std::string onto = b.hinge.inboard_body;
    for (const BodySpec& inboard : given.spec.bodies)
      if (from == 2 && inboard.name == b.hinge.inboard_body) onto = inboard.hinge.inboard_body;
    if (from == 0) onto.clear();
    NodeState at = observer.node(whole.model->find_node(b.name));
    Eigen::Vector3d turning = at.velocity.head<3>(), moving = at.R_WN * at.velocity.tail<3>();
    if (!onto.empty()) {
      const NodeState A = observer.node(whole.model->find_node(onto));
      const Eigen::Vector3d way = at.position - A.position, w = A.R_WN * A.velocity.head<3>();
      turning -= at.R_WN.transpose() * w;
      moving = A.R_WN.transpose() * (moving - A.R_WN * A.velocity.tail<3>() - w.cross(way));
      at.position = A.R_WN.transpose() * way;
      at.R_WN = (A.R_WN.transpose() * at.R_WN).eval();
    }
    const Eigen::Quaterniond turn(at.R_WN);
    b.hinge = {};
    b.hinge.type = "free";
    b.hinge.inboard_body = onto;
    b.hinge.q = {turn.w(), turn.x(), turn.y(), turn.z(), at.position.x(), at.position.y(), at.position.z()};
    b.hinge.v = {turning[0], turning[1], turning[2], moving.x(), moving.y(), moving.z()};
    const int modes = b.modal ? b.modal->n_modes : 0;
    for (ByBody* values : {&out.closed.tau, &out.closed.vdot}) {
      VectorXd padded = VectorXd::Zero(6 + modes);
      padded.tail(modes) = (*values)[b.name].tail(modes);
      (*values)[b.name] = padded;
    }
  }
  return out;
}

/// Cranks of length 1 on the ground, one every metre, and couplers of length 1 between their tips: each loop shares hinges with the next.
inline SystemSpec touching_four_bars(int n, double angle = 0.6, double rate = 0.7) {
  std::vector<BodySpec> bodies;
  std::vector<LoopSpec> loops;
  for (int i = 0; i <= n; ++i) {
    const std::string crank = "crank" + std::to_string(i);
    bodies.push_back(on(rigid(crank, 1.0, {0.5, 0, 0}, diagonal({0.002, 0.09, 0.09})), "", "revolute", {{0, 0, 1}}, {1.0 * i, 0, 0}));
    bodies.back().hinge.q = {angle}, bodies.back().hinge.v = {rate};
    if (i == n) break;
    bodies.push_back(
        on(rigid("rod" + std::to_string(i), 1.0, {0.5, 0, 0}, diagonal({0.002, 0.09, 0.09})), crank, "revolute", {{0, 0, 1}}, {1, 0, 0}));
    bodies.back().hinge.q = {-angle}, bodies.back().hinge.v = {-rate};
    LoopSpec loop;
    loop.name = "pin" + std::to_string(i), loop.type = "line";
    loop.from = {"rod" + std::to_string(i), "", {1, 0, 0}, Eigen::Matrix3d::Identity(), {}};
    loop.to = {"crank" + std::to_string(i + 1), "", {1, 0, 0}, Eigen::Matrix3d::Identity(), {}};
    loops.push_back(loop);
  }
  SystemSpec spec = system(bodies, uniform_gravity({0, -9.81, 0}));
  spec.loops = loops;
  return spec;
}

/// A link of length 1 along x that bends: two modes, and a third out of the plane with `deep`. Nodes: "tip", and two beside it.
inline BodySpec bending(const std::string& name, bool deep = false) {
  const int m = deep ? 3 : 2;
  std::vector<MassNode> masses;
  const auto shapes = [&](double x, double y) {
    Eigen::MatrixXd Phi = Eigen::MatrixXd::Zero(3, m), Psi = Eigen::MatrixXd::Zero(3, m);
    Phi(1, 0) = x * x, Psi(2, 0) = 2 * x, Phi(0, 0) = -2 * x * y;
    Phi(1, 1) = x * x * (1 - 1.3 * x), Psi(2, 1) = 2 * x - 3.9 * x * x, Phi(0, 1) = -Psi(2, 1) * y;
    if (deep) Phi(2, 2) = x * x + 0.3 * y, Psi(1, 2) = -2 * x, Psi(0, 2) = 0.3;
    return std::pair(Phi, Psi);
  };
  for (int i = 1; i <= 6; ++i) {
    MassNode n;
    n.mass = 0.2;
    n.position = {i / 6.0, i % 2 ? 0.05 : -0.05, i % 3 ? 0.02 : -0.04};
    n.Phi = shapes(n.position.x(), n.position.y()).first;
    masses.push_back(n);
  }
  std::vector<ModalNode> nodes;
  for (const auto& [node, x, y] : {std::tuple("tip", 1.0, 0.0), std::tuple("low", 0.6, -0.3), std::tuple("mid", 0.4, -0.3)}) {
    const auto [Phi, Psi] = shapes(x, y);
    nodes.push_back({node, {x, y, 0.0}, Eigen::Matrix3d::Identity(), Phi, Psi});
  }
  Eigen::VectorXd K(m);
  K.head<2>() << 6000.0, 80000.0;
  if (deep) K[2] = 9000.0;
  BodySpec b;
  b.name = name, b.type = "modal_flexible", b.level = 1;
  b.eta.assign(static_cast<std::size_t>(m), 0.0), b.etadot = b.eta;
  b.modal = std::make_shared<const ModalData>(lumped_modal_data(masses, K.asDiagonal(), {}, nodes));
  return b;
}

/// Links that bend: cranks on the ground, one every metre, and rods between their tips, as touching_four_bars.
inline SystemSpec bending_four_bars(int n, bool deep = false) {
  SystemSpec spec = touching_four_bars(n, 0.9, 0.0);
  for (BodySpec& b : spec.bodies) {
    BodySpec bends = bending(b.name, deep);
    bends.hinge = b.hinge;
    if (!b.hinge.inboard_body.empty()) bends.hinge.inboard_node = "tip", bends.hinge.onode_position.setZero();
    b = bends;
  }
  for (LoopSpec& loop : spec.loops) {
    loop.from.node = loop.to.node = "tip";
    loop.from.position = loop.to.position = Eigen::Vector3d::Zero();
  }
  return spec;
}

/// A tower of links that bend, each on two rigid cranks of the one below: every loop has its home on one that bends, and
/// another on its way.
inline SystemSpec bending_tower(int n) {
  std::vector<BodySpec> bodies = {on(bending("floor0"), "", "revolute", {{0, 0, 1}})};
  bodies[0].hinge.q = {0.2};
  std::vector<LoopSpec> loops;
  for (int i = 0; i < n; ++i) {
    const std::string below = "floor" + std::to_string(i), above = "floor" + std::to_string(i + 1), crank = "crank" + std::to_string(i);
    for (const bool left : {false, true}) {
      bodies.push_back(
          on(rigid(crank + (left ? "l" : "r"), 0.4, {0.2, 0, 0.01}, diagonal({0.002, 0.01, 0.01})), below, "revolute", {{0, 0, 1}}));
      bodies.back().hinge.inboard_node = left ? "low" : "tip";
      bodies.back().hinge.q = {1.0};
    }
    // (1, 0) and (0.6, -0.3) below are as far from each other as (0, 0) and (0.4, -0.3) above.
    bodies.push_back(on(bending(above), crank + "r", "revolute", {{0, 0, 1}}, {0.4, 0, 0}));
    const double turned = std::atan2(-0.3, -0.4) - std::atan2(-0.3, 0.4);
    bodies.back().hinge.q = {turned - 1.0};
    LoopSpec loop;
    loop.name = "pin" + std::to_string(i), loop.type = "line";
    loop.from = {crank + "l", "", {0.4, 0, 0}, Eigen::Matrix3d::Identity(), {}};
    loop.to.body = above, loop.to.node = "mid";
    loops.push_back(loop);
  }
  SystemSpec spec = system(bodies, uniform_gravity({0, -9.81, 0}));
  spec.loops = loops;
  return spec;
}

}  // namespace cardan::test
