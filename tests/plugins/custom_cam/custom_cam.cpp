// The proof that a plugin hinge is a hinge like any other: a cam. One coordinate s turns the body by c s about an axis and
// carries it along the curve (s, a s^2, b sin s): R = exp(u~ c s), l = (s, a s^2, b sin s).
#include "core/abi/family.hpp"

namespace {

struct CustomCam {
  static constexpr const char* type = "custom_cam";
  static constexpr const char* summary = "cam: rotation c s about an axis, translation (s, a s^2, b sin s)";
  static constexpr int nq = 1, nv = 1;
  static constexpr auto shape = CARDAN_SHAPE_DENSE;
  struct Packed {
    double u[3], a, b, c;
  };
  static constexpr cardan_param_desc schema[] = {
      cardan::param::required("axis", CARDAN_UNIT_VECTOR, "1", "axis of the rotation, in the axes of the hinge nodes"),
      cardan::param::required("a", CARDAN_NUMBER, "1/m", "curvature of the path in y"),
      cardan::param::required("b", CARDAN_NUMBER, "m", "amplitude of the path in z"),
      cardan::param::required("c", CARDAN_NUMBER, "rad/m", "rotation per unit of s")};
  static constexpr const char* q_names[] = {"s"};
  static constexpr const char* q_units[] = {"m"};
  static constexpr const char* v_names[] = {"rate"};
  static constexpr const char* v_units[] = {"m/s"};

  static bool pack(const cardan::Params& params, Packed& p) {
    Eigen::Map<Eigen::Vector3d>(p.u) = params.vector("axis");
    p.a = params.number("a");
    p.b = params.number("b");
    p.c = params.number("c");
    return true;
  }
  static Eigen::Matrix3d tilde(const Eigen::Vector3d& u) {
    Eigen::Matrix3d t;
    t << 0, -u.z(), u.y(), u.z(), 0, -u.x(), -u.y(), u.x(), 0;
    return t;
  }
  static Eigen::Matrix3d rotation(const Packed& p, double s) {
    const Eigen::Matrix3d t = tilde(Eigen::Map<const Eigen::Vector3d>(p.u));
    return Eigen::Matrix3d::Identity() + std::sin(p.c * s) * t + (1 - std::cos(p.c * s)) * t * t;
  }
  static void kinematics(const Packed& p, const double* q, const double* v, cardan::HingeOut<1>& out) noexcept {
    const double s = q[0];
    out.R_OP = rotation(p, s);
    out.p_OP = Eigen::Vector3d(s, p.a * s * s, p.b * std::sin(s));
    out.Ht.head<3>() = p.c * Eigen::Map<const Eigen::Vector3d>(p.u);
    out.Ht.tail<3>() = out.R_OP.transpose() * Eigen::Vector3d(1, 2 * p.a * s, p.b * std::cos(s));
    out.Hdot_v.tail<3>() = map_rate(p, s) * v[0] * v[0];
  }
  /// Derivative of the linear part of the map along s; the angular part is constant.
  static Eigen::Vector3d map_rate(const Packed& p, double s) {
    const Eigen::Vector3d axis(p.u[0], p.u[1], p.u[2]), tangent(1, 2 * p.a * s, p.b * std::cos(s));
    const Eigen::Matrix3d R_PO = rotation(p, s).transpose();
    return R_PO * Eigen::Vector3d(0, 2 * p.a, -p.b * std::sin(s)) - p.c * axis.cross(R_PO * tangent);
  }
};

const void* family(const char* kind, std::uint32_t index) {
  return std::strcmp(kind, "hinge") == 0 && index == 0 ? &cardan::hinge_table<CustomCam>() : nullptr;
}
const cardan_plugin kPlugin{sizeof(cardan_plugin), CARDAN_ABI_MAJOR, CARDAN_ABI_MINOR, "custom_cam", "1.0", "Apache-2.0", family};

}  // namespace

extern "C" CARDAN_EXPORT const cardan_plugin* cardan_plugin_entry(const cardan_host* host) {
  return host->abi_major == CARDAN_ABI_MAJOR ? &kPlugin : nullptr;
}
