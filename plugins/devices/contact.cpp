// contact: two simple shapes that touch. Normal force k d^n (1 + a d') of the depth d, never a pull [Hunt & Crossley 1975, J. Applied
// Mechanics 42], friction of Coulomb that is smoothed about rest. One of the shapes is felt by balls (a sphere is one, a ring many), the
// other one tells how near a ball is. docs/mathematics/devices.md, 7.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "core/abi/device_family.hpp"
#include "core/base/impact.hpp"

namespace cardan {
namespace {

enum TouchingShape { kBallShape, kPads, kRod, kRing, kBox, kPlane, kCone, kWheel, kEllipsoid };
constexpr const char* kShapeNames[] = {"sphere", "pads", "capsule", "ring", "box", "plane", "cone", "wheel", "ellipsoid"};
constexpr int kMostBalls = 16, kMostTouches = 4 * kMostBalls;  // a ring feels both sides of another one, and the other way round

/// Can balls on the one feel the other?
constexpr bool feels(int balls, int surface) {
  switch (surface) {
    case kPlane:
      return balls != kPlane && balls != kCone;
    case kCone:
      return balls == kBallShape || balls == kPads || balls == kRod || balls == kRing;
    case kBox:
    case kRing:
      return balls == kBallShape || balls == kPads || balls == kRing;
    case kRod:
      return balls == kBallShape || balls == kPads || balls == kRing || balls == kRod;
    case kBallShape:
      return balls == kBallShape || balls == kPads;
    default:
      return false;
  }
}

template <class T>
Vec3<T> vector_of(const double (&x)[3]) {
  return {T(x[0]), T(x[1]), T(x[2])};
}
template <class T>
T length_of(const Vec3<T>& a) {
  using std::sqrt;
  return sqrt(dot(a, a));
}
template <class T>
T within(const T& x, double low, double high) {
  return x < T(low) ? T(low) : x > T(high) ? T(high) : x;
}

struct Contact {
  static constexpr const char* type = "contact";
  static constexpr const char* summary = "two simple shapes that touch: a compliant normal force with losses, and friction";
  static constexpr unsigned facts = CARDAN_FACT_INTERNAL | CARDAN_FACT_ENERGY | CARDAN_FACT_PASSIVE | CARDAN_FACT_ROUGH;
  static constexpr unsigned role = CARDAN_ROLE_FORCE;

  struct Side {
    int shape, n_balls;
    double radius, end_radius, length;
    double ball;  // radius of its balls
    double axis[3], across[3], half[3];
    double at[kMostBalls][3];  // of its balls, axes of the node
  };
  struct Packed {
    Side side[2];
    bool felt_by[2];  // do balls on this side feel the other one?
    double stiffness, exponent, dissipation, friction, width, deepest;
  };

#define CARDAN_SIDE(side)                                                                                                              \
  param::named(param::required(side "_shape", CARDAN_CHOICE, "1", "what it is there"), kShapeNames),                                   \
      param::not_negative(                                                                                                             \
          param::optional(side "_radius", CARDAN_NUMBER, "m", "of the sphere, the pads, the capsule, the ring, the cone, the wheel")), \
      param::not_negative(param::optional(side "_end_radius", CARDAN_NUMBER, "m", "of the cone at its other end; 0: a tip")),          \
      param::not_negative(                                                                                                             \
          param::optional(side "_tube", CARDAN_NUMBER, "m", "radius of what the ring is bent of, and of the rim of the wheel")),       \
      param::not_negative(                                                                                                             \
          param::optional(side "_length", CARDAN_NUMBER, "m", "of the capsule or the cone, along its axis from the node")),            \
      param::along(param::optional(side "_axis", CARDAN_UNIT_VECTOR, "1",                                                              \
                                   "of the capsule, the ring, the cone, the wheel; of the plane: outwards; axes of the node"),         \
                   0, 0, 1),                                                                                                           \
      param::not_negative(param::optional(side "_size", CARDAN_VECTOR, "m",                                                            \
                                          "of the box or the ellipsoid along the axes of the node, which is in its middle")),          \
      param::optional(side "_points", CARDAN_VECTORS, "m", "middles of the pads, at most 16; axes of the node"),                       \
      param::in_range(param::optional(side "_samples", CARDAN_INTEGER, "1", "balls that the ring is felt by", 12.0), 3.0, kMostBalls)
  static constexpr cardan_param_desc schema[] = {
      CARDAN_SIDE("from"),
      CARDAN_SIDE("to"),
      param::positive(param::required("stiffness", CARDAN_NUMBER, "N/m", "force over depth, `at_depth` deep")),
      param::in_range(param::optional("exponent", CARDAN_NUMBER, "1", "of the depth; 1.5: round bodies (Hertz)", 1.5), 1.0, 10.0),
      param::positive(
          param::optional("at_depth", CARDAN_NUMBER, "m", "where the force over depth is `stiffness`; not read with exponent 1", 1.0)),
      param::in_range(param::optional("restitution", CARDAN_NUMBER, "1", "speed after over speed before of what meets at `speed`", 1.0),
                      0.0, 1.0, CARDAN_ABOVE),
      param::not_negative(param::optional("speed", CARDAN_NUMBER, "m/s", "at which the `restitution` holds: it is more below")),
      param::not_negative(param::optional("friction", CARDAN_NUMBER, "1", "coefficient")),
      param::positive(
          param::optional("width", CARDAN_NUMBER, "m/s", "below it the friction grows in proportion to the sliding speed", 0.001)),
      param::not_negative(param::optional(
          "max_depth", CARDAN_NUMBER, "m",
          "the run ends where they are deeper in each other; 0: where the shapes no longer tell how deep, and where all of a shape "
          "is behind a plane"))};
#undef CARDAN_SIDE

  static constexpr auto kUse = CARDAN_USE_POSE | CARDAN_USE_VELOCITY | CARDAN_USE_LOAD;
  static constexpr cardan_mount_desc mounts[] = {{"from", CARDAN_MOUNT_NODE, kUse, "a node, or world: one shape"},
                                                 {"to", CARDAN_MOUNT_NODE, kUse, "a node, or world: the other one"}};
  static constexpr cardan_port_desc ports[] = {{"gap", CARDAN_PORT_OUT, "m", 0.0, 0, "least distance of the surfaces; below 0: depth"},
                                               {"force", CARDAN_PORT_OUT, "N", 0.0, 0, "normal to the surfaces, all places together"},
                                               {"friction", CARDAN_PORT_OUT, "N", 0.0, 0, "along the surfaces, all places together"},
                                               {"touching", CARDAN_PORT_OUT, "1", 0.0, 0, "1 while they touch, else 0"}};
  static constexpr std::uint32_t n_roots = kMostTouches;

  static bool pack(const Params& params, Packed& p) {
    for (int i = 0; i < 2; ++i)
      if (!pack_side(params, i == 0 ? "from" : "to", p.side[i])) return false;
    const int from = p.side[0].shape, to = p.side[1].shape;
    p.felt_by[0] = feels(from, to);
    p.felt_by[1] = feels(to, from) && !(p.felt_by[0] && from != kRing);
    if (!p.felt_by[0] && !p.felt_by[1]) return refuse_pair(params, from);
    for (int i = 0; i < 2; ++i)
      if (p.felt_by[i] && !(reach(p.side[i], p.side[1 - i]) > 0.0))
        return params.fail(i == 0 ? "from_radius" : "to_radius",
                           text_of("a radius > 0 of what touches a ", kShapeNames[p.side[1 - i].shape]).c_str());
    p.exponent = params.number("exponent");
    p.stiffness = params.number("stiffness");
    if (p.exponent != 1.0) p.stiffness *= std::pow(params.number("at_depth"), 1.0 - p.exponent);
    if (!std::isfinite(p.stiffness)) return params.fail("at_depth", "a depth at which the stiffness is a finite number of N/m^exponent");
    p.friction = params.number("friction");
    if (p.friction > 0.0) p.width = params.number("width");
    const double e = params.number("restitution"), speed = e < 1.0 ? params.number("speed") : 0.0;
    if (e < 1.0 && !(speed > 0.0)) return params.fail("speed", "the speed > 0 at which the restitution holds");
    p.dissipation = e < 1.0 ? dissipation_times_speed(e) / speed : 0.0;
    if (!std::isfinite(p.dissipation)) return params.fail("speed", "a speed at which the losses are a finite number of s/m");
    p.deepest = params.number("max_depth");
    for (int i = 0; i < 2; ++i) {
      const Side &balls = p.side[i], &surface = p.side[1 - i];
      const double most = !p.felt_by[i]                                 ? std::numeric_limits<double>::infinity()
                          : surface.shape == kPlane && p.deepest == 0.0 ? size_of(balls)
                                                                        : reach(balls, surface);
      if (p.deepest == 0.0 || p.deepest > most) p.deepest = most;
    }
    return true;
  }

  /// How near, as a number that falls as they come together, the middle of a ball may come to what the other surface is told by: a middle,
  /// a line, a circle, the surface of a box or a cone itself. From a plane it has a sign and no end.
  static double reach(const Side& balls, const Side& surface) {
    if (surface.shape == kPlane) return std::numeric_limits<double>::infinity();
    return balls.ball + thickness(surface);
  }
  /// Of all of it, in any direction: what is deeper behind a plane than this was put there. Of one point without a radius there is none.
  static double size_of(const Side& s) {
    double size = 2.0 * s.ball + (s.shape == kWheel ? 2.0 * s.radius : 2.0 * *std::ranges::max_element(s.half)), between = 0.0;
    for (int i = 0; i < s.n_balls; ++i)
      for (int k = 0; k < i; ++k)
        between = std::max(between, std::hypot(s.at[i][0] - s.at[k][0], s.at[i][1] - s.at[k][1], s.at[i][2] - s.at[k][2]));
    size = s.shape == kBox ? between : size + between;
    return size > 0.0 ? size : std::numeric_limits<double>::infinity();
  }
  /// Of the surface about what tells it.
  static double thickness(const Side& s) { return s.shape == kBallShape || s.shape == kRod || s.shape == kRing ? s.ball : 0.0; }

  static std::string text_of(const char* a, const char* b) { return std::string(a) + b; }

  static bool refuse_pair(const Params& params, int from) {
    std::string fitting;
    for (int s = 0; s <= kEllipsoid; ++s)
      if (feels(from, s) || feels(s, from)) fitting += (fitting.empty() ? "" : ", ") + std::string(kShapeNames[s]);
    return params.fail("to_shape", ("what can touch a " + std::string(kShapeNames[from]) + ": " + fitting).c_str(), nullptr,
                       "edges and flat faces are felt by `pads` on them, a rim by a `ring`; several contacts may stand side by side");
  }

  static bool pack_side(const Params& params, const std::string& name, Side& s) {
    const auto key = [&](const char* what) { return name + "_" + what; };
    const auto number = [&](const char* what) { return params.number(key(what).c_str()); };
    const auto above_0 = [&](const char* what, double x, const char* expected) {
      return x > 0.0 || params.fail(key(what).c_str(), text_of(expected, kShapeNames[s.shape]).c_str());
    };
    const auto read_radius = [&] { s.radius = s.ball = number("radius"); };
    const auto need_radius = [&] { return above_0("radius", s.radius, "a radius > 0 of a "); };
    s.shape = params.choice(key("shape").c_str());
    const Eigen::Vector3d u = params.vector(key("axis").c_str());
    const Eigen::Vector3d e = u.unitOrthogonal(), f = u.cross(e);
    const auto put = [](const Eigen::Vector3d& x, double* to) { Eigen::Vector3d::Map(to) = x; };
    put(u, s.axis), put(e, s.across);
    const auto add = [&](const Eigen::Vector3d& x) { put(x, s.at[s.n_balls++]); };
    switch (s.shape) {
      case kBallShape:
        read_radius();
        add(Eigen::Vector3d::Zero());
        return need_radius();
      case kPads: {
        read_radius();
        const int n = params.count(key("points").c_str());
        if (n < 1 || n > kMostBalls) return params.fail(key("points").c_str(), "1 to 16 points");
        for (int i = 0; i < n; ++i) add(params.vector(key("points").c_str(), i));
        return true;
      }
      case kRod:
        read_radius(), s.length = number("length");
        add(Eigen::Vector3d::Zero()), add(s.length * u);
        return need_radius() && above_0("length", s.length, "a length > 0 of a ");
      case kRing: {
        read_radius(), s.ball = number("tube");
        const int n = params.integer(key("samples").c_str());
        for (int i = 0; i < n; ++i) {
          const double angle = 2.0 * std::numbers::pi * i / n;
          add(s.radius * (std::cos(angle) * e + std::sin(angle) * f));
        }
        return need_radius();
      }
      case kWheel:  // its one ball goes where the rim is lowest
        read_radius(), s.ball = number("tube");
        add(Eigen::Vector3d::Zero());
        return need_radius();
      case kBox: {
        const Eigen::Vector3d size = params.vector(key("size").c_str());
        put(0.5 * size, s.half);
        for (int i = 0; i < 8; ++i)
          add({(i & 1 ? 0.5 : -0.5) * size.x(), (i & 2 ? 0.5 : -0.5) * size.y(), (i & 4 ? 0.5 : -0.5) * size.z()});
        return above_0("size", size.minCoeff(), "three edges > 0 of a ");
      }
      case kEllipsoid: {  // its one ball, a point, goes where it is lowest
        const Eigen::Vector3d size = params.vector(key("size").c_str());
        put(0.5 * size, s.half);
        add(Eigen::Vector3d::Zero());
        return above_0("size", size.minCoeff(), "three diameters > 0 of an ");
      }
      case kCone:
        s.radius = number("radius"), s.end_radius = number("end_radius"), s.length = number("length");
        return above_0("length", s.length, "a length > 0 of a ") &&
               above_0("radius", std::max(s.radius, s.end_radius), "a radius > 0 at one end of a ");
      default:
        return true;
    }
  }

  /// A place where they may touch, world axes.
  template <class T>
  struct Touch {
    Vec3<T> normal, point;  // from the surface to the ball; in the middle of what overlaps
    T depth;
    int ball_side;
    double share;  // of the stiffness
  };

  /// take(the point of a surface, or of what tells it, that a ball with its middle at x feels; axes of that node): one, or those on both
  /// sides of an axis that the ball is near.
  template <class T, class Take>
  static void nearest(const Side& s, const Vec3<T>& x, const Take& take) {
    const Vec3<T> u = vector_of<T>(s.axis);
    switch (s.shape) {
      case kRod:
        return take(within(dot(x, u), 0.0, s.length) * u);
      case kBox:
        return take(Vec3<T>{within(x.x, -s.half[0], s.half[0]), within(x.y, -s.half[1], s.half[1]), within(x.z, -s.half[2], s.half[2])});
      case kRing:
      case kCone: {
        const T z = dot(x, u);
        const Vec3<T> out = x - z * u;
        const T r = length_of(out);
        const Vec3<T> e = r > T(0.0) ? (T(1.0) / r) * out : vector_of<T>(s.across);
        for (const double side : {1.0, -1.0}) {
          if (s.shape == kRing) {
            take(T(side * s.radius) * e);
            continue;
          }
          const double wider = s.end_radius - s.radius;
          const T way =
              within(((T(side) * r - T(s.radius)) * T(wider) + z * T(s.length)) / T(wider * wider + s.length * s.length), 0.0, 1.0);
          take((T(side) * (T(s.radius) + T(wider) * way)) * e + (T(s.length) * way) * u);
        }
        return;
      }
      default:
        return take(Vec3<T>{T(0.0), T(0.0), T(0.0)});
    }
  }

  /// The nearest points of the lines in two capsules [Ericson 2005, Real-Time Collision Detection, 5.1.9]; of parallel ones some pair.
  template <class T>
  static void nearest_of_lines(const Vec3<T>& a, const Vec3<T>& along_a, const Vec3<T>& b, const Vec3<T>& along_b, Vec3<T>& on_a,
                               Vec3<T>& on_b) {
    const Vec3<T> w = a - b;
    const T aa = dot(along_a, along_a), ab = dot(along_a, along_b), bb = dot(along_b, along_b), aw = dot(along_a, w), bw = dot(along_b, w);
    const T det = aa * bb - ab * ab;
    T s = det > T(1e-14) * aa * bb ? within((ab * bw - aw * bb) / det, 0.0, 1.0) : T(0.5);
    const T t = within((ab * s + bw) / bb, 0.0, 1.0);
    s = within((ab * t - aw) / aa, 0.0, 1.0);
    on_a = a + s * along_a, on_b = b + t * along_b;
  }

  /// From the middle of a wheel or an ellipsoid to its lowest place over a plane with this normal; of a wheel that lies flat some place.
  template <class T>
  static Vec3<T> lowest(const Side& s, const MountMotion<T>& at, const Vec3<T>& n) {
    if (s.shape == kEllipsoid) {
      const Vec3<T> u = transpose_times(at.R_WN, n);
      const Vec3<T> half_u{T(s.half[0]) * u.x, T(s.half[1]) * u.y, T(s.half[2]) * u.z};
      const T height = length_of(half_u);
      return at.R_WN * Vec3<T>{T(-s.half[0]) * half_u.x / height, T(-s.half[1]) * half_u.y / height, T(-s.half[2]) * half_u.z / height};
    }
    const Vec3<T> u = at.R_WN * vector_of<T>(s.axis), down = dot(n, u) * u - n;
    const T length = length_of(down);
    return length > T(0.0) ? (T(s.radius) / length) * down : T(s.radius) * (at.R_WN * vector_of<T>(s.across));
  }

  /// take(index, touch) at all places, always the same ones in the same order.
  template <class T, class Take>
  static void each_touch(const Packed& p, const DeviceIn<T>& in, const Take& take) {
    int index = 0;
    // `apart`: the way to the middle of the ball from what it feels.
    const auto between = [&](int i, const Vec3<T>& middle, const Vec3<T>& apart, double share) {
      const double ball = p.side[i].ball, thick = thickness(p.side[1 - i]);
      const T d = length_of(apart);
      const Vec3<T> n = d > T(0.0) ? (T(1.0) / d) * apart : in.at[1 - i].R_WN * vector_of<T>(p.side[1 - i].axis);
      take(index++, Touch<T>{n, middle - (T(0.5) * (d + T(ball - thick))) * n, T(ball + thick) - d, i, share});
    };
    if (p.side[0].shape == kRod && p.side[1].shape == kRod) {
      Vec3<T> line[2], on[2];
      for (int i = 0; i < 2; ++i) line[i] = in.at[i].R_WN * vector_of<T>(p.side[i].at[1]);
      nearest_of_lines(in.at[0].position, line[0], in.at[1].position, line[1], on[0], on[1]);
      return between(0, on[0], on[0] - on[1], 1.0);
    }
    const bool both = p.felt_by[0] && p.felt_by[1];
    for (int i = 0; i < 2; ++i) {
      if (!p.felt_by[i]) continue;
      const Side &balls = p.side[i], &surface = p.side[1 - i];
      const MountMotion<T>&of_balls = in.at[i], &of_surface = in.at[1 - i];
      const double share = (balls.shape == kRing ? 1.0 / balls.n_balls : 1.0) * (both ? 0.5 : 1.0);
      for (int k = 0; k < balls.n_balls; ++k) {
        Vec3<T> middle = of_balls.position + of_balls.R_WN * vector_of<T>(balls.at[k]);
        if (surface.shape == kPlane) {
          const Vec3<T> n = of_surface.R_WN * vector_of<T>(surface.axis);
          if (balls.shape == kWheel || balls.shape == kEllipsoid) middle += lowest(balls, of_balls, n);
          const T height = dot(n, middle - of_surface.position);
          take(index++, Touch<T>{n, middle - (T(0.5) * (height + T(balls.ball))) * n, T(balls.ball) - height, i, share});
          continue;
        }
        const Vec3<T> x = transpose_times(of_surface.R_WN, middle - of_surface.position);
        nearest(surface, x, [&](const Vec3<T>& felt) { between(i, middle, of_surface.R_WN * (x - felt), share); });
      }
    }
  }

  /// Elastic part of the normal force.
  template <class T>
  static T elastic(const Packed& p, const Touch<T>& touch) {
    using std::pow;
    return T(p.stiffness * touch.share) * pow(touch.depth, p.exponent);
  }

  /// 1: deeper than it may be.
  template <class T>
  static int evaluate(const Packed& p, const DeviceIn<T>& in, DeviceOut<T>& out) noexcept {
    using std::tanh;
    Vec3<T> force{}, moment[2]{};  // on `from`; about each of the nodes, on the body there
    Vec3<T> R_velocity[2], R_omega[2];
    for (int i = 0; i < 2; ++i) R_velocity[i] = in.at[i].R_WN * in.at[i].velocity, R_omega[i] = in.at[i].R_WN * in.at[i].omega;
    const auto velocity_at = [&](int i, const Vec3<T>& c) { return R_velocity[i] + cross(R_omega[i], c - in.at[i].position); };
    bool too_deep = false, touching = false, first = true;
    each_touch(p, in, [&](int, const Touch<T>& touch) {
      if (first || -touch.depth < out.out[0]) out.out[0] = -touch.depth;
      first = false;
      if (!(touch.depth > T(0.0))) return;
      touching = true;
      too_deep = too_deep || !(touch.depth < T(p.deepest));
      const int i = touch.ball_side;
      const Vec3<T> v = velocity_at(i, touch.point) - velocity_at(1 - i, touch.point);
      const T closing = -dot(touch.normal, v), at_rest = elastic(p, touch), grown = T(1.0) + T(p.dissipation) * closing;
      const T normal_force = grown > T(0.0) ? T(at_rest * grown) : T(0.0);
      Vec3<T> f = normal_force * touch.normal;
      out.out[1] = out.out[1] + normal_force;
      out.lost = out.lost + (normal_force - at_rest) * closing;
      if (p.friction > 0.0) {
        const Vec3<T> sliding = v + closing * touch.normal;
        const T speed = length_of(sliding), most = T(p.friction) * normal_force;
        const T over_speed = speed > T(1e-9 * p.width) ? T(most * tanh(speed / T(p.width)) / speed) : T(most / T(p.width));
        f = f - over_speed * sliding;
        out.out[2] = out.out[2] + over_speed * speed;
        out.lost = out.lost + over_speed * speed * speed;
      }
      const Vec3<T> on_from = i == 0 ? f : -f;
      force = force + on_from;
      moment[0] = moment[0] + cross(touch.point - in.at[0].position, on_from);
      moment[1] = moment[1] - cross(touch.point - in.at[1].position, on_from);
    });
    out.out[3] = T(touching ? 1.0 : 0.0);
    out.load[0].force = transpose_times(in.at[0].R_WN, force), out.load[1].force = transpose_times(in.at[1].R_WN, -force);
    for (int i = 0; i < 2; ++i) out.load[i].moment = transpose_times(in.at[i].R_WN, moment[i]);
    return too_deep ? 1 : 0;
  }
  static const char* explain(const Packed&, int) {
    return "the shapes are deeper in each other than `max_depth` or than their radii tell, or all of one is behind a plane: they overlap "
           "at the start, `stiffness` is too little, or a step went through";
  }

  static double energy(const Packed& p, const DeviceIn<double>& in) noexcept {
    double sum = 0.0;
    each_touch(p, in, [&](int, const Touch<double>& touch) {
      if (touch.depth > 0.0) sum += elastic(p, touch) * touch.depth / (p.exponent + 1.0);
    });
    return sum;
  }

  /// Where each of the places begins and ends to touch.
  static void roots(const Packed& p, const DeviceIn<double>& in, double* g) noexcept {
    for (std::uint32_t i = 0; i < n_roots; ++i) g[i] = 1.0;
    each_touch(p, in, [&](int i, const Touch<double>& touch) { g[i] = -touch.depth; });
  }
};

}  // namespace
const cardan_device_family& contact_family() { return device_table<Contact>(); }
}  // namespace cardan
