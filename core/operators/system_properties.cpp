#include "core/operators/system_properties.hpp"

#include <Eigen/Geometry>
#include <limits>

#include "core/base/diagnostic.hpp"
#include "core/operators/mass_matrix.hpp"

namespace cardan::operators {

namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// The antisymmetric part.
Vector3d vector_of(const Matrix3d& a) { return 0.5 * Vector3d(a(2, 1) - a(1, 2), a(0, 2) - a(2, 0), a(1, 0) - a(0, 1)); }

Placement operator*(const Placement& a, const Placement& b) { return {a.R * b.R, a.p + a.R * b.p}; }
Placement inverse(const Placement& a) { return {a.R.transpose(), -(a.R.transpose() * a.p)}; }

/// The frame whose motion transform from the inboard frame is X = [R* 0; -R* p~ R*].
Placement placement_of(const Eigen::Ref<const Matrix6>& X) {
  const Matrix3d R = X.topLeftCorner<3, 3>().transpose();
  return {R, vector_of(-R * X.bottomLeftCorner<3, 3>())};
}

/// A force at the origin of a frame, its axes, seen from the frame that it stands in.
Vector6 carried(const Placement& at, const Vector6& f) {
  const Vector3d force = at.R * f.tail<3>(), moment = at.R * f.head<3>() + at.p.cross(force);
  Vector6 out;
  out << moment, force;
  return out;
}

/// Rigid inertia about the mass centre.
struct Lump {
  double mass = 0.0;
  Vector3d com = Vector3d::Zero();
  Matrix3d inertia = Matrix3d::Zero();
};
Matrix3d point_inertia(double m, const Vector3d& c) { return m * (c.squaredNorm() * Matrix3d::Identity() - c * c.transpose()); }
Lump lump_of(const Eigen::Ref<const Matrix6>& M) {  // [J, m c~; -m c~, m 1]
  Lump out{M(3, 3), Vector3d::Zero(), M.topLeftCorner<3, 3>()};
  if (out.mass > 0.0) {
    out.com = vector_of(M.topRightCorner<3, 3>()) / out.mass;
    out.inertia -= point_inertia(out.mass, out.com);
  }
  return out;
}
Lump placed(const Placement& at, const Lump& a) { return {a.mass, at.p + at.R * a.com, at.R * a.inertia * at.R.transpose()}; }
Lump together(const Lump& a, const Lump& b) {
  const double mass = a.mass + b.mass;
  if (!(mass > 0.0)) return {0.0, Vector3d::Zero(), a.inertia + b.inertia};
  return {mass, (a.mass * a.com + b.mass * b.com) / mass, a.inertia + b.inertia + point_inertia(a.mass * b.mass / mass, a.com - b.com)};
}

/// All bodies, in the reference of the placements.
Lump everything(const TreeOperators& tree, const Placements& at) {
  Lump all;
  for (std::size_t i = 0; i < tree.bodies().size(); ++i)
    all = together(all, placed(at.bodies[i], lump_of(tree.M(static_cast<int>(i)).topLeftCorner<6, 6>())));
  return all;
}

/// Where the bodies are, seen from a frame of world axes at the point that momentum is taken about.
struct Frames {
  Frames(const TreeOperators& tree, About about) {
    const Placements at(tree);
    Placement point{at.reference.R, at.reference.p};
    if (about == About::mass_centre) point.p = -(at.reference.R * everything(tree, at).com);
    for (const Placement& b : at.bodies) bodies.push_back(point * b);
  }
  std::vector<Placement> bodies;
};

}  // namespace

Placements::Placements(const TreeOperators& tree) {
  const PositionBlocks& blocks = tree.position_blocks();
  const int n = static_cast<int>(tree.bodies().size());
  const auto step = [&](int sweep) { return placement_of(blocks.A[sweep].leftCols<6>()); };
  const auto in_world = [&](int sweep) {
    Placement out = step(sweep);
    for (int k = tree.model().bodies[sweep].parent; k > 0; k = tree.model().bodies[k].parent) out = step(k) * out;
    return out;
  };
  bodies.resize(n);
  for (int i = 0; i < n; ++i) {
    const OperatorBody& b = tree.bodies()[i];
    if (i == 0)
      reference = in_world(b.sweep);
    else
      bodies[i] = b.parent >= 0 ? bodies[b.parent] * step(b.sweep) : inverse(reference) * in_world(b.sweep);
  }
}

MassProperties MassProperties::seen_from(const Placement& frame) const {
  return {mass, frame.R.transpose() * (com - frame.p), frame.R.transpose() * inertia * frame.R};
}

MassProperties mass_properties(const TreeOperators& tree) {
  const Placements at(tree);
  const Lump all = everything(tree, at);
  if (!(all.mass > 0.0)) return {};
  const Lump in_world = placed(at.reference, all);
  return {in_world.mass, in_world.com, 0.5 * (in_world.inertia + in_world.inertia.transpose())};
}

Placement place_of_node(const TreeOperators& tree, int node) {
  tree.require_nodes(std::span(&node, 1));
  const Placements at(tree);
  const int body = tree.index_of(tree.model().nodes[node].sweep);
  return at.reference * at.bodies[body] * placement_of(tree.Bt(node).leftCols<6>());
}

Matrix6X momentum_matrix(const TreeOperators& tree, About about) {
  const Frames frames(tree, about);
  const std::vector<MatrixXd> R = composite_inertias(tree);
  Matrix6X out(6, tree.size(Space::hinge));
  for (int i = 0; i < static_cast<int>(tree.bodies().size()); ++i) {
    const OperatorBody& b = tree.bodies()[i];
    const Matrix6X momenta = R[i].topRows<6>() * tree.Ht_all(i);
    for (int j = 0; j < b.nh + b.m; ++j) out.col(b.v + j) = carried(frames.bodies[i], momenta.col(j));
  }
  return out;
}

namespace {

/// [angular; linear] momentum of each body.
Matrix6X body_momenta(const TreeOperators& tree, About about, const VectorXd& v) {
  const Frames frames(tree, about);
  const VectorXd V = body_velocities(tree, v);
  Matrix6X out(6, static_cast<Eigen::Index>(tree.bodies().size()));
  for (int i = 0; i < out.cols(); ++i) {
    const OperatorBody& b = tree.bodies()[i];
    out.col(i) = carried(frames.bodies[i], tree.M(i).topRows<6>() * V.segment(b.at, 6 + b.m));
  }
  return out;
}

}  // namespace

Vector6 momentum(const TreeOperators& tree, About about, const VectorXd& v) { return body_momenta(tree, about, v).rowwise().sum(); }

VectorXd momentum_adjoint(const TreeOperators& tree, About about, const Vector6& w) {
  const Frames frames(tree, about);
  VectorXd f(tree.size(Space::body));
  for (int i = 0; i < static_cast<int>(tree.bodies().size()); ++i) {
    const OperatorBody& b = tree.bodies()[i];
    const Placement& at = frames.bodies[i];
    Vector6 V;
    V << at.R.transpose() * w.head<3>(), at.R.transpose() * (w.tail<3>() + Vector3d(w.head<3>()).cross(at.p));
    f.segment(b.at, 6 + b.m).noalias() = tree.M(i).leftCols<6>() * V;
  }
  return hinge_forces(tree, std::move(f));
}

MomentumSharing momentum_sharing(const TreeOperators& tree, const VectorXd& v) {
  MomentumSharing out;
  out.bodies = body_momenta(tree, About::mass_centre, v);
  out.total = out.bodies.rowwise().sum();
  const auto share = [](const Eigen::Matrix3Xd& parts, const Vector3d& total) -> VectorXd {
    const double size = parts.colwise().norm().sum();
    if (!(total.norm() > 1e-13 * size)) return {};
    return parts.transpose() * total / total.squaredNorm();
  };
  out.angular = share(out.bodies.topRows<3>(), out.total.head<3>());
  out.linear = share(out.bodies.bottomRows<3>(), out.total.tail<3>());
  return out;
}

ReflectedInertia reflected_inertia(const TreeOperators& tree) {
  tree.require(Kind::Y);
  const std::vector<MatrixXd> R = composite_inertias(tree);
  const int n = tree.size(Space::hinge);
  ReflectedInertia out{VectorXd(n), VectorXd(n), VectorXd(n)};
  for (int i = 0; i < static_cast<int>(tree.bodies().size()); ++i) {
    const OperatorBody& b = tree.bodies()[i];
    const int size = b.nh + b.m;
    out.others_locked.segment(b.v, size) = (tree.Ht_all(i).transpose() * R[i] * tree.Ht_all(i)).diagonal();
    const VectorXd above = (tree.G(i).transpose() * tree.Y_plus(i) * tree.G(i)).diagonal();
    const MatrixXd S_inverse = tree.S(i).triangularView<Eigen::Lower>().solve(MatrixXd::Identity(size, size));
    for (int j = 0; j < size; ++j) {
      const double own = S_inverse.col(j).squaredNorm();  // (D^-1)_jj
      const bool free = tree.is_free(b.v + j);
      out.outboard_free[b.v + j] = free ? 1.0 / own : std::numeric_limits<double>::infinity();
      out.others_free[b.v + j] = free ? 1.0 / (own + above[j]) : std::numeric_limits<double>::infinity();
    }
  }
  return out;
}

}  // namespace cardan::operators
