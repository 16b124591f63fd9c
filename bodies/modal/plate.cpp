// Flat rectangular plate elements, orthotropic, four nodes of six dofs:
// - bending: the twelve-term polynomial of Adini and Clough (1960) and Melosh (1963); complete to third order, not
// conforming,
//   passes the patch test on rectangles; frequencies converge with order 2 in the element size;
// - membrane: bilinear with the four incompatible modes of Wilson et al. (1973), condensed: exact in in-plane bending;
// - drilling: the nodal rotation about the normal follows the rotation of the membrane through a weak penalty
//   (after Hughes and Brezzi 1989). It carries no mass.
#include <Eigen/Dense>
#include <array>
#include <cmath>

#include "bodies/modal/elements.hpp"
#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::RowVectorXd;
using Eigen::Vector3d;

constexpr double kDrilling = 1e-2;  // share of the shear stiffness in the drilling penalty: enough to hold, too weak to lock

constexpr std::array<int, 12> kPowerX = {0, 1, 0, 2, 1, 0, 3, 2, 1, 0, 3, 1};
constexpr std::array<int, 12> kPowerY = {0, 0, 1, 0, 1, 2, 0, 1, 2, 3, 1, 3};

// Gauss points on (-1, 1), exact to degree 7: the square of the bending polynomial has degree 6 in each direction.
constexpr std::array<double, 4> kPlateGaussAt = {-0.86113631159405258, -0.33998104358485626, 0.33998104358485626, 0.86113631159405258};
constexpr std::array<double, 4> kPlateGaussWeight = {0.34785484513745386, 0.65214515486254614, 0.65214515486254614, 0.34785484513745386};

// Corners in the order of the element's nodes, in (-1, 1)^2.
constexpr std::array<double, 4> kCornerX = {-1, 1, 1, -1}, kCornerY = {-1, -1, 1, 1};

/// d^(i+j) / dx^i dy^j of the twelve monomials at (x, y).
RowVectorXd monomials(double x, double y, int i, int j) {
  const auto power = [](double base, int exponent, int derivatives) {
    double factor = 1.0;
    for (int d = 0; d < derivatives; ++d) factor *= exponent - d;
    return factor == 0.0 ? 0.0 : factor * std::pow(base, exponent - derivatives);
  };
  RowVectorXd p(12);
  for (int k = 0; k < 12; ++k) p(k) = power(x, kPowerX[k], i) * power(y, kPowerY[k], j);
  return p;
}

/// A rectangle 2 a x 2 b; all elements of a mesh are alike, so this is made once. Element dofs: 6 per node, body axes.
class PlateElement {
 public:
  PlateElement(double a, double b, const PlateSection& section) : a_(a), b_(b), section_(section) {
    MatrixXd values(12, 12);  // (w, theta_x = w_y, theta_y = -w_x) of each corner, per monomial
    for (int c = 0; c < 4; ++c) {
      const double x = a * kCornerX[c], y = b * kCornerY[c];
      values.row(3 * c) = monomials(x, y, 0, 0);
      values.row(3 * c + 1) = monomials(x, y, 0, 1);
      values.row(3 * c + 2) = -monomials(x, y, 1, 0);
    }
    coefficients_ = inverse(values);
    K_ = stiffness();
  }

  const MatrixXd& K() const { return K_; }

  std::vector<FeBuilder::Point> points(const Vector3d& centre) const {
    std::vector<FeBuilder::Point> out;
    each_point([&](double xi, double eta, double area) {
      FeBuilder::Point p;
      p.mass = section_.mass * area;
      p.position = centre + Vector3d(a_ * xi, b_ * eta, 0);
      p.inertia.diagonal() << section_.rotary * area, section_.rotary * area, 0;
      p.N = p.Q = MatrixXd::Zero(3, 24);
      for (int c = 0; c < 4; ++c) p.N(0, 6 * c) = p.N(1, 6 * c + 1) = 0.25 * (1 + xi * kCornerX[c]) * (1 + eta * kCornerY[c]);
      p.N.row(2) = bending(xi, eta, 0, 0);
      p.Q.row(0) = bending(xi, eta, 0, 1);
      p.Q.row(1) = -bending(xi, eta, 1, 0);
      out.push_back(std::move(p));
    });
    return out;
  }

 private:
  template <class F>
  void each_point(F&& visit) const {
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < 4; ++j) visit(kPlateGaussAt[i], kPlateGaussAt[j], kPlateGaussWeight[i] * kPlateGaussWeight[j] * a_ * b_);
  }

  /// Derivative of w over the 24 dofs.
  RowVectorXd bending(double xi, double eta, int i, int j) const {
    const RowVectorXd w = monomials(a_ * xi, b_ * eta, i, j) * coefficients_;
    RowVectorXd row = RowVectorXd::Zero(24);
    for (int c = 0; c < 4; ++c) row.segment(6 * c + 2, 3) = w.segment(3 * c, 3);
    return row;
  }

  MatrixXd stiffness() const {
    MatrixXd K = MatrixXd::Zero(28, 28);  // the last four: incompatible membrane modes u, v ~ (1 - xi^2), (1 - eta^2)
    const double drilling = kDrilling * section_.membrane(2, 2);
    each_point([&](double xi, double eta, double area) {
      MatrixXd curvature = MatrixXd::Zero(3, 28);
      curvature.row(0).head(24) = bending(xi, eta, 2, 0);
      curvature.row(1).head(24) = bending(xi, eta, 0, 2);
      curvature.row(2).head(24) = 2 * bending(xi, eta, 1, 1);
      K.noalias() += area * curvature.transpose() * section_.bending * curvature;

      MatrixXd strain = MatrixXd::Zero(3, 28);    // u_x, v_y, u_y + v_x
      RowVectorXd drill = RowVectorXd::Zero(28);  // theta_z - (v_x - u_y) / 2
      const auto add = [&](int u, int v, double f_x, double f_y) {
        strain(0, u) = f_x;
        strain(1, v) = f_y;
        strain(2, u) = f_y;
        strain(2, v) = f_x;
        drill(u) = 0.5 * f_y;
        drill(v) = -0.5 * f_x;
      };
      for (int c = 0; c < 4; ++c) {
        const double X = kCornerX[c], Y = kCornerY[c];
        add(6 * c, 6 * c + 1, 0.25 * X * (1 + eta * Y) / a_, 0.25 * Y * (1 + xi * X) / b_);
        drill(6 * c + 5) = 0.25 * (1 + xi * X) * (1 + eta * Y);
      }
      add(24, 25, -2 * xi / a_, 0.0);
      add(26, 27, 0.0, -2 * eta / b_);
      K.noalias() += area * strain.transpose() * section_.membrane * strain;
      K.noalias() += area * drilling * drill.transpose() * drill;
    });
    const MatrixXd inner = K.bottomRightCorner(4, 4), coupling = K.topRightCorner(24, 4);
    return K.topLeftCorner(24, 24) - coupling * symmetric_solve(inner, MatrixXd(coupling.transpose()));
  }

  double a_, b_;
  PlateSection section_;
  MatrixXd coefficients_, K_;
};

/// Plane stress: E t / (1 - nu^2) [1 nu 0; nu 1 0; 0 0 (1 - nu) / 2].
Matrix3d plane_stress(double Et, double nu) {
  Matrix3d A;
  A << 1, nu, 0, nu, 1, 0, 0, 0, 0.5 * (1 - nu);
  return Et / (1 - nu * nu) * A;
}

}  // namespace

PlateSection plate_section(const SolidPanel& p, bool rotary_inertia) {
  const double h = p.thickness, h3 = h * h * h / 12;
  return {plane_stress(p.material.E * h, p.material.nu), plane_stress(p.material.E * h3, p.material.nu), p.material.rho * h,
          rotary_inertia ? p.material.rho * h3 : 0.0};
}

PlateSection plate_section(const SandwichPanel& p, bool rotary_inertia) {
  const double t = p.face_thickness, h = p.core_thickness;
  const double outer = h + 2 * t, faces = (outer * outer * outer - h * h * h) / 12;  // second moment per width
  return {plane_stress(p.face.E * 2 * t, p.face.nu), plane_stress(p.face.E * faces, p.face.nu),
          2 * p.face.rho * t + p.core_density * h + p.added_mass,
          rotary_inertia ? p.face.rho * faces + p.core_density * h * h * h / 12 : 0.0};
}

std::vector<int> add_plate(FeBuilder& builder, double x0, double length, double width, int nx, int ny, const PlateSection& section) {
  const double dx = length / nx, dy = width / ny;
  std::vector<int> node;
  for (int i = 0; i <= nx; ++i)
    for (int j = 0; j <= ny; ++j) node.push_back(builder.add_node({x0 + i * dx, -0.5 * width + j * dy, 0}));
  const PlateElement element(0.5 * dx, 0.5 * dy, section);
  const auto at = [&](int i, int j) { return node[i * (ny + 1) + j]; };
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j) {
      const Vector3d centre(x0 + (i + 0.5) * dx, -0.5 * width + (j + 0.5) * dy, 0);
      builder.add_element({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)}, element.K(), element.points(centre));
    }
  const std::vector<int> xs = some_of(nx, 32), ys = some_of(ny, 12);
  for (const int j : ys) {
    std::vector<int> line;
    for (const int i : xs) line.push_back(at(i, j));
    builder.add_line(std::move(line));
  }
  for (const int i : xs) {
    std::vector<int> line;
    for (const int j : ys) line.push_back(at(i, j));
    builder.add_line(std::move(line));
  }
  return {node.begin(), node.begin() + ny + 1};
}

}  // namespace cardan
