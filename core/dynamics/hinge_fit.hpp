#pragma once
// Coordinates of a hinge whose two frames are given: what closes a loop, and what a body is hung on while it moves.
#include <Eigen/Core>
#include <vector>

#include "core/abi/cardan_abi.h"
#include "core/spatial/pose.hpp"

namespace cardan {

/// The rotation vector of R, of length at most pi.
Vec3<double> rotation_vector(const Mat3<double>& R);

/// A x = b in the least squares of angles times `lever` [m], at most six columns.
using HingeColumns = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;
using HingeRates = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, 6, 1>;
using HingeSquare = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 6, 6>;
HingeRates least_squares(const HingeColumns& A, const Eigen::Matrix<double, 6, 1>& b, double lever);
/// N^-1 B of a positive definite N, without memory of its own.
HingeSquare positive_solve(const HingeSquare& N, const HingeSquare& B);

/// The pose of P in O that a hinge reaches which is nearest to one that is wanted.
struct HingeFit {
  cardan_hinge_out out{};         // there, with v = 0
  Eigen::Matrix<double, 6, 1> e;  // what is left: rotation vector [rad] and shift [m], P axes
};
/// q: nq numbers, where to begin; afterwards the coordinates (Newton's method on the group). `lever` [m]: what compares angles with
/// lengths.
HingeFit fit_hinge(const cardan_hinge_family& hinge, const std::vector<double>& packed, const Pose<double>& wanted, double lever,
                   std::vector<double>& q);

}  // namespace cardan
