#include "core/dynamics/hinge_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "core/spatial/eigen_bridge.hpp"

namespace cardan {
namespace {

constexpr int kTurns = 20;  // of Newton's method

}  // namespace

Vec3<double> rotation_vector(const Mat3<double>& R) {
  const Eigen::Quaterniond q(to_eigen(R));
  const double length = q.vec().norm();
  const double angle = 2.0 * std::atan2(length, q.w());
  const double turn = angle > M_PI ? angle - 2.0 * M_PI : angle;
  return from_eigen(length > 0.0 ? Eigen::Vector3d(turn / length * q.vec()) : Eigen::Vector3d(2.0 * q.vec()));
}

HingeRates least_squares(const HingeColumns& A, const Eigen::Matrix<double, 6, 1>& b, double lever) {
  Eigen::Matrix<double, 6, 1> weight;
  weight << lever * lever, lever * lever, lever * lever, 1.0, 1.0, 1.0;
  if (A.cols() == 1) {
    const Eigen::Matrix<double, 6, 1> a = weight.cwiseProduct(A.col(0));
    return HingeRates::Constant(1, a.dot(b) / a.dot(A.col(0)));
  }
  return positive_solve(A.transpose() * weight.asDiagonal() * A, A.transpose() * weight.cwiseProduct(b));
}

HingeSquare positive_solve(const HingeSquare& N, const HingeSquare& B) { return N.ldlt().solve(B); }

namespace {

/// The one coordinate of a rotation or a slide in closed form. A rotation: the twist about its axis, on from where q is; what is left of
/// the pose is at right angles to the axis. False: another hinge.
bool coordinate_along(const cardan_hinge_family& f, const std::vector<double>& packed, const Pose<double>& wanted, double& q) {
  if (f.shape != CARDAN_SHAPE_ROTATION && f.shape != CARDAN_SHAPE_SLIDE) return false;
  double u[3], pitch;
  f.axis(packed.data(), u, &pitch);
  if (f.shape == CARDAN_SHAPE_SLIDE) {
    q = u[0] * wanted.p.x + u[1] * wanted.p.y + u[2] * wanted.p.z;
    return true;
  }
  const Eigen::Quaterniond turned(to_eigen(wanted.R));
  const double angle = 2.0 * std::atan2(u[0] * turned.x() + u[1] * turned.y() + u[2] * turned.z(), turned.w());
  q += std::remainder(angle - q, 2.0 * M_PI);
  return true;
}

}  // namespace

HingeFit fit_hinge(const cardan_hinge_family& f, const std::vector<double>& packed, const Pose<double>& wanted, double lever,
                   std::vector<double>& q) {
  HingeFit fit;
  const std::array<double, 6> still{};
  if (f.shape == CARDAN_SHAPE_SCREW) {  // turns beyond one are told by its way
    double u[3], pitch;
    f.axis(packed.data(), u, &pitch);
    if (pitch != 0.0) q[0] = (u[0] * wanted.p.x + u[1] * wanted.p.y + u[2] * wanted.p.z) / pitch;
  }
  const int n = static_cast<int>(f.nv);
  const auto look = [&] {
    const std::uint32_t zero = 0;
    f.kinematics(packed.data(), 1, &zero, &zero, q.data(), still.data(), &fit.out);
    const double *R = fit.out.R_OP, *p = fit.out.p_OP;
    const Mat3<double> R_OP{R[0], R[1], R[2], R[3], R[4], R[5], R[6], R[7], R[8]};
    fit.e << to_eigen(rotation_vector(transpose(R_OP) * wanted.R)),
        to_eigen(transpose_times(R_OP, wanted.p - Vec3<double>{p[0], p[1], p[2]}));
  };
  const bool found = n == 1 && coordinate_along(f, packed, wanted, q[0]);
  look();
  for (int i = 0; !found && n > 0 && i < kTurns; ++i) {
    const HingeRates step = least_squares(Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(fit.out.Ht, 6, n), fit.e, lever);
    std::array<double, 7> next{};
    if (f.retract)
      f.retract(packed.data(), q.data(), step.data(), next.data());
    else
      for (int j = 0; j < n; ++j) next[static_cast<std::size_t>(j)] = q[static_cast<std::size_t>(j)] + step[j];
    std::copy_n(next.begin(), f.nq, q.begin());
    look();
    if (step.cwiseAbs().maxCoeff<Eigen::PropagateNaN>() < 1e-13) break;
  }
  return fit;
}

}  // namespace cardan
