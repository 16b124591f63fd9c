// polyhedron: gravity of a body of one density with a surface of triangles, that turns: an asteroid by its shape (Werner, Scheeres 1997,
// Celestial Mechanics and Dynamical Astronomy 65: exterior gravitation of a polyhedron).
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "plugins/fields/harmonics.hpp"

namespace cardan {
namespace {

using Triangle = std::array<std::int64_t, 3>;

/// Corners [m] and triangles, counter-clockwise from outside.
struct Shape {
  std::vector<Eigen::Vector3d> corners;
  std::vector<Triangle> triangles;

  static Shape box(const Eigen::Vector3d& edges) {
    Shape s;
    for (int i = 0; i < 8; ++i)
      s.corners.push_back(0.5 * Eigen::Vector3d(i & 1 ? edges[0] : -edges[0], i & 2 ? edges[1] : -edges[1], i & 4 ? edges[2] : -edges[2]));
    s.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                   {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return s;
  }

  /// Lines "v x y z" and "f i j k"; or a first line with the numbers of corners and triangles, and lines of three numbers. Triangles count
  /// corners from 1, or from 0 if one has a 0. Empty `fault`: it was read.
  static Shape read(std::string_view text, double unit, std::string& fault) {
    Shape s;
    std::istringstream in{std::string(text)};
    std::size_t plain = 0, line_number = 0;  // corners without a letter
    bool counted = false, from_zero = false;
    for (std::string line; std::getline(in, line);) {
      ++line_number;
      std::istringstream words(line);
      std::string first;
      if (!(words >> first) || first[0] == '#') continue;
      const bool letter = first == "v" || first == "f";
      std::vector<double> numbers;
      if (!letter) words.seekg(0), words.clear();
      for (std::string word; words >> word;) {
        const char *from = word.data() + (word[0] == '+'), *end = word.data() + word.size();
        numbers.push_back(std::nan(""));
        if (std::from_chars(from, end, numbers.back()).ptr != end || !std::isfinite(numbers.back())) {
          fault = "\"" + word + "\" in line " + std::to_string(line_number);
          return s;
        }
      }
      if (!letter && !counted && numbers.size() == 2 && s.corners.empty()) {
        counted = true, plain = numbers[0] >= 0.0 && numbers[0] < 1e8 ? static_cast<std::size_t>(numbers[0]) : 0;
        continue;
      }
      if (numbers.size() != 3 || (!letter && !counted)) {
        fault = "line " + std::to_string(line_number) + ": " + line.substr(0, 60);
        return s;
      }
      if (first == "v" || (!letter && s.corners.size() < plain)) {
        s.corners.emplace_back(unit * Eigen::Vector3d(numbers[0], numbers[1], numbers[2]));
        continue;
      }
      Triangle triangle{};
      for (std::size_t i = 0; i < 3; ++i) {
        if (numbers[i] != std::floor(numbers[i]) || numbers[i] < 0.0 || numbers[i] > 1e8)
          fault = "a corner " + told(numbers[i]) + " in line " + std::to_string(line_number);
        if (!fault.empty()) return s;
        triangle[i] = static_cast<std::int64_t>(numbers[i]), from_zero = from_zero || triangle[i] == 0;
      }
      s.triangles.push_back(triangle);
    }
    for (Triangle& triangle : s.triangles)
      for (std::int64_t& corner : triangle) {
        if (!from_zero) --corner;
        if (corner >= static_cast<std::int64_t>(s.corners.size()))
          fault = "a triangle with the corner " + std::to_string(corner + (from_zero ? 0 : 1)) + ", of " + std::to_string(s.corners.size());
      }
    return s;
  }

  static std::string told(double x) {
    std::ostringstream out;
    out << x;
    return out.str();
  }
};

/// A side of two triangles, once: E = n_A n_12^* + n_B n_21^*, xx yy zz xy xz yz.
struct Side {
  std::int64_t from, to;
  double length, E[6];
};
struct Face {
  Triangle corners;
  double normal[3];
};

/// Beyond so many times its reach the body pulls by harmonics to this degree, which leave out less there than rounding takes of the sums.
constexpr double kFar = 10.0;
constexpr int kFarDegree = 12;

struct Polyhedron {
  static constexpr const char* type = "polyhedron";
  static constexpr const char* summary = "gravity of a body of one density with a surface of triangles, that turns";
  static constexpr std::uint32_t quantity = CARDAN_GRAVITY;
  static constexpr unsigned facts = CARDAN_FIELD_POTENTIAL | CARDAN_FIELD_SOURCE_FREE | CARDAN_FIELD_CURL_FREE;
  static constexpr double distance = 3.0;  // [m] of the laws, whose boxes are of order one
  struct Packed {
    TurningPlanet planet;
    double density, reach;  // G rho [1/s^2]; of the farthest corner from the origin of the shape [m]
    Harmonics far;
    double scale;  // of these [m^3/s^2]: mu over C_00, which is 1 but for rounding
    std::int64_t corners, sides, faces;
    // Behind it they stand one kind after the other.
    const double* corner(std::int64_t i) const { return reinterpret_cast<const double*>(this + 1) + 3 * i; }
    const Side* side() const { return reinterpret_cast<const Side*>(corner(corners)); }
    const Face* face() const { return reinterpret_cast<const Face*>(side() + sides); }
    const void* orders() const { return face() + faces; }
  };
  using Prepared = PlanetAxes;
  static constexpr cardan_param_desc schema[] = {
      param::in_range(param::required("mu", CARDAN_NUMBER, "m^3/s^2", "gravitational parameter of all of it"), 0.0,
                      std::numeric_limits<double>::infinity(), CARDAN_ABOVE),
      param::optional("shape", CARDAN_FILE, "1",
                      "lines `v x y z` of corners and `f i j k` of triangles, counter-clockwise from outside; or their numbers in a first "
                      "line and three numbers in each other"),
      param::in_range(param::optional("unit", CARDAN_NUMBER, "m", "of lengths in `shape`", 1.0), 0.0, 1e9, CARDAN_ABOVE),
      param::in_range(param::optional("box", CARDAN_VECTOR, "m", "in its place: edges of a box about the origin, along the axes"), 0.0,
                      std::numeric_limits<double>::infinity()),
      TurningPlanet::rate_desc,
      TurningPlanet::axis_desc,
      TurningPlanet::meridian_desc,
      TurningPlanet::epoch_desc,
      TurningPlanet::dut1_desc,
      TurningPlanet::orientation_desc,
      TurningPlanet::pole_x_desc,
      TurningPlanet::pole_y_desc,
      TurningPlanet::bulletin_desc,
      TurningPlanet::centre_desc};
  static constexpr cardan_limit_desc limits[] = {{"surface", 0, "inside of the body"}, TurningPlanet::bulletin_limit};

  static Shape shape_of(const Params& params, std::string& fault) {
    if (params.text("shape")) return Shape::read(params.bytes("shape"), params.number("unit"), fault);
    return Shape::box(params.vector("box"));
  }
  static std::uint64_t packed_size(const Params& params) {
    std::string fault;
    const Shape s = shape_of(params, fault);
    return sizeof(Packed) + s.corners.size() * 3 * sizeof(double) + s.triangles.size() * (sizeof(Face) + 3 * sizeof(Side) / 2) +
           sizeof(Side) + Harmonics::bytes(terms_far_away());
  }
  /// All of them, still zero.
  static std::vector<Coefficient> terms_far_away() {
    std::vector<Coefficient> all;
    for (int m = 0; m <= kFarDegree; ++m)
      for (int n = m; n <= kFarDegree; ++n) all.push_back({n, m});
    return all;
  }
  /// Those of a body of one density: C_nm + i S_nm = 1/(2 n + 1) int (r/a)^n P_nm(u) e^(i m l) dV / V. The integrand is a polynomial of
  /// degree n: a tetrahedron from the origin to a triangle has 6 V_t/(n + 3) of its integral over the triangle, exact by Gauss' points.
  static void add_masses(const Shape& s, double volume, Packed& p, void* orders) {
    constexpr double kNodes[] = {-0.9491079123427585245, -0.7415311855993944399, -0.4058451513773971669, 0.0,
                                 0.4058451513773971669,  0.7415311855993944399,  0.9491079123427585245};
    constexpr double kWeights[] = {0.1294849661688696933, 0.2797053914892766679, 0.3818300505051189449, 0.4179591836734693878,
                                   0.3818300505051189449, 0.2797053914892766679, 0.1294849661688696933};
    for (const Triangle& f : s.triangles) {
      const Eigen::Vector3d a = s.corners[f[0]] / p.reach, b = s.corners[f[1]] / p.reach, c = s.corners[f[2]] / p.reach;
      const double share = a.dot(b.cross(c)) * std::pow(p.reach, 3) / volume;
      for (int i = 0; i < 7; ++i)
        for (int j = 0; j < 7; ++j) {
          const double u = 0.5 + 0.5 * kNodes[i], v = 0.5 + 0.5 * kNodes[j];
          add_mass(0.25 * kWeights[i] * kWeights[j] * u * share, (1.0 - u) * a + u * ((1.0 - v) * b + v * c), p.far.orders, orders);
        }
    }
  }
  static void add_mass(double share, const Eigen::Vector3d& at, std::int64_t n_orders, void* orders) {
    auto* next = static_cast<unsigned char*>(orders);
    double re = 1.0, im = 0.0;  // (x + i y)^m
    for (std::int64_t m = 0; m < n_orders; ++m) {
      const auto& order = *reinterpret_cast<const Order*>(next);
      auto* terms = reinterpret_cast<Term*>(next + sizeof(Order));
      next += sizeof(Order) + static_cast<std::size_t>(order.last - m + 1) * sizeof(Term);
      double P = order.sectoral, P_before = 0.0;
      for (std::int64_t n = m; n <= order.last; ++n) {
        Term& term = terms[n - m];
        if (n > m) P_before = std::exchange(P, term.alpha * at[2] * P - term.beta * at.squaredNorm() * P_before);
        const auto degree = static_cast<double>(n);
        term.CS += share * P / ((2.0 * degree + 1.0) * (degree + 3.0)) * Pair{re, im};
      }
      im = at[0] * im + at[1] * std::exchange(re, at[0] * re - at[1] * im);
    }
  }

  static bool pack(const Params& params, Packed& p) {
    if (!p.planet.pack(params)) return false;
    const Eigen::Vector3d box = params.vector("box");
    const bool file = params.text("shape") != nullptr;
    if (file && box.norm() > 0.0) return params.fail("box", "none: `shape` is what it is");
    if (!file && !(box.minCoeff() > 0.0)) return params.fail("shape", "a file of corners and triangles, or the edges of a `box`", "none");
    std::string fault;
    const Shape s = shape_of(params, fault);
    const char* shape = file ? "shape" : "box";
    if (!fault.empty()) return params.fail(shape, "lines `v x y z` and `f i j k` of three numbers each", fault.c_str());
    p.corners = static_cast<std::int64_t>(s.corners.size()), p.faces = static_cast<std::int64_t>(s.triangles.size());
    // Each side belongs to two triangles, which go along it in opposite directions.
    std::map<std::pair<std::int64_t, std::int64_t>, std::size_t> along;
    for (std::size_t k = 0; k < s.triangles.size(); ++k)
      for (std::size_t i = 0; i < 3; ++i) {
        const std::int64_t a = s.triangles[k][i], b = s.triangles[k][(i + 1) % 3];
        if (a == b || !along.emplace(std::pair(a, b), k).second)
          return refuse(params, shape, "two triangles that go the same way along a side", k);
      }
    std::vector<Eigen::Vector3d> normals;
    double volume = 0.0;
    for (std::size_t k = 0; k < s.triangles.size(); ++k) {
      const auto [a, b, c] = s.triangles[k];
      const Eigen::Vector3d cross = (s.corners[b] - s.corners[a]).cross(s.corners[c] - s.corners[a]);
      if (!(cross.norm() > 0.0)) return refuse(params, shape, "a triangle without an area", k);
      normals.emplace_back(cross.normalized());
      volume += s.corners[a].dot(s.corners[b].cross(s.corners[c])) / 6.0;
    }
    p.sides = 0, p.reach = 0.0;
    auto* corner = reinterpret_cast<double*>(&p + 1);
    for (const Eigen::Vector3d& x : s.corners) {
      corner = std::copy_n(x.data(), 3, corner);
      p.reach = std::max(p.reach, x.norm());
    }
    auto* side = reinterpret_cast<Side*>(corner);
    for (const auto& [ends, k] : along) {
      const auto [a, b] = ends;
      const auto other = along.find({b, a});
      if (other == along.end()) return refuse(params, shape, "a side of one triangle alone", k);
      if (a > b) continue;
      const Eigen::Vector3d t = (s.corners[b] - s.corners[a]).normalized(), A = normals[k], B = normals[other->second];
      const Eigen::Matrix3d E = A * t.cross(A).transpose() - B * t.cross(B).transpose();
      side[p.sides++] = {a,
                         b,
                         (s.corners[b] - s.corners[a]).norm(),
                         {E(0, 0), E(1, 1), E(2, 2), 0.5 * (E(0, 1) + E(1, 0)), 0.5 * (E(0, 2) + E(2, 0)), 0.5 * (E(1, 2) + E(2, 1))}};
    }
    auto* face = reinterpret_cast<Face*>(side + p.sides);
    for (std::size_t k = 0; k < s.triangles.size(); ++k) face[k] = {s.triangles[k], {normals[k][0], normals[k][1], normals[k][2]}};
    if (!(volume > 0.0)) return params.fail(shape, "triangles that go counter-clockwise, seen from outside", "a body turned inside out");
    p.density = params.number("mu") / volume;
    p.far.radius = p.reach;
    p.far.write(terms_far_away(), face + p.faces);
    add_masses(s, volume, p, face + p.faces);
    const auto& first = *reinterpret_cast<const Order*>(face + p.faces);
    p.scale = params.number("mu") / reinterpret_cast<const Term*>(&first + 1)->CS[0];
    return true;
  }
  static bool refuse(const Params& params, const char* shape, const char* what, std::size_t triangle) {
    return params.fail(shape, "a closed surface of triangles, counter-clockwise from outside",
                       (std::string(what) + ", of triangle " + std::to_string(triangle + 1)).c_str());
  }

  static int prepare(const Packed& p, double t, Prepared& out) {
    out = PlanetAxes::at(p.planet, t);
    return p.planet.is_known(t) ? 0 : 2;
  }

  using V = Eigen::Vector3d;
  static V place(const Packed& p, const FieldPoint<Polyhedron, double>& at) {
    return Eigen::Map<const Eigen::Matrix3d>(at.prepared->columns).transpose() *
           (V(at.x.x, at.x.y, at.x.z) - Eigen::Map<const V>(p.planet.centre));
  }
  /// The solid angle under which a triangle is seen from x, > 0 from inside.
  static double solid_angle(const V& a, const V& b, const V& c) {
    const double A = a.norm(), B = b.norm(), C = c.norm();
    return 2.0 * std::atan2(a.dot(b.cross(c)), A * B * C + A * b.dot(c) + B * c.dot(a) + C * a.dot(b));
  }
  static V from(const V& x, const Packed& p, std::int64_t corner) { return Eigen::Map<const V>(p.corner(corner)) - x; }

  static int beyond(const Packed& p, const FieldPoint<Polyhedron, double>& at) noexcept {
    const V x = place(p, at);
    if (x.norm() > p.reach) return 0;
    double angle = 0.0;  // 4 pi inside, 0 outside
    for (std::int64_t k = 0; k < p.faces; ++k) {
      const Triangle& f = p.face()[k].corners;
      angle += solid_angle(from(x, p, f[0]), from(x, p, f[1]), from(x, p, f[2]));
    }
    return angle > 2.0 * std::numbers::pi ? 1 : 0;
  }

  /// By its sides and triangles, in axes of the shape.
  static void pull(const Packed& p, const V& x, double& U, V& a, Eigen::Matrix3d& G) noexcept {
    for (std::int64_t k = 0; k < p.sides; ++k) {
      const Side& s = p.side()[k];
      const V r = from(x, p, s.from);
      const double ends = r.norm() + from(x, p, s.to).norm(), L = std::log1p(2.0 * s.length / (ends - s.length));
      Eigen::Matrix3d E;
      E << s.E[0], s.E[3], s.E[4], s.E[3], s.E[1], s.E[5], s.E[4], s.E[5], s.E[2];
      const V Er = L * (E * r);
      U += r.dot(Er), a -= Er, G += L * E;
    }
    for (std::int64_t k = 0; k < p.faces; ++k) {
      const Face& f = p.face()[k];
      const V r = from(x, p, f.corners[0]), n(f.normal[0], f.normal[1], f.normal[2]);
      const double angle = solid_angle(r, from(x, p, f.corners[1]), from(x, p, f.corners[2])), h = n.dot(r);
      U -= angle * h * h, a += angle * h * n, G -= angle * n * n.transpose();
    }
    U *= -0.5 * p.density, a *= p.density, G *= p.density;
  }

  static void evaluate(const Packed& p, const FieldPoint<Polyhedron, double>& at, double* out, double* gradient) noexcept {
    const V x = place(p, at);
    double U = 0.0;
    V a = V::Zero();
    Eigen::Matrix3d G = Eigen::Matrix3d::Zero();
    if (x.norm() < kFar * p.reach) {
      pull(p, x, U, a, G);
    } else {
      gradient ? p.far.evaluate<true>(p.orders(), x, 0.0, U, a, G) : p.far.evaluate<false>(p.orders(), x, 0.0, U, a, G);
      U *= -p.scale, a *= p.scale, G *= p.scale;
    }
    const Eigen::Map<const Eigen::Matrix3d> R(at.prepared->columns);
    Eigen::Map<V>{out} = R * a;
    out[3] = U;
    if (!gradient) return;
    Eigen::Map<Eigen::Matrix3d>{gradient} = R * G * R.transpose();  // symmetric
    for (int i = 0; i < 3; ++i) gradient[9 + i] = -out[i];
  }
};

}  // namespace
const cardan_field_family& polyhedron_family() { return field_table<Polyhedron>(); }
}  // namespace cardan
