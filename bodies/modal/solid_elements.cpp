// Isoparametric solid elements (Zienkiewicz, Taylor, Zhu 2013): the quadratic tetrahedron, brick and wedge without inner nodes, and the
// brick of eight nodes with the incompatible modes of Wilson et al. (1973) as Taylor, Beresford and Wilson (1976) made them pass the patch
// test.
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "bodies/modal/solids.hpp"
#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// A value and its derivatives in the element's coordinates.
struct Jet {
  double v = 0.0;
  Vector3d d = Vector3d::Zero();
};
Jet operator+(const Jet& a, const Jet& b) { return {a.v + b.v, a.d + b.d}; }
Jet operator-(const Jet& a, const Jet& b) { return {a.v - b.v, a.d - b.d}; }
Jet operator*(const Jet& a, const Jet& b) { return {a.v * b.v, a.v * b.d + b.v * a.d}; }
Jet operator*(double s, const Jet& a) { return {s * a.v, s * a.d}; }
Jet constant(double v) { return {v, Vector3d::Zero()}; }

struct Topology {
  const char* name;
  int corners;
  std::vector<std::pair<int, int>> edges;
  std::vector<std::vector<int>> faces;
  Matrix3Xd places;
};

Topology make(const char* name, const std::vector<Vector3d>& corners, std::vector<std::pair<int, int>> edges,
              std::vector<std::vector<int>> faces) {
  Topology t{name, static_cast<int>(corners.size()), std::move(edges), std::move(faces), {}};
  t.places.resize(3, static_cast<Eigen::Index>(corners.size() + t.edges.size()));
  Eigen::Index column = 0;
  for (const Vector3d& corner : corners) t.places.col(column++) = corner;
  for (const auto& [a, b] : t.edges)
    t.places.col(column++) = 0.5 * (corners[static_cast<std::size_t>(a)] + corners[static_cast<std::size_t>(b)]);
  return t;
}

const Topology& topology(SolidShape shape) {
  static const std::vector<Vector3d> cube = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                                             {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};
  static const std::vector<std::vector<int>> sides = {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}};
  static const std::array<Topology, 4> all = {
      make("tetrahedron of 10 nodes", {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}},
           {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}),
      make("brick of 20 nodes", cube, {{0, 1}, {1, 2}, {2, 3}, {3, 0}, {0, 4}, {1, 5}, {2, 6}, {3, 7}, {4, 5}, {5, 6}, {6, 7}, {7, 4}},
           sides),
      make("wedge of 15 nodes", {{0, 0, -1}, {1, 0, -1}, {0, 1, -1}, {0, 0, 1}, {1, 0, 1}, {0, 1, 1}},
           {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 4}, {2, 5}, {3, 4}, {4, 5}, {5, 3}},
           {{0, 2, 1}, {3, 4, 5}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}}),
      make("brick of 8 nodes", cube, {}, sides)};
  return all[static_cast<std::size_t>(shape)];
}

std::vector<Jet> jets(SolidShape shape, const Vector3d& place) {
  const Topology& t = topology(shape);
  const Jet x{place.x(), Vector3d::UnitX()}, y{place.y(), Vector3d::UnitY()}, z{place.z(), Vector3d::UnitZ()}, one = constant(1.0);
  std::vector<Jet> N;
  if (shape == SolidShape::tetra10) {
    const std::array<Jet, 4> L = {one - x - y - z, x, y, z};
    for (const Jet& l : L) N.push_back(l * (2.0 * l - one));
    for (const auto& [a, b] : t.edges) N.push_back(4.0 * L[static_cast<std::size_t>(a)] * L[static_cast<std::size_t>(b)]);
  } else if (shape == SolidShape::penta15) {
    const std::array<Jet, 3> L = {one - x - y, x, y};
    const Jet bubble = one - z * z;
    const auto half = [&](int corner) { return 0.5 * (corner < 3 ? one - z : one + z); };
    for (int i = 0; i < 6; ++i) {
      const Jet& l = L[static_cast<std::size_t>(i % 3)];
      N.push_back(l * (2.0 * l - one) * half(i) - 0.5 * l * bubble);
    }
    for (const auto& [a, b] : t.edges) {
      const Jet &l = L[static_cast<std::size_t>(a % 3)], &k = L[static_cast<std::size_t>(b % 3)];
      N.push_back(a % 3 == b % 3 ? l * bubble : 4.0 * l * k * half(a));
    }
  } else {
    for (Eigen::Index i = 0; i < t.places.cols(); ++i) {
      const Vector3d c = t.places.col(i);
      const auto along = [&](const Jet& s, double at) { return at == 0.0 ? one - s * s : 0.5 * (one + at * s); };
      Jet n = along(x, c.x()) * along(y, c.y()) * along(z, c.z());
      if (shape == SolidShape::hexa20 && i < t.corners) n = n * (c.x() * x + c.y() * y + c.z() * z - constant(2.0));
      N.push_back(n);
    }
  }
  return N;
}

/// Gauss's points on (0, 1).
struct Line {
  std::vector<double> at, weight;
};
const Line kThree = {{0.11270166537925831, 0.5, 0.88729833462074169}, {0.27777777777777778, 0.44444444444444444, 0.27777777777777778}};
const Line kFive = {{0.046910077030668004, 0.23076534494715845, 0.5, 0.76923465505284155, 0.953089922969332},
                    {0.11846344252809454, 0.23931433524968324, 0.28444444444444444, 0.23931433524968324, 0.11846344252809454}};

/// Shapes at the points of a rule.
struct Rule {
  VectorXd weight;
  MatrixXd N, dN[3];  // points x nodes
  std::vector<Vector3d> at;
};

using Points = std::vector<std::pair<Vector3d, double>>;  // with their weights

/// Bricks by products of a line's rule, wedges and tetrahedra by conical products (Stroud 1971), bricks whose sides are drawn together. n
/// points on the line are exact for polynomials of degree 2 n - 1 on a brick, 2 n - 2 on a triangle, 2 n - 3 on a tetrahedron.
Points products(SolidShape shape, const Line& line) {
  Points out;
  const std::size_t n = line.at.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t k = 0; k < n; ++k) {
        const double u = line.at[i], v = line.at[j], w = line.at[k], weight = line.weight[i] * line.weight[j] * line.weight[k];
        if (shape == SolidShape::tetra10)
          out.emplace_back(Vector3d(u, v * (1 - u), w * (1 - u) * (1 - v)), weight * (1 - u) * (1 - u) * (1 - v));
        else if (shape == SolidShape::penta15)
          out.emplace_back(Vector3d(u, v * (1 - u), 2 * w - 1), 2 * weight * (1 - u));
        else
          out.emplace_back(Vector3d(2 * u - 1, 2 * v - 1, 2 * w - 1), 8 * weight);
      }
  return out;
}

/// Where a rule is not exact, as for the stiffness of curved elements, it must not know which corner is the first: all permutations of
/// barycentric coordinates have one weight. Exact to degree 5 on triangles (Radon 1948) and tetrahedra (Stroud 1971).
Points symmetric_points(SolidShape shape) {
  struct Orbit {
    std::vector<double> at;
    double weight;
  };
  const double s = std::sqrt(15.0);
  const auto on_triangle = [](double a, double weight) { return Orbit{{a, a, 1 - 2 * a}, weight / 2}; };
  const auto on_tetrahedron = [](double a, double weight) { return Orbit{{a, a, a, 1 - 3 * a}, weight / 6}; };
  const double edge = (5 - s) / 20;
  const bool tetrahedron = shape == SolidShape::tetra10;
  std::vector<Orbit> orbits;
  if (tetrahedron)
    orbits = {{{0.25, 0.25, 0.25, 0.25}, 8.0 / 405},
              on_tetrahedron((7 - s) / 34, (2665 + 14 * s) / 37800),
              on_tetrahedron((7 + s) / 34, (2665 - 14 * s) / 37800),
              {{edge, edge, 0.5 - edge, 0.5 - edge}, 5.0 / 567}};
  else
    orbits = {
        {{1.0 / 3, 1.0 / 3, 1.0 / 3}, 9.0 / 80}, on_triangle((6 - s) / 21, (155 - s) / 1200), on_triangle((6 + s) / 21, (155 + s) / 1200)};
  Points out;
  for (Orbit& o : orbits) {
    std::sort(o.at.begin(), o.at.end());
    do {
      if (tetrahedron)
        out.emplace_back(Vector3d(o.at[0], o.at[1], o.at[2]), o.weight);
      else
        for (std::size_t k = 0; k < kThree.at.size(); ++k)
          out.emplace_back(Vector3d(o.at[0], o.at[1], 2 * kThree.at[k] - 1), 2 * o.weight * kThree.weight[k]);
    } while (std::next_permutation(o.at.begin(), o.at.end()));
  }
  return out;
}

Rule make_rule(SolidShape shape, const Points& of) {
  Rule rule;
  const auto points = static_cast<Eigen::Index>(of.size());
  rule.weight.resize(points);
  rule.N.resize(points, topology(shape).places.cols());
  for (MatrixXd& d : rule.dN) d.resizeLike(rule.N);
  for (Eigen::Index p = 0; p < points; ++p) {
    rule.at.push_back(of[static_cast<std::size_t>(p)].first), rule.weight(p) = of[static_cast<std::size_t>(p)].second;
    const SolidShapes s = shapes_at(shape, rule.at[static_cast<std::size_t>(p)]);
    rule.N.row(p) = s.N.transpose();
    for (int a = 0; a < 3; ++a) rule.dN[a].row(p) = s.dN.col(a).transpose();
  }
  return rule;
}

enum class Use { stiffness, mass };
const Rule& rule_of(SolidShape shape, Use use) {
  static const auto rules = [] {
    std::array<std::array<Rule, 2>, 4> all;
    for (const SolidShape s : {SolidShape::tetra10, SolidShape::hexa20, SolidShape::penta15, SolidShape::hexa8}) {
      const bool brick = s == SolidShape::hexa20 || s == SolidShape::hexa8;
      all[static_cast<std::size_t>(s)] = {make_rule(s, brick ? products(s, kThree) : symmetric_points(s)),
                                          make_rule(s, products(s, kFive))};
    }
    return all;
  }();
  return rules[static_cast<std::size_t>(shape)][static_cast<std::size_t>(use)];
}

/// dx / d(place) at a point of a rule.
Matrix3d jacobian(const Rule& rule, Eigen::Index p, const Matrix3Xd& x) {
  Matrix3d J;
  for (int b = 0; b < 3; ++b) J.col(b) = x * rule.dN[b].row(p).transpose();
  return J;
}

}  // namespace

const Matrix3Xd& places_of(SolidShape shape) { return topology(shape).places; }
const std::vector<std::pair<int, int>>& edges_of(SolidShape shape) { return topology(shape).edges; }
const std::vector<std::vector<int>>& faces_of(SolidShape shape) { return topology(shape).faces; }
int corners_of(SolidShape shape) { return topology(shape).corners; }
const char* name_of(SolidShape shape) { return topology(shape).name; }

SolidShapes shapes_at(SolidShape shape, const Vector3d& place) {
  const std::vector<Jet> N = jets(shape, place);
  const auto k = static_cast<Eigen::Index>(N.size());
  SolidShapes out{VectorXd(k), Eigen::MatrixX3d(k, 3)};
  for (Eigen::Index i = 0; i < k; ++i) {
    out.N(i) = N[static_cast<std::size_t>(i)].v;
    out.dN.row(i) = N[static_cast<std::size_t>(i)].d.transpose();
  }
  return out;
}

std::pair<double, double> determinants(SolidShape shape, const Matrix3Xd& x) {
  static const auto at_nodes = [] {
    std::array<std::vector<Eigen::MatrixX3d>, 4> all;
    for (std::size_t s = 0; s < all.size(); ++s) {
      const auto one = static_cast<SolidShape>(s);
      for (const auto& place : places_of(one).colwise()) all[s].push_back(shapes_at(one, place).dN);
    }
    return all;
  }();
  double least = INFINITY, most = -INFINITY;
  const auto add = [&](const Matrix3d& J) {
    const double d = J.determinant();
    least = std::min(least, d), most = std::max(most, d);
  };
  for (const Eigen::MatrixX3d& dN : at_nodes[static_cast<std::size_t>(shape)]) add(x * dN);
  for (const Use use : {Use::stiffness, Use::mass}) {
    const Rule& rule = rule_of(shape, use);
    for (Eigen::Index p = 0; p < rule.weight.size(); ++p) add(jacobian(rule, p, x));
  }
  return {least, most};
}

SolidMatrices solid_matrices(SolidShape shape, const Matrix3Xd& x, const Material& material) {
  SolidMatrices out;
  const Rule& mass = rule_of(shape, Use::mass);
  VectorXd weight = mass.weight;
  for (Eigen::Index p = 0; p < weight.size(); ++p) weight(p) *= material.rho * jacobian(mass, p, x).determinant();
  out.m = mass.N.transpose() * (weight.asDiagonal() * mass.N);
  out.m = (0.5 * (out.m + out.m.transpose())).eval();

  // Gradients in body axes, of the nodes and, behind them, of the modes 1 - xi^2, 1 - eta^2, 1 - zeta^2. Theirs, by the mapping at the
  // centre, have no mean over the element, so that they do no work in a constant strain.
  const Rule& rule = rule_of(shape, Use::stiffness);
  const Eigen::Index points = rule.weight.size(), nodes = x.cols(), extra = shape == SolidShape::hexa8 ? 3 : 0, k = nodes + extra;
  MatrixXd g[3];
  for (MatrixXd& one : g) one.resize(points, k);
  weight = rule.weight;
  const Matrix3d J0 = x * shapes_at(shape, Vector3d::Zero()).dN;
  for (Eigen::Index p = 0; p < points; ++p) {
    const Matrix3d J = jacobian(rule, p, x), into = J.inverse();
    const double det = J.determinant();
    weight(p) *= det;
    for (int a = 0; a < 3; ++a)
      g[a].row(p).head(nodes) = into(0, a) * rule.dN[0].row(p) + into(1, a) * rule.dN[1].row(p) + into(2, a) * rule.dN[2].row(p);
    if (extra == 0) continue;
    const Matrix3d from_centre = J0.inverse() * (J0.determinant() / det);
    for (int e = 0; e < 3; ++e)
      for (int a = 0; a < 3; ++a) g[a](p, nodes + e) = -2.0 * rule.at[static_cast<std::size_t>(p)](e) * from_centre(e, a);
  }
  // K_ij = sum lambda g_i g_j* + mu (g_j g_i* + g_i.g_j 1)
  const double mu = material.E / (2.0 * (1.0 + material.nu)), lambda = 2.0 * mu * material.nu / (1.0 - 2.0 * material.nu);
  MatrixXd G[3][3];
  for (int a = 0; a < 3; ++a) {
    const MatrixXd weighed = weight.asDiagonal() * g[a];
    for (int b = 0; b < 3; ++b) G[a][b] = weighed.transpose() * g[b];
  }
  const MatrixXd dot = G[0][0] + G[1][1] + G[2][2];
  MatrixXd K(3 * k, 3 * k);
  for (Eigen::Index i = 0; i < k; ++i)
    for (Eigen::Index j = 0; j < k; ++j)
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) K(3 * i + a, 3 * j + b) = lambda * G[a][b](i, j) + mu * (G[b][a](i, j) + (a == b ? dot(i, j) : 0.0));
  const Eigen::Index n = 3 * nodes;
  out.K = K.topLeftCorner(n, n);
  if (extra > 0) {
    const MatrixXd inner = K.bottomRightCorner(3 * extra, 3 * extra), coupling = K.topRightCorner(n, 3 * extra);
    out.K -= coupling * symmetric_solve(inner, MatrixXd(coupling.transpose()));
  }
  out.K = (0.5 * (out.K + out.K.transpose())).eval();
  return out;
}

}  // namespace cardan
