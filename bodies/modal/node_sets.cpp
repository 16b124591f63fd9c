#include "bodies/modal/node_sets.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "bodies/modal/eigen_modes.hpp"
#include "bodies/modal/refuse.hpp"
#include "core/base/units.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kOnPlane = 1e-5;  // of the size of the body: what files of seven digits say of a place

std::string place(const Vector3d& x) { return fmt::format("({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()); }

double extent(const FeModel& model) {
  double size = 0.0;
  for (const Vector3d& x : model.nodes) size = std::max(size, (x - model.nodes[0]).norm());
  return size;
}

}  // namespace

std::vector<int> nodes_of(const FeModel& model, const NodeSet& set, const Vector3d& position, const std::string& field, const Located& at) {
  std::vector<int> out;
  const auto once = [](std::vector<int> nodes) {
    std::ranges::sort(nodes);
    nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
    return nodes;
  };
  if (!set.names.empty()) {
    for (const std::string& name : set.names) {
      const auto node = model.names.find(name);
      if (node == model.names.end()) {
        std::vector<std::string> all;
        for (const auto& [one, of] : model.names) all.push_back(one);
        refuse(at, field, Code::unknown_name, "names of nodes of the table", in_quotes(name), did_you_mean(name, all));
      }
      out.push_back(node->second);
    }
    return once(std::move(out));
  }
  if (!set.numbers.empty()) {
    for (const int number : set.numbers) {
      const auto node = model.numbers.find(number);
      if (node == model.numbers.end())
        refuse(at, field + ".numbers", Code::unknown_name, "numbers of nodes of the mesh", fmt::format("{}", number));
      out.push_back(node->second);
    }
    return once(std::move(out));
  }
  if (!set.group.empty()) {
    const auto group = model.groups.find(set.group);
    std::vector<std::string> names;
    for (const auto& [name, nodes] : model.groups) names.push_back(name);
    if (group == model.groups.end())
      refuse(at, field + ".group", Code::unknown_name,
             names.empty() ? "a mesh with groups: physical groups of Gmsh" : "a physical group of the mesh", "\"" + set.group + "\"",
             did_you_mean(set.group, names));
    return group->second;
  }
  const bool plane = !set.normal.isZero(0.0);
  if (!plane && set.within == 0.0) {
    const int node = model.find_node(position);
    if (node < 0)
      refuse(at, field + ".position", Code::fe_model,
             model.exact_points ? "a point within one element of the mesh" : "the position of a node", place(position));
    return {node};
  }
  const double limit = plane ? kOnPlane * extent(model) : set.within;
  double nearest = INFINITY;
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    const Vector3d d = model.nodes[i] - position;
    const double distance = plane ? std::abs(d.dot(set.normal.normalized())) : d.norm();
    nearest = std::min(nearest, distance);
    if (distance <= limit) out.push_back(static_cast<int>(i));
  }
  if (out.empty())
    refuse(at, field + (plane ? ".normal" : ".within"), Code::fe_model,
           plane ? "a plane with nodes on it" : fmt::format("nodes within {:.4g} m of {}", set.within, place(position)),
           fmt::format("none: the nearest is {:.4g} m away", nearest), "are mesh and body in the same axes and units?");
  return out;
}

FeModel::Grip grip_of(const FeModel& model, const NodeSet& set, const Vector3d& position, const std::string& field, const Located& at) {
  if (model.per_node == 6 && !set.nearest())
    refuse(at, field, Code::fe_model, "`position` alone: nodes with rotations move what stands on them each by itself", "several nodes");
  std::vector<int> nodes = nodes_of(model, set, position, field, at);
  Vector3d where = set.nearest() ? model.nodes[static_cast<std::size_t>(nodes[0])] : position;
  if (set.at_mean) {
    where.setZero();
    for (const int i : nodes) where += model.nodes[static_cast<std::size_t>(i)] / static_cast<double>(nodes.size());
  }
  if (nodes.size() == 1 && model.per_node == 3) nodes = model.around(nodes[0]);
  const std::optional<FeModel::Grip> grip = model.grip(where, nodes);
  if (!grip)
    refuse(at, field, Code::fe_model,
           "nodes that do not lie on one line: nodes of solids have no rotation, that of a point is that of several",
           fmt::format("{} node{} on one line", nodes.size(), nodes.size() == 1 ? "" : "s"));
  return *grip;
}

FeModel::Grip root_grip(const FeModel& model, const NodeSet& set, bool free, const std::string& field, const Located& at) {
  if (!free) return {Vector3d::Zero(), {}, Eigen::MatrixXd(6, 0)};
  if (!model.root_nodes.empty()) {
    const std::vector<int> nodes = model.root_nodes.size() == 1 ? model.around(model.root_nodes[0]) : model.root_nodes;
    if (const auto grip = model.grip(Vector3d::Zero(), nodes)) return *grip;
    refuse(at, field, Code::fe_model, "nodes that do not lie on one line", fmt::format("{}", nodes.size()));
  }
  if (model.find_node(Vector3d::Zero()) < 0)
    refuse(at, field, Code::missing_key, "nodes of the mesh near the origin, or the nodes that move the node `root` there", "neither",
           "root: {group: base}, {numbers: [1, 2, 3]} or {position: [0, 0, 0], within: 10 cm}");
  return grip_of(model, set, Vector3d::Zero(), field, at);
}

void add_masses(FeModel& model, const std::vector<PointMass>& masses, const Located& at) {
  const auto n = static_cast<int>(model.nodes.size()), own_points = static_cast<int>(model.between.rows()),
             n_points = own_points + static_cast<int>(masses.size());
  std::vector<Eigen::Triplet<double>> N[3], Q[3], M;
  for (int i = 0; i < n; ++i)
    for (int a = 0; a < 3; ++a) N[a].emplace_back(i, model.per_node * i + a, 1.0);
  model.between.conservativeResize(n_points, n_points);
  model.point_inertia.assign(static_cast<std::size_t>(n_points), Matrix3d::Zero());
  model.point_position.resize(3, n_points);
  for (int i = 0; i < n; ++i) model.point_position.col(i) = model.nodes[static_cast<std::size_t>(i)];
  for (int p = n; p < own_points; ++p) {  // a unit of distance from a node that turns
    const int dof = model.per_node * ((p - n) / 3) + 3, along = (p - n) % 3, next = (along + 1) % 3, last = (along + 2) % 3;
    model.point_position.col(p) = Vector3d::Unit(along);
    N[next].emplace_back(p, dof + last, 1.0), N[last].emplace_back(p, dof + next, -1.0);
  }
  for (int p = own_points; p < n_points; ++p) {
    const PointMass& mass = masses[static_cast<std::size_t>(p - own_points)];
    const std::string field = fmt::format("masses[{}]", p - own_points);
    if (!(mass.mass > 0.0) || !std::isfinite(mass.mass))
      refuse(at, field + ".mass", Code::out_of_range, "a number > 0 [kg]", fmt::format("{}", mass.mass));
    const FeModel::Grip grip = grip_of(model, mass.nodes, mass.position, field, at);
    model.between.coeffRef(p, p) = mass.mass;
    model.point_position.col(p) = grip.position;
    model.point_inertia[static_cast<std::size_t>(p)] = mass.inertia;
    const std::vector<int> dofs = dofs_of(grip.nodes, model.per_node);
    const auto move = grip.B.topRows(3), turn = grip.B.bottomRows(3);
    const MatrixXd own = mass.mass * move.transpose() * move + turn.transpose() * mass.inertia * turn;
    for (std::size_t j = 0; j < dofs.size(); ++j) {
      const auto c = static_cast<Eigen::Index>(j);
      for (int a = 0; a < 3; ++a) N[a].emplace_back(p, dofs[j], move(a, c)), Q[a].emplace_back(p, dofs[j], turn(a, c));
      for (std::size_t i = 0; i < dofs.size(); ++i) {
        const auto r = static_cast<Eigen::Index>(i);
        M.emplace_back(dofs[i], dofs[j], 0.5 * (own(r, c) + own(c, r)));
      }
    }
  }
  const auto assemble = [](SparseMatrix& A, int rows, int cols, const std::vector<Eigen::Triplet<double>>& entries) {
    A.resize(rows, cols);
    A.setFromTriplets(entries.begin(), entries.end());
  };
  if (!masses.empty()) {
    SparseMatrix carried;
    assemble(carried, model.n_dofs(), model.n_dofs(), M);
    model.M += carried;
  }
  model.between.makeCompressed();
  for (int a = 0; a < 3; ++a) {
    assemble(model.N[a], n_points, model.n_dofs(), N[a]);
    assemble(model.Q[a], n_points, model.n_dofs(), Q[a]);
  }
  Eigen::VectorXd one = Eigen::VectorXd::Ones(n_points);
  one.segment(n, own_points - n).setZero();
  model.point_mass = model.between * one;
}

}  // namespace cardan
