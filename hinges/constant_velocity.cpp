// constant_velocity: two shafts at any angle that turn alike, as those of Rzeppa's joint: R = exp(theta~), theta = e1 q1 + e2 q2 across the
// shafts, so nothing turns about the line between them (homokinetic).
#include <cmath>

#include "core/abi/family.hpp"
#include "hinges/axes.hpp"

namespace cardan {
namespace {

struct ConstantVelocity {
  static constexpr const char* type = "constant_velocity";
  static constexpr const char* summary = "a tilt of shafts that turn alike: rotation vector in the plane of two axes, across the shafts";
  static constexpr int nq = 2, nv = 2;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  struct Packed {
    double E[9];  // e1, e2, n: orthonormal, or R would be no rotation
  };
  static constexpr cardan_param_desc schema[] = {
      param::required("axes", CARDAN_UNIT_VECTORS, "1", "two orthogonal axes across the shafts, in the axes of the hinge nodes", 2)};
  static constexpr const char* q_names[] = {"tilt_1", "tilt_2"};
  static constexpr const char* q_units[] = {"rad", "rad"};
  static constexpr const char* v_names[] = {"rate_1", "rate_2"};
  static constexpr const char* v_units[] = {"rad/s", "rad/s"};

  static bool pack(const Params& params, Packed& p) {
    Eigen::Vector3d e1, e2;
    if (!orthogonal_axes(params, e1, e2)) return false;
    const Eigen::Vector3d n = e1.cross(e2).normalized();
    Eigen::Map<Eigen::Matrix3d>(p.E) << e1, n.cross(e1), n;
    return true;
  }

  /// c_k(u) = sum over i of (-u)^i / (k + 2 i)!, k = 0 ... 5 (Stumpff 1956): c_1 = sin t / t, c_2 = (1 - cos t) / t^2, t^2 = u.
  struct Coefficients {
    double c[6];
    explicit Coefficients(double u) {
      if (u < 1.0) {
        double four = 1.0 / 24.0, five = 1.0 / 120.0;
        c[4] = c[5] = 0.0;
        for (int i = 0; i < 10; ++i) {
          c[4] += four, c[5] += five;
          four *= -u / ((5 + 2 * i) * (6 + 2 * i)), five *= -u / ((6 + 2 * i) * (7 + 2 * i));
        }
        c[3] = 1.0 / 6.0 - u * c[5], c[2] = 0.5 - u * c[4];
        c[1] = 1.0 - u * c[3], c[0] = 1.0 - u * c[2];
      } else {
        const double t = std::sqrt(u);
        c[0] = std::cos(t), c[1] = std::sin(t) / t;
        c[2] = (1.0 - c[0]) / u, c[3] = (1.0 - c[1]) / u;
        c[4] = (0.5 - c[2]) / u, c[5] = (1.0 / 6.0 - c[3]) / u;
      }
    }
  };

  /// omega = (1 - c_2 theta~ + c_3 theta~^2) theta', P axes. With theta x theta' = s n, n = e1 x e2: of theta'' only the columns of H* are
  /// left, as s' has q1 q2'' - q2 q1'' alone; c_2' = (2 c_4 - c_3) u' / 2, c_3' = (3 c_5 - c_4) u' / 2.
  static void kinematics(const Packed& p, const double* q, const double* v, HingeOut<2>& out) noexcept {
    const Eigen::Map<const Eigen::Matrix3d> E(p.E);
    const double a = q[0], b = q[1];
    const auto& c = Coefficients(a * a + b * b).c;
    Eigen::Matrix3d R, H;  // in these axes; H: of theta'
    R << 1.0 - c[2] * b * b, c[2] * a * b, c[1] * b, c[2] * a * b, 1.0 - c[2] * a * a, -c[1] * a, -c[1] * b, c[1] * a, c[0];
    H << 1.0 - c[3] * b * b, c[3] * a * b, 0.0, c[3] * a * b, 1.0 - c[3] * a * a, 0.0, c[2] * b, -c[2] * a, 1.0;
    out.R_OP = E * R * E.transpose();
    out.Ht.topRows<3>() = E * H.leftCols<2>();
    const double s = a * v[1] - b * v[0], half = a * v[0] + b * v[1];  // half: u' / 2
    const double d2 = (2.0 * c[4] - c[3]) * half, d3 = (3.0 * c[5] - c[4]) * half;
    out.Hdot_v.head<3>() = E * Eigen::Vector3d(d3 * b * s + c[3] * v[1] * s, -d3 * a * s - c[3] * v[0] * s, -d2 * s);
  }
};

}  // namespace
const cardan_hinge_family& constant_velocity_family() { return hinge_table<ConstantVelocity>(); }
}  // namespace cardan
