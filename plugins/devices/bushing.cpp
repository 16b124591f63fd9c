// bushing: a mount that gives way in all six directions. x = (shift, turn) of the second node in the axes of the first one, less those at
// rest: the shift is its position, the turn its rotation vector. K x + C x' draws it back; moments follow from the work on what the
// rotation vector does, so that K x is the gradient of 1/2 x* K x at any turn. docs/mathematics/devices.md, 4.
#include <Eigen/Core>
#include <cmath>

#include "plugins/devices/readings.hpp"

namespace cardan {
namespace {

double angle_of(double sine, double cosine) { return std::atan2(sine, cosine); }
Tangent angle_of(const Tangent& sine, const Tangent& cosine) {
  return {std::atan2(sine.x, cosine.x), (cosine.x * sine.d - sine.x * cosine.d) / (sine.x * sine.x + cosine.x * cosine.x)};
}

struct Bushing {
  static constexpr const char* type = "bushing";
  static constexpr const char* summary = "a spring and a damper in all six directions between two nodes: isolator, flexure, mount";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;
  struct Packed {
    double K[6][6], C[6][6], preload[6], place[3], R[9];  // R: from the axes of `to` at rest to those of `from`
  };
  static constexpr const char* columns[] = {"x", "y", "z", "turn_x", "turn_y", "turn_z"};
  static constexpr cardan_param_desc schema[] = {
      param::not_negative(param::required("stiffness", CARDAN_VECTOR, "N/m", "along the axes of `from`; 0 beside a matrix")),
      param::not_negative(param::required("turn_stiffness", CARDAN_VECTOR, "N m/rad", "about them; 0 beside a matrix")),
      param::not_negative(param::optional("damping", CARDAN_VECTOR, "N s/m", "along them")),
      param::not_negative(param::optional("turn_damping", CARDAN_VECTOR, "N m s/rad", "about them")),
      param::named(param::optional("stiffness_matrix", CARDAN_TABLE, "1", "6 x 6, symmetric, in place of the diagonal; SI"), columns),
      param::named(param::optional("damping_matrix", CARDAN_TABLE, "1", "6 x 6, symmetric, in place of the diagonal; SI"), columns),
      param::optional("rest", CARDAN_VECTOR, "m", "of `to` from `from` where it is without stress, axes of `from`"),
      param::optional("rest_turn", CARDAN_VECTOR, "rad", "rotation vector from the axes of `from` to those of `to` there"),
      param::optional("preload", CARDAN_VECTOR, "N", "force on `to` there, axes of `from`"),
      param::optional("preload_moment", CARDAN_VECTOR, "N m", "moment on `to` there, axes of `from`")};
  static constexpr auto kUse = CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD;
  static constexpr cardan_mount_desc mounts[] = {{"from", CARDAN_MOUNT_NODE, kUse, "the node in whose axes it is described"},
                                                 {"to", CARDAN_MOUNT_NODE, kUse, "the node that it holds"}};
  static constexpr cardan_port_desc ports[] = {{"shift_x", CARDAN_PORT_OUT, "m", 0.0, 0, "of `to` from its place at rest", "from"},
                                               {"shift_y", CARDAN_PORT_OUT, "m", 0.0, 0, "of `to` from its place at rest", "from"},
                                               {"shift_z", CARDAN_PORT_OUT, "m", 0.0, 0, "of `to` from its place at rest", "from"},
                                               {"turn_x", CARDAN_PORT_OUT, "rad", 0.0, 0, "rotation vector from rest", "from"},
                                               {"turn_y", CARDAN_PORT_OUT, "rad", 0.0, 0, "rotation vector from rest", "from"},
                                               {"turn_z", CARDAN_PORT_OUT, "rad", 0.0, 0, "rotation vector from rest", "from"},
                                               {"force_x", CARDAN_PORT_OUT, "N", 0.0, 0, "on `to`", "from"},
                                               {"force_y", CARDAN_PORT_OUT, "N", 0.0, 0, "on `to`", "from"},
                                               {"force_z", CARDAN_PORT_OUT, "N", 0.0, 0, "on `to`", "from"},
                                               {"moment_x", CARDAN_PORT_OUT, "N m", 0.0, 0, "on `to`, about it", "from"},
                                               {"moment_y", CARDAN_PORT_OUT, "N m", 0.0, 0, "on `to`, about it", "from"},
                                               {"moment_z", CARDAN_PORT_OUT, "N m", 0.0, 0, "on `to`, about it", "from"}};
  static constexpr double kMostTurn = 3.0;    // [rad] near half a turn a rotation vector is of either sign
  static constexpr double kRounding = 1e-12;  // of a matrix scaled to a diagonal of 1

  /// Has A = A* no negative eigenvalues? By elimination with pivots on A scaled to a diagonal of 1: metres and radians do not mix.
  static bool semidefinite(const double (&A)[6][6]) {
    double s[6], B[6][6];
    for (int i = 0; i < 6; ++i) {
      if (A[i][i] < 0.0) return false;
      s[i] = A[i][i] > 0.0 ? 1.0 / std::sqrt(A[i][i]) : 0.0;
      for (int j = 0; s[i] == 0.0 && j < 6; ++j)
        if (A[i][j] != 0.0) return false;
    }
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j) B[i][j] = s[i] * A[i][j] * s[j];
    bool done[6] = {};
    for (int step = 0; step < 6; ++step) {
      int k = -1;
      for (int i = 0; i < 6; ++i)
        if (!done[i] && (k < 0 || B[i][i] > B[k][k])) k = i;
      done[k] = true;
      const bool none = B[k][k] <= kRounding;
      for (int i = 0; i < 6; ++i) {
        if (done[i]) continue;
        if (none && (B[i][i] < -kRounding || std::abs(B[i][k]) > 1e-6)) return false;  // |b| <= sqrt(product of two of 1e-12)
        for (int j = 0; !none && j < 6; ++j)
          if (!done[j]) B[i][j] -= B[i][k] * B[k][j] / B[k][k];
      }
      if (none && B[k][k] < -kRounding) return false;
    }
    return true;
  }

  static bool fill(const Params& params, const char* along, const char* about, const char* matrix, double (&A)[6][6]) {
    const Eigen::Vector3d a = params.vector(along), b = params.vector(about);
    for (int i = 0; i < 3; ++i) A[i][i] = a[i], A[3 + i][3 + i] = b[i];
    const auto table = params.table(matrix, 6);
    if (table.cols() == 0) return true;
    if (!a.isZero(0.0) || !b.isZero(0.0)) return params.fail(matrix, "the matrix or its diagonal by two vectors, not both");
    if (table.cols() != 6) return params.fail(matrix, "six rows");
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j) {
        const double apart = std::abs(table(i, j) - table(j, i));
        if (!(apart <= kRounding * std::sqrt(std::abs(table(i, i) * table(j, j))))) return params.fail(matrix, "a symmetric matrix");
        A[i][j] = 0.5 * (table(i, j) + table(j, i));
      }
    return semidefinite(A) || params.fail(matrix, "a matrix without negative eigenvalues");
  }
  static bool pack(const Params& params, Packed& p) {
    if (!fill(params, "stiffness", "turn_stiffness", "stiffness_matrix", p.K)) return false;
    if (!fill(params, "damping", "turn_damping", "damping_matrix", p.C)) return false;
    const Eigen::Vector3d place = params.vector("rest"), force = params.vector("preload"), moment = params.vector("preload_moment");
    const Eigen::Matrix3d R = turned(params.vector("rest_turn")).toRotationMatrix();
    for (int i = 0; i < 3; ++i) {
      p.place[i] = place[i], p.preload[i] = force[i], p.preload[3 + i] = moment[i];
      for (int j = 0; j < 3; ++j) p.R[3 * i + j] = R(i, j);
    }
    return true;
  }

  /// How `to` stands to `from`, axes of `from`.
  template <class T>
  struct Relative {
    Vec3<T> apart, turn;  // position; rotation vector from rest
    T curve;              // b of turn' = w - 1/2 turn x w + b turn x (turn x w)
    T angle;
    T x[6];
  };
  template <class T>
  static Relative<T> relative(const Packed& p, const DeviceIn<T>& in) noexcept {
    using std::sqrt;
    Relative<T> r;
    r.apart = transpose_times(in.at[0].R_WN, in.at[1].position - in.at[0].position);
    const Mat3<T> rest{T(p.R[0]), T(p.R[1]), T(p.R[2]), T(p.R[3]), T(p.R[4]), T(p.R[5]), T(p.R[6]), T(p.R[7]), T(p.R[8])};
    const Mat3<T> R = transpose(in.at[0].R_WN) * in.at[1].R_WN * transpose(rest);
    const Vec3<T> v{T(0.5) * (R.zy - R.yz), T(0.5) * (R.xz - R.zx), T(0.5) * (R.yx - R.xy)};  // sin(angle) times the axis
    const T s2 = dot(v, v), c = T(0.5) * (R.xx + R.yy + R.zz - T(1.0));
    T over_sine;                       // angle / sin(angle)
    if (s2 < T(1e-3) && c > T(0.0)) {  // what is left out of the series is below 1e-17
      over_sine = T(1.0) + s2 * (T(1.0 / 6) + s2 * (T(3.0 / 40) + s2 * (T(15.0 / 336) + s2 * (T(105.0 / 3456) + s2 * T(945.0 / 42240)))));
      r.turn = over_sine * v;
      const T a2 = dot(r.turn, r.turn);
      r.angle = T(0.0);  // small
      r.curve = T(1.0 / 12) + a2 * (T(1.0 / 720) + a2 * (T(1.0 / 30240) + a2 * T(1.0 / 1209600)));
    } else {
      const T s = sqrt(s2);
      r.angle = angle_of(s, c);
      r.turn = (r.angle / s) * v;
      r.curve = (T(1.0) - r.angle * (T(1.0) + c) / (T(2.0) * s)) / (r.angle * r.angle);
    }
    r.x[0] = r.apart.x - T(p.place[0]), r.x[1] = r.apart.y - T(p.place[1]), r.x[2] = r.apart.z - T(p.place[2]);
    r.x[3] = r.turn.x, r.x[4] = r.turn.y, r.x[5] = r.turn.z;
    return r;
  }

  /// 1: turned too far.
  template <class T>
  static int evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    const Relative<T> r = relative(p, in);
    const auto to_from = [&](const Vec3<T>& a) { return transpose_times(in.at[0].R_WN, in.at[1].R_WN * a); };
    const Vec3<T> w = to_from(in.at[1].omega) - in.at[0].omega;
    const Vec3<T> apart_rate = to_from(in.at[1].velocity) - in.at[0].velocity - cross(in.at[0].omega, r.apart);
    const Vec3<T> turn_rate = w - T(0.5) * cross(r.turn, w) + r.curve * cross(r.turn, cross(r.turn, w));
    const T rate[6] = {apart_rate.x, apart_rate.y, apart_rate.z, turn_rate.x, turn_rate.y, turn_rate.z};
    T g[6];  // that draws it back
    for (int i = 0; i < 6; ++i) {
      T elastic(-p.preload[i]), viscous(0.0);
      for (int j = 0; j < 6; ++j) elastic = elastic + T(p.K[i][j]) * r.x[j], viscous = viscous + T(p.C[i][j]) * rate[j];
      g[i] = elastic + viscous;
      out.lost = out.lost + viscous * rate[i];
    }
    const Vec3<T> f{g[0], g[1], g[2]}, n{g[3], g[4], g[5]};
    const Vec3<T> m = n + T(0.5) * cross(r.turn, n) + r.curve * cross(r.turn, cross(r.turn, n));
    out.load[0].force = f, out.load[0].moment = m + cross(r.apart, f);
    const auto on_to = [&](const Vec3<T>& a) { return transpose_times(in.at[1].R_WN, in.at[0].R_WN * -a); };
    out.load[1].force = on_to(f), out.load[1].moment = on_to(m);
    for (int i = 0; i < 6; ++i) out.out[i] = r.x[i];
    out.out[6] = -f.x, out.out[7] = -f.y, out.out[8] = -f.z, out.out[9] = -m.x, out.out[10] = -m.y, out.out[11] = -m.z;
    return r.angle > T(kMostTurn) ? 1 : 0;
  }
  static const char* explain(const Packed&, int) {
    return "its nodes are turned against each other by more than 3 rad from rest, where a rotation vector is no measure of a stiffness: "
           "`turn_stiffness` is too little or missing, or `rest_turn` is another one";
  }

  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept {
    const Relative<double> r = relative(p, in);
    double sum = 0.0;
    for (int i = 0; i < 6; ++i) {
      double elastic = 0.0;
      for (int j = 0; j < 6; ++j) elastic += p.K[i][j] * r.x[j];
      sum += (0.5 * elastic - p.preload[i]) * r.x[i];
    }
    return sum;
  }
};

}  // namespace
const cardan_device_family& bushing_family() { return device_table<Bushing>(); }
}  // namespace cardan
