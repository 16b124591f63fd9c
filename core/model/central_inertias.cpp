#include "core/model/central_inertias.hpp"

#include <Eigen/Geometry>
#include <algorithm>

#include "core/model/flexible_constants.hpp"

namespace cardan {

std::vector<Central> central_inertias(const Model& m, std::span<const int> order) {
  std::vector<Central> central(m.bodies.size());
  for (const int i : order)
    if (const UserBody& u = m.user[i]; u.sweep > 0) central[u.sweep] += Central::of(m.spec->bodies[i]).in(u.pose);
  return central;
}

void turn_dense_frames(Model& m, std::vector<Central>& central) {
  const int n = static_cast<int>(m.bodies.size());
  const Groups outboard(m.bodies, &SweepBody::parent, n), carried(m.user, &UserBody::sweep, n);
  std::vector<Long> subtree(m.bodies.size(), 0);
  for (std::size_t k = m.bodies.size() - 1; k > 0; --k) {
    subtree[k] += central[k].m;
    subtree[m.bodies[k].parent] += subtree[k];
  }
  for (int k = 1; k < n; ++k) {
    SweepBody& b = m.bodies[k];
    if (b.nv < 2 || b.shape < CARDAN_SHAPE_BALL || b.shape == CARDAN_SHAPE_FREE || b.shape == CARDAN_SHAPE_FREE_BODY) continue;
    const auto heaviest = std::ranges::max_element(outboard[k], {}, [&](int c) { return subtree[c]; });
    if (heaviest == outboard[k].end()) continue;
    SweepBody& child = m.bodies[*heaviest];
    const Vec3L p = to_eigen(child.O.p).cast<Long>();
    if ((p.array() != 0).count() < 2) continue;
    Mat3L R;  // S in P
    int least = 0;
    p.cwiseAbs().minCoeff(&least);
    R.col(0) = p.normalized();
    R.col(1) = (Vec3L::Unit(least) - R.col(0) * R(least, 0)).normalized();
    R.col(2) = R.col(0).cross(R.col(1));
    const Pose<double> S{from_eigen(Eigen::Matrix3d(R.cast<double>())), {}}, back = inverse(S);
    for (const int u : carried[k]) m.user[u].pose = back * m.user[u].pose;
    for (const int c : outboard[k]) m.bodies[c].O = back * m.bodies[c].O;
    child.O.p = {static_cast<double>(p.norm()), 0.0, 0.0};
    b.M = to_inboard(back, b.M);
    Central& own = central[k];
    own.c = (R.transpose() * own.c).eval();
    own.S = (R.transpose() * own.S * R).eval();
    m.graded.turned.push_back({k, S.R});
  }
}

void keep_central_inertias(Model& m, std::vector<Central> central) {
  std::vector<Central> swept = central;
  for (const int k : m.rotors) {
    const SweepBody& b = m.bodies[k];
    Central& rotor = central[k];
    rotor = rotor.in(b.O);
    swept[b.parent] += rotor;
  }
  for (std::size_t k = 0; k < m.bodies.size(); ++k) {
    m.graded.own.push_back(central[k].down());
    m.graded.swept.push_back(swept[k].down());
  }
  std::vector<int> parts(m.bodies.size(), 0);  // user bodies and rotors that make up a sweep body
  for (const UserBody& u : m.user) ++parts[u.sweep];
  for (const int k : m.rotors) ++parts[m.bodies[k].parent];
  for (const UserNode& node : m.nodes) {  // a force at the mass centre of a body by itself has no couple, to the last bit
    const auto k = static_cast<std::size_t>(node.sweep);
    const UserBody& u = m.user[node.body];
    const BodySpec& spec = m.spec->bodies[node.body];
    const Central own = Central::of(spec);
    const std::string name = node.name == spec.name ? std::string() : node.name.substr(spec.name.size() + 1);
    Vec3L arm = to_eigen(u.pose.R).cast<Long>() * (to_eigen(node_of(spec, name).pose.p).cast<Long>() - own.c);
    if (parts[k] > 1) arm += own.in(u.pose).c - swept[k].c;
    m.graded.arm.push_back(from_eigen(Eigen::Vector3d(arm.cast<double>())));
  }
}

}  // namespace cardan
