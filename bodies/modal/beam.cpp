// Straight beam elements: axial, torsion, bending in two planes, with or without shear deformation.
// Stiffness: Przemieniecki (1968), section 5.6; shapes of the consistent mass: Friedman and Kosmatka (1993).
#include <fmt/format.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "bodies/modal/elements.hpp"
#include "bodies/modal/refuse.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::RowVector4d;
using Eigen::Vector3d;

/// Bending in one plane, dofs (v1, theta1, v2, theta2) with theta = v' where there is no shear; phi = 12 E I / (kappa G
/// A L^2).
Eigen::Matrix4d bending_stiffness(double EI, double L, double phi) {
  Eigen::Matrix4d K;
  K << 12, 6 * L, -12, 6 * L,                               //
      6 * L, (4 + phi) * L * L, -6 * L, (2 - phi) * L * L,  //
      -12, -6 * L, 12, -6 * L,                              //
      6 * L, (2 - phi) * L * L, -6 * L, (4 + phi) * L * L;
  return EI / (L * L * L * (1 + phi)) * K;
}

RowVector4d deflection(double s, double L, double phi) {  // s = x / L
  const double s2 = s * s, s3 = s2 * s;
  return RowVector4d(1 - 3 * s2 + 2 * s3 + phi * (1 - s), L * (s - 2 * s2 + s3 + 0.5 * phi * (s - s2)), 3 * s2 - 2 * s3 + phi * s,
                     L * (s3 - s2 + 0.5 * phi * (s2 - s))) /
         (1 + phi);
}

RowVector4d section_rotation(double s, double L, double phi) {
  const double s2 = s * s;
  return RowVector4d(6 / L * (s2 - s), 1 - 4 * s + 3 * s2 + phi * (1 - s), 6 / L * (s - s2), 3 * s2 - 2 * s + phi * s) / (1 + phi);
}

// Element dofs: (u, v, w, theta_x, theta_y, theta_z) of both ends. In the x-z plane the slope is -theta_y.
constexpr std::array<int, 4> kPlaneY = {1, 5, 7, 11}, kPlaneZ = {2, 4, 8, 10};
const RowVector4d kSignY(1, 1, 1, 1), kSignZ(1, -1, 1, -1);

// Gauss points on (0, 1), exact to degree 7: the square of a cubic.
constexpr std::array<double, 4> kBeamGaussAt = {0.06943184420297371, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
constexpr std::array<double, 4> kBeamGaussWeight = {0.17392742256872693, 0.32607257743127307, 0.32607257743127307, 0.17392742256872693};

}  // namespace

BeamSection rectangle_section(double y, double z, bool shear) {
  for (const auto& [name, side] : {std::pair("rectangle.width", y), std::pair("rectangle.height", z)})
    if (!(side > 0.0) || !std::isfinite(side)) refuse({}, name, Code::out_of_range, "a number > 0 [m]", fmt::format("{:g} m", side));
  const double a = std::max(y, z), b = std::min(y, z);
  // Torsion constant by Saint-Venant's series (Timoshenko and Goodier 1970, article 109): terms fall with k^-5.
  double sum = 0.0;
  for (int k = 1; k < 400; k += 2) sum += std::tanh(0.5 * k * std::numbers::pi * a / b) / std::pow(k, 5);
  const double J = a * b * b * b * (1.0 / 3.0 - 64.0 / std::pow(std::numbers::pi, 5) * b / a * sum);
  const double kappa = shear ? 5.0 / 6.0 : 0.0;
  return {y * z, y * z * z * z / 12.0, z * y * y * y / 12.0, J, kappa, kappa};
}

BeamSection tube_section(double outer_radius, double wall, bool shear) {
  constexpr double kNu = 0.3;
  if (!(outer_radius > 0.0) || !std::isfinite(outer_radius))
    refuse({}, "tube.radius", Code::out_of_range, "a number > 0 [m]", fmt::format("{:g} m", outer_radius));
  if (!(wall > 0.0 && wall <= outer_radius))
    refuse({}, "tube.wall", Code::out_of_range, fmt::format("0 < wall <= {:g} m, the outer radius (a solid rod)", outer_radius),
           fmt::format("{:g} m", wall));
  const double inner = outer_radius - wall, m2 = std::pow(inner / outer_radius, 2);
  const double I = std::numbers::pi / 4.0 * (std::pow(outer_radius, 4) - std::pow(inner, 4));
  const double kappa = 6 * (1 + kNu) * (1 + m2) * (1 + m2) / ((7 + 6 * kNu) * (1 + m2) * (1 + m2) + (20 + 12 * kNu) * m2);
  return {std::numbers::pi * (outer_radius * outer_radius - inner * inner), I, I, 2 * I, shear ? kappa : 0.0, shear ? kappa : 0.0};
}

void add_beam(FeBuilder& builder, int from, int to, const Vector3d& y_axis, const Material& material, const BeamSection& section,
              SectionInertia kept) {
  const Vector3d span = builder.node(to) - builder.node(from);
  const double L = span.norm(), E = material.E, G = E / (2 * (1 + material.nu)), A = section.area;
  Matrix3d R;  // element axes to body axes
  R.col(0) = span / L;
  R.col(2) = R.col(0).cross(y_axis).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  MatrixXd T = MatrixXd::Zero(12, 12);  // body dofs to element dofs
  for (int i = 0; i < 4; ++i) T.block<3, 3>(3 * i, 3 * i) = R.transpose();

  const auto shear = [&](double I, double kappa) { return kappa > 0 ? 12 * E * I / (kappa * G * A * L * L) : 0.0; };
  const double phi_y = shear(section.Iz, section.shear_y), phi_z = shear(section.Iy, section.shear_z);

  MatrixXd K = MatrixXd::Zero(12, 12);
  const auto bar = [&](int i, double k) { K(i, i) = K(i + 6, i + 6) = k, K(i, i + 6) = K(i + 6, i) = -k; };
  bar(0, E * A / L);
  bar(3, G * section.J / L);
  const auto plane = [&](const std::array<int, 4>& dof, const RowVector4d& sign, const Eigen::Matrix4d& k) {
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) K(dof[i], dof[j]) = sign(i) * sign(j) * k(i, j);
  };
  plane(kPlaneY, kSignY, bending_stiffness(E * section.Iz, L, phi_y));
  plane(kPlaneZ, kSignZ, bending_stiffness(E * section.Iy, L, phi_z));

  std::vector<FeBuilder::Point> points;
  for (std::size_t g = 0; g < kBeamGaussAt.size(); ++g) {
    const double s = kBeamGaussAt[g], length = kBeamGaussWeight[g] * L;
    MatrixXd N = MatrixXd::Zero(3, 12), Q = MatrixXd::Zero(3, 12);
    N(0, 0) = Q(0, 3) = 1 - s;
    N(0, 6) = Q(0, 9) = s;
    const RowVector4d v = deflection(s, L, phi_y), w = deflection(s, L, phi_z).cwiseProduct(kSignZ);
    const RowVector4d v_x = section_rotation(s, L, phi_y), w_x = section_rotation(s, L, phi_z).cwiseProduct(kSignZ);
    for (int i = 0; i < 4; ++i) {
      N(1, kPlaneY[i]) = v(i);
      Q(2, kPlaneY[i]) = v_x(i);
      N(2, kPlaneZ[i]) = w(i);
      Q(1, kPlaneZ[i]) = -w_x(i);
    }
    Vector3d J = Vector3d::Zero();
    if (kept != SectionInertia::none) J.x() = section.Iy + section.Iz;
    if (kept == SectionInertia::all) J.tail<2>() << section.Iy, section.Iz;
    const Matrix3d inertia = material.rho * length * R * J.asDiagonal() * R.transpose();
    points.push_back({material.rho * A * length, builder.node(from) + s * span, inertia, R * N * T, R * Q * T});
  }
  builder.add_element({from, to}, T.transpose() * K * T, points);
}

}  // namespace cardan
