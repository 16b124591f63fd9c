#include "tests/support/random_tree.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <array>
#include <cstdlib>
#include <random>
#include <set>

#include "bodies/modal/lumped.hpp"
#include "core/model/rotary_terms.hpp"

namespace cardan::test {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Numbers that do not depend on the standard library.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double between(double a, double b) { return a + (b - a) * (static_cast<double>(engine_()) / 4294967296.0); }
  int below(int n) { return static_cast<int>(engine_() % static_cast<unsigned>(n)); }
  bool chance(double share) { return between(0.0, 1.0) < share; }
  VectorXd vector(Eigen::Index n, double size = 1.0) {
    VectorXd x(n);
    for (double& e : x) e = between(-size, size);
    return x;
  }
  MatrixXd matrix(Eigen::Index rows, Eigen::Index cols, double size) { return vector(rows * cols, size).reshaped(rows, cols); }
  Matrix3d rotation() { return Eigen::Quaterniond(Eigen::Vector4d(vector(4)).normalized()).toRotationMatrix(); }
  /// A tensor of inertia: that of some points.
  Matrix3d inertia(double mass, double size) {
    Matrix3d J = Matrix3d::Zero();
    for (int i = 0; i < 6; ++i) {
      const Vector3d r = vector(3, size);
      J += mass / 6.0 * (r.squaredNorm() * Matrix3d::Identity() - r * r.transpose());
    }
    return J;
  }

 private:
  std::mt19937 engine_;
};

std::vector<double> list(const Eigen::Ref<const VectorXd>& x) { return {x.data(), x.data() + x.size()}; }

/// Axes and state of one hinge.
void set_hinge(HingeSpec& h, const std::string& type, Random& random) {
  struct Shape {
    int axes, nq, nv;
  };
  static const std::map<std::string, Shape> shapes = {{"locked", {0, 0, 0}},
                                                      {"revolute", {1, 1, 1}},
                                                      {"prismatic", {1, 1, 1}},
                                                      {"helical", {1, 1, 1}},
                                                      {"cylindrical", {1, 2, 2}},
                                                      {"universal", {2, 2, 2}},
                                                      {"constant_velocity", {2, 2, 2}},
                                                      {"gimbal", {3, 3, 3}},
                                                      {"planar", {2, 3, 3}},
                                                      {"translational", {0, 3, 3}},
                                                      {"ball", {0, 4, 3}},
                                                      {"free", {0, 7, 6}},
                                                      {"free_body", {0, 7, 6}}};
  const Shape& shape = shapes.at(type);
  h.type = type;
  if (shape.axes > 0) {
    Matrix3d axes = random.rotation();  // orthogonal: what planar needs, and far from gimbal lock
    if (type == "universal") axes.col(1) += 0.3 * axes.col(0);
    h.params[shape.axes == 1 ? "axis" : "axes"].value = list(axes.leftCols(shape.axes).reshaped());
  }
  if (type == "helical") h.params["pitch"].value = random.between(0.05, 0.3);
  VectorXd q = random.vector(shape.nq, 0.7);
  if (shape.nq > shape.nv) q.head<4>().normalize();
  h.q = list(q);
  h.v = list(random.vector(shape.nv));
}

MatrixXd symmetric(const MatrixXd& a) { return 0.5 * (a + a.transpose()); }

/// Masses that move with modes of a few rad/s; level 2 has second-order displacements as well.
ModalData modal_data(Random& random, int level, const TreeOptions& options, std::vector<ModalNode> nodes, int m) {
  std::vector<MassNode> masses;
  for (int i = 0; i < 6 + m; ++i) {
    MassNode n;
    n.mass = random.between(0.2, 1.0);
    n.position = random.vector(3, 0.6);
    n.Phi = random.matrix(3, m, 0.5);
    if (i % 2 == 0 && !options.plain_masses) {
      n.inertia = random.inertia(n.mass, 0.2);
      n.Psi = random.matrix(3, m, 0.5);
    }
    if (level == 2 && i % 3 == 0 && !options.plain_masses)
      for (int a = 0; a < 3; ++a) n.Q.push_back(symmetric(random.matrix(m, m, 0.3)));
    masses.push_back(n);
  }
  MatrixXd K = random.vector(m).cwiseAbs().asDiagonal(), C = MatrixXd::Zero(m, m);
  K.diagonal().array() += 0.5;
  if (random.chance(0.5)) {
    const MatrixXd mix = random.matrix(m, m, 0.4);
    K += mix * mix.transpose();
  }
  if (options.damping) C = 0.02 * K;
  return lumped_modal_data(std::move(masses), 20.0 * K, std::move(C), std::move(nodes));
}

struct Draft {
  BodySpec body;
  std::vector<ModalNode> nodes;  // with their shapes
  int n_modes = 0;
};

void add_node(Draft& d, const std::string& name, bool deforms, Random& random) {
  ModalNode n{name, random.vector(3, 0.5), random.rotation(), {}, {}};
  if (d.n_modes > 0 && deforms) {
    n.Phi = random.matrix(3, d.n_modes, 0.5);
    n.Psi = random.matrix(3, d.n_modes, 0.5);
  }
  d.nodes.push_back(std::move(n));
}

/// Axisymmetric about the axis of a revolute hinge, with the mass centre on it.
void make_wheel(Draft& d, Random& random) {
  BodySpec& b = d.body;
  b.hinge.params.clear();
  set_hinge(b.hinge, "revolute", random);
  const auto& axis = std::get<std::vector<double>>(b.hinge.params.at("axis").value);
  Vector3d u = Vector3d(axis[0], axis[1], axis[2]).normalized(), at = Vector3d::Zero();
  if (!d.nodes.empty()) u = d.nodes.front().R_BN * u, at = d.nodes.front().position;
  const double across = b.mass * random.between(0.05, 0.2), about = across * random.between(0.5, 1.9);
  b.com = at + random.between(-0.3, 0.3) * u;
  b.inertia_com = across * Matrix3d::Identity() + (about - across) * u * u.transpose();
}

}  // namespace

unsigned first_seed() {
  const char* asked = std::getenv("CARDAN_FIRST_SEED");
  return asked != nullptr ? static_cast<unsigned>(std::strtoul(asked, nullptr, 10)) : 1U;
}

RandomTree random_tree(unsigned seed, const TreeOptions& options) {
  Random random(seed);
  RandomTree tree;
  tree.seed = seed;
  tree.spec.name = fmt::format("random tree {}", seed);
  GravitySpec& gravity = tree.spec.gravity;
  gravity.kind = options.gravity;
  gravity.g = {1.0, -2.0, 9.0};
  gravity.centre = {12.0, -9.0, 14.0};
  gravity.mu = 2000.0;
  gravity.gradient = options.gradient;

  std::vector<Draft> drafts;
  for (int i = 0; i < options.bodies; ++i) {
    Draft d;
    BodySpec& b = d.body;
    b.name = fmt::format("b{}", i);
    const bool root = i < options.roots ? i == 0 || random.chance(0.5) : false;
    if (random.chance(options.flexible)) {
      b.type = "modal_flexible";
      b.level = options.level >= 0 ? options.level : random.below(3);
      b.rotary_tolerance = std::array{0.0, 0.05, 0.5}[static_cast<std::size_t>(i % 3)];
      d.n_modes = options.modes > 0 ? options.modes : 1 + random.below(4);
      b.eta = list(random.vector(d.n_modes, 0.1));
      b.etadot = list(random.vector(d.n_modes, 0.5));
    } else {
      b.mass = std::exp(random.between(-1.0, 2.5));
      b.com = random.vector(3, 0.4);
      b.inertia_com = random.inertia(b.mass, 0.6);
    }
    if (!random.chance(0.2)) {  // else P is the origin
      add_node(d, "p", random.chance(0.6), random);
      b.hinge.body_node = "p";
    }
    std::string type = options.hinges[static_cast<std::size_t>(random.below(static_cast<int>(options.hinges.size())))];
    if (root && (options.floating || type == "locked")) type = "free";  // a body fixed to the ground is part of it
    set_hinge(b.hinge, type, random);
    if (root) {
      b.hinge.onode_position = random.vector(3, 2.0);
      b.hinge.onode_R = random.rotation();
    } else {
      Draft& inboard = drafts[static_cast<std::size_t>(random.below(i))];
      b.hinge.inboard_body = inboard.body.name;
      if (!random.chance(0.1)) {
        b.hinge.inboard_node = "o_" + b.name;
        add_node(inboard, b.hinge.inboard_node, random.chance(0.7), random);
      }
      if (random.chance(options.locked)) b.hinge.locked = true;
    }
    if (!root && d.n_modes == 0 && random.chance(options.wheels)) make_wheel(d, random);
    if (options.springs && !b.hinge.locked) {
      if (b.hinge.type == "revolute") b.hinge.springs = {{0, 3.0, 0.2, 0.5, {}}};
      if (!root && (b.hinge.type == "ball" || b.hinge.type == "free_body"))  // a quaternion has nothing that a spring could hold
        for (int j = 0; j < static_cast<int>(b.hinge.v.size()); j += 2) b.hinge.springs.push_back({j, 0.0, 0.0, 0.5, {}});
    }
    if (options.loads && (b.hinge.type == "revolute" || b.hinge.type == "prismatic") && !b.hinge.locked)
      b.hinge.loads = {{0, HingeLaw::stop, {-0.3, 0.1, 40.0, 1.5, 0.2}, {}}, {0, HingeLaw::friction, {0.4, 0.7, 0.8, 0.2, 0.5}, {}}};
    add_node(d, "tip", true, random);
    drafts.push_back(std::move(d));
  }
  for (Draft& d : drafts) {
    BodySpec& b = d.body;
    if (d.n_modes > 0)
      b.modal = std::make_shared<const ModalData>(modal_data(random, b.level, options, d.nodes, d.n_modes));
    else
      for (const ModalNode& n : d.nodes) b.nodes.push_back({n.name, n.position, n.R_BN, {}});
    const int nv = b.hinge.locked ? 0 : static_cast<int>(b.hinge.v.size());
    for (int j = 0; j < nv; ++j)
      if (random.chance(options.prescribed)) b.hinge.prescribed.push_back(j);
    for (int j = 0; j < d.n_modes; ++j)
      if (!options.free_modes && random.chance(options.prescribed)) b.prescribed_modes.push_back(j);
    tree.tau[b.name] = random.vector(nv + d.n_modes, 2.0);
    tree.vdot[b.name] = random.vector(nv + d.n_modes, 2.0);
    if (random.chance(0.4)) tree.loads.push_back({b.name, "tip", random.chance(0.5), random.vector(6, 2.0)});
    tree.spec.bodies.push_back(std::move(b));
  }
  tree.spec = *with_kept_rotary_terms(std::make_shared<const SystemSpec>(std::move(tree.spec)));  // so that a twin has them too
  return tree;
}

RandomTree with_factor(RandomTree tree, HingeFactor factor) {
  for (BodySpec& b : tree.spec.bodies)
    if (b.hinge.v.size() > 1 && b.hinge.v.size() < 6) b.hinge.factor = factor;
  return tree;
}

RandomTree without(const RandomTree& tree, const std::string& body) {
  std::set<std::string> gone = {body};
  for (bool more = true; more;) {
    more = false;
    for (const BodySpec& b : tree.spec.bodies)
      if (gone.count(b.hinge.inboard_body) > 0 && gone.insert(b.name).second) more = true;
  }
  RandomTree out = tree;
  std::erase_if(out.spec.bodies, [&](const BodySpec& b) { return gone.count(b.name) > 0; });
  std::erase_if(out.loads, [&](const Load& l) { return gone.count(l.body) > 0; });
  for (const std::string& name : gone) {
    out.tau.erase(name);
    out.vdot.erase(name);
  }
  return out;
}

std::string describe(const RandomTree& tree) {
  std::string out = fmt::format("seed {}, {} bodies, {} loads\n", tree.seed, tree.spec.bodies.size(), tree.loads.size());
  for (const BodySpec& b : tree.spec.bodies)
    out += fmt::format("  {} {}{} on {}{} to {}\n", b.name, b.type,
                       b.modal ? fmt::format(" ({} modes, level {})", b.modal->n_modes, b.level) : "", b.hinge.locked ? "locked " : "",
                       b.hinge.type, b.hinge.inboard_body.empty() ? "world" : b.hinge.inboard_body);
  return out;
}

BodySpec frozen(const BodySpec& modal_body) {
  BodySpec b = modal_body;
  const ModalIntegrals& I = modal_body.modal->integrals;
  b.type = "rigid";
  b.modal = nullptr;
  b.eta.clear();
  b.etadot.clear();
  b.prescribed_modes.clear();
  b.mass = I.I1;
  b.com = I.I2 / I.I1;
  b.inertia_com = I.I7 - b.mass * (b.com.squaredNorm() * Matrix3d::Identity() - b.com * b.com.transpose());
  for (const ModalNode& n : modal_body.modal->nodes) b.nodes.push_back({n.name, n.position, n.R_BN, {}});
  return b;
}

}  // namespace cardan::test
