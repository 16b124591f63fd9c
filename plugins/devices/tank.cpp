// tank: propellant beside the dry mass of a body: m' = -(sum of what is drawn). Where it is follows from how the tank is filled; what
// it does to the vehicle as it flows, the host knows (docs/mathematics/devices.md, 5). Empty is a root: from there on nothing comes. The
// pressure is held, or that of a gas that expands as the propellant leaves, p V^n constant; the supply is p over that of the loaded tank.

#include <cmath>
#include <limits>
#include <numbers>

#include "core/abi/device_family.hpp"

namespace cardan {
namespace {

enum Shape { kSphere, kCylinder };
enum Fill { kEven, kSettled, kBall };
constexpr const char* kShapes[] = {"sphere", "cylinder"};
constexpr const char* kFills[] = {"even", "settled", "ball"};

double value(double x) { return x; }
double value(const Tangent& x) { return x.x; }

/// Height over radius of a spherical cap that fills a part f of the sphere: x^2 (3 - x) = 4 f. The last of Newton's steps is on T: at the
/// root it has the derivative of x. Where x is no smooth function of f it is constant.
template <class T>
T height_of_cap(const T& part) {
  const double f = value(part);
  if (!(f > 1e-12)) return T(0.0);
  if (f > 1.0 - 1e-12) return T(2.0);
  double x = 1.0 - 2.0 * std::cos((2.0 * std::numbers::pi - std::acos(2.0 * f - 1.0)) / 3.0);
  const auto slope = [](double h) { return (6.0 - 3.0 * h) * h; };
  for (int i = 0; i < 3; ++i) x -= (x * x * (3.0 - x) - 4.0 * f) / slope(x);
  return T(x) - (T(x * x * (3.0 - x)) - T(4.0) * part) / T(slope(x));
}
/// Square of the cube root.
template <class T>
T two_thirds_power(const T& a) {
  const double root = std::cbrt(value(a));
  if (root == 0.0) return T(0.0);
  const T r = T(root) - (T(root * root * root) - a) / T(3.0 * root * root);
  return r * r;
}

struct Tank {
  static constexpr const char* type = "tank";
  static constexpr const char* summary = "propellant, which thrusters draw from: its mass comes to that of its body, which is the dry one";
  static constexpr unsigned facts = 0;
  struct Packed {
    double position[3], axis[3], radius, length, density, residual, pressure, loaded, exponent;
    int shape, fill;
    double volume() const {
      const double disc = std::numbers::pi * radius * radius;
      return shape == kSphere ? 4.0 / 3.0 * disc * radius : disc * length;
    }
  };
  static constexpr cardan_param_desc schema[] = {
      param::optional("position", CARDAN_VECTOR, "m", "of the middle of the tank in its body"),
      param::named(param::optional("shape", CARDAN_CHOICE, "1", "of the tank"), kShapes),
      param::positive(param::required("radius", CARDAN_NUMBER, "m", "of the sphere or the cylinder")),
      param::not_negative(param::optional("length", CARDAN_NUMBER, "m", "of the cylinder")),
      param::along(param::optional("axis", CARDAN_UNIT_VECTOR, "1", "of the cylinder; from settled propellant to the gas above it"), 0, 0,
                   1),
      param::named(param::optional("fill", CARDAN_CHOICE, "1",
                                   "even: all of the tank, thinner and thinner; settled: its lower end; ball: a ball in the middle of a "
                                   "sphere"),
                   kFills),
      param::not_negative(param::optional("density", CARDAN_NUMBER, "kg/m^3",
                                          "of the propellant; not read where the fill is even and the "
                                          "pressure held")),
      param::not_negative(param::optional("residual", CARDAN_NUMBER, "kg", "what cannot be drawn")),
      param::not_negative(param::optional("pressure", CARDAN_NUMBER, "Pa", "of the gas in the loaded tank; 0: a regulator holds it")),
      param::not_negative(param::optional("loaded", CARDAN_NUMBER, "kg", "propellant at that pressure")),
      param::positive(param::optional("exponent", CARDAN_NUMBER, "1", "n of p V^n of the gas; 1: as warm as it is", 1.0))};
  static constexpr cardan_mount_desc mounts[] = {{"at", CARDAN_MOUNT_MASS, CARDAN_USE_LOAD, "the body that carries the propellant"}};
  static constexpr cardan_port_desc ports[] = {
      {"flow", CARDAN_PORT_IN, "kg/s", 0.0, 0, "drawn from it; a sum where there are several: left.flow + right.flow"},
      {"mass", CARDAN_PORT_OUT, "kg", 0.0, 0, "of the propellant"},
      {"supply", CARDAN_PORT_OUT, "1", 0.0, 0, "pressure over that of the loaded tank; 0: it is empty"}};
  static constexpr cardan_state_desc states[] = {{"propellant", "kg", 0.0, 1.0, "in the tank"}};
  static constexpr cardan_state_desc marks[] = {{"empty", "1", 0.0, 0.0, "1: nothing comes any more"}};
  static constexpr std::uint32_t n_roots = 1;

  static bool pack(const Params& params, Packed& p) {
    const Eigen::Vector3d x = params.vector("position"), u = params.vector("axis");
    p = {.position = {x[0], x[1], x[2]},
         .axis = {u[0], u[1], u[2]},
         .radius = params.number("radius"),
         .length = 0.0,
         .density = params.number("density"),
         .residual = params.number("residual"),
         .pressure = params.number("pressure"),
         .loaded = 0.0,
         .exponent = 1.0,
         .shape = params.choice("shape"),
         .fill = params.choice("fill")};
    if (p.shape == kCylinder) p.length = params.number("length");
    if (p.pressure > 0.0) p.loaded = params.number("loaded"), p.exponent = params.number("exponent");
    if (p.shape == kCylinder && !(p.length > 0.0)) return params.fail("length", "a length > 0 of a cylinder");
    if (p.fill == kBall && p.shape != kSphere) return params.fail("fill", "even or settled: a ball is in the middle of a sphere");
    if ((p.fill != kEven || p.pressure > 0.0) && !(p.density > 0.0))
      return params.fail("density", "a density > 0, from which the volume of the propellant follows");
    if (p.pressure > 0.0 && !(p.loaded > 0.0 && p.loaded < p.density * p.volume()))
      return params.fail("loaded", "a mass > 0 that leaves room for gas in the tank");
    return true;
  }

  static double size(const Packed& p) { return p.density > 0.0 ? p.density * p.volume() : 1.0; }
  static void nominal(const Packed& p, double* sizes) noexcept { sizes[0] = size(p); }

  template <class T>
  static void evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::pow;
    out.out[0] = in.z[0];
    const bool empty = in.d[0] != 0.0;
    if (!empty || in.in[0] < T(0.0)) out.zdot[0] = -in.in[0];
    if (empty) return;
    out.out[1] = T(1.0);
    if (p.pressure > 0.0) {
      const T gas = T(p.volume()) - in.z[0] / T(p.density);
      out.out[1] = value(gas) > 0.0 ? T(pow(T(p.volume() - p.loaded / p.density) / gas, p.exponent)) : T(0.0);
    }
  }

  /// About the middle of the tank along its axis: where the mass centre is, and per mass the second moments along it and across.
  template <class T>
  static CarriedMass<T> mass(const Packed& p, const DeviceIn<T>& in) noexcept {
    const T m = in.z[0];
    const double R = p.radius, R2 = R * R;
    T centre(0.0), along(R2 / 5.0), across(R2 / 5.0);
    if (p.shape == kCylinder) {
      const T height = p.fill == kEven ? T(p.length) : m / T(p.density * std::numbers::pi * R2);
      centre = (height - T(p.length)) / T(2.0);
      along = height * height / T(12.0);
      across = T(R2 / 4.0);
    } else if (p.fill == kSettled) {
      const T x = height_of_cap<T>(m / T(p.density * p.volume())), all = T(1.0) - x / T(3.0);
      const T up = x * (T(2.0 / 3.0) - x / T(4.0)) / all;  // from the lowest point, over R
      centre = T(R) * (up - T(1.0));
      along = T(R2) * (x * x * (T(0.5) - x / T(5.0)) / all - up * up);
      across = T(R2 / 4.0) * x * (T(4.0 / 3.0) - x + x * x / T(5.0)) / all;
    } else if (p.fill == kBall) {
      along = across = two_thirds_power<T>(T(3.0 / (4.0 * std::numbers::pi * p.density)) * m) / T(5.0);
    }
    const T J_across = m * (along + across), J_along = T(2.0) * m * across, more = J_along - J_across;
    const double *u = p.axis, *x = p.position;
    const auto entry = [&](int i, int j) { return (i == j ? J_across : T(0.0)) + more * T(u[i] * u[j]); };
    return {m,
            {T(x[0]) + centre * T(u[0]), T(x[1]) + centre * T(u[1]), T(x[2]) + centre * T(u[2])},
            {entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)}};
  }

  /// Where the density is known. Steps that are tried may go a little beyond.
  static bool can_carry(const Packed& p, const double* z) noexcept {
    return !(p.density > 0.0) || z[0] <= p.density * p.volume() * (1.0 + 1e-6);
  }

  /// Below zero while it is empty, so that what comes in again crosses it.
  static void roots(const Packed& p, const DeviceIn<double>& in, double* g) noexcept {
    g[0] = in.z[0] - p.residual - (in.d[0] != 0.0 ? 1e-12 * size(p) : 0.0);
  }
  static void event(const Packed& p, const DeviceIn<double>& in, std::uint32_t root, int direction, double* z, double* d) noexcept {
    if (root < n_roots) {
      d[0] = direction < 0 ? 1.0 : 0.0;
      if (direction < 0) z[0] = p.residual;
    } else {
      d[0] = in.z[0] > p.residual ? 0.0 : 1.0;
    }
  }
};

}  // namespace
const cardan_device_family& tank_family() { return device_table<Tank>(); }
}  // namespace cardan
