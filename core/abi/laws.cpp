#include "core/abi/laws.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cstring>
#include <random>

#include "core/abi/param_values.hpp"
#include "core/base/units.hpp"
#include "core/base/utf8.hpp"
#include "core/spatial/eigen_bridge.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// ---- the table ----

// What no hinge needs, and what a table of garbage has.
constexpr std::uint32_t kMostCoordinates = 64, kMostParameters = 256, kMostVectors = 1000, kMostBytes = 1 << 20;

class TableFaults {
 public:
  explicit TableFaults(const cardan_hinge_family& f) : f_(f) {}

  std::vector<std::string> all() {
    expect(f_.struct_size >= sizeof(cardan_hinge_family), "struct_size",
           fmt::format("{}, expected sizeof(cardan_hinge_family) = {}", f_.struct_size, sizeof(cardan_hinge_family)));
    if (!found_.empty()) return found_;  // what stands behind is not there
    text("type", f_.type, true);
    text("summary", f_.summary, false);
    for (const auto& [name, missing] :
         {std::pair{"pack", !f_.pack}, {"kinematics", !f_.kinematics}, {"qdot", !f_.qdot}, {"map_dot", !f_.map_dot}})
      expect(!missing, name, "null, and every hinge needs it");
    expect(f_.nv <= 6 && f_.nq >= f_.nv && f_.nq <= kMostCoordinates, "nq, nv",
           fmt::format("nq = {}, nv = {}, expected nv <= 6 and nv <= nq <= {}", f_.nq, f_.nv, kMostCoordinates));
    expect(f_.params_size <= kMostBytes, "params_size", fmt::format("{}, expected at most {} bytes", f_.params_size, kMostBytes));
    expect(f_.nq == f_.nv || (f_.retract && f_.difference && f_.normalise && f_.zero), "zero, normalise, retract, difference",
           "null, and nq > nv needs all four");
    shape();
    if (!found_.empty()) return found_;  // counts to go by
    names("q_names", "q_units", f_.q_names, f_.q_units, f_.nq);
    names("v_names", "v_units", f_.v_names, f_.v_units, f_.nv);
    parameters();
    return found_;
  }

 private:
  void expect(bool good, const std::string& member, const std::string& what) {
    if (!good) found_.push_back(member + ": " + what);
  }
  void text(const std::string& member, const char* value, bool name) {
    if (!value) return expect(false, member, "null");
    constexpr std::size_t kLongest = 1000;
    const std::string_view shown(value, strnlen(value, kLongest));
    expect(shown.size() < kLongest && printable(shown) == shown, member, "no text of one line: " + in_quotes(shown));
    expect(!name || (!shown.empty() && shown.find_first_of(" \t\"'{}[],:#&*!|>%@`") == std::string_view::npos), member,
           "a name without spaces, quotes and brackets is needed: " + in_quotes(shown));
  }
  void unit(const std::string& member, const char* value) {
    if (!value) return expect(false, member, "null; \"1\" where there is none");
    expect(parse_unit(std::string_view(value, strnlen(value, 100))).has_value(), member,
           "no unit: " + in_quotes(std::string_view(value, strnlen(value, 100))));
  }
  void names(const std::string& names_member, const std::string& units_member, const char* const* list, const char* const* units,
             std::uint32_t n) {
    if (n == 0) return;
    expect(list, names_member, "null");
    expect(units, units_member, "null");
    for (std::uint32_t i = 0; i < n; ++i) {
      if (list) text(fmt::format("{}[{}]", names_member, i), list[i], true);
      if (units) unit(fmt::format("{}[{}]", units_member, i), units[i]);
    }
  }
  void shape() {
    struct Size {
      std::uint32_t nq, nv;
    };
    constexpr Size kSizes[] = {{0, 0}, {1, 1}, {1, 1}, {1, 1}, {4, 3}, {7, 6}, {7, 6}};  // by cardan_hinge_shape, but DENSE
    expect(f_.shape <= CARDAN_SHAPE_DENSE, "shape", fmt::format("{}, expected one of cardan_hinge_shape", f_.shape));
    if (f_.shape >= CARDAN_SHAPE_DENSE) return;
    const Size s = kSizes[f_.shape];
    expect(f_.nq == s.nq && f_.nv == s.nv, "shape",
           fmt::format("{} has nq = {}, nv = {}, not nq = {}, nv = {}", f_.shape, s.nq, s.nv, f_.nq, f_.nv));
    const bool axis = f_.shape >= CARDAN_SHAPE_ROTATION && f_.shape <= CARDAN_SHAPE_SCREW;
    expect(!axis || f_.axis, "axis", "null, and shapes with an axis need it");
  }
  void parameters() {
    expect(f_.n_params <= kMostParameters, "n_params", fmt::format("{}, expected at most {}", f_.n_params, kMostParameters));
    expect(f_.n_params == 0 || f_.params, "params", "null");
    if (f_.n_params > kMostParameters || !f_.params) return;
    for (std::uint32_t i = 0; i < f_.n_params; ++i) {
      const cardan_param_desc& p = f_.params[i];
      const std::string member = fmt::format("params[{}].", i);
      text(member + "name", p.name, true);
      text(member + "meaning", p.meaning, false);
      expect(p.kind <= CARDAN_UNIT_VECTORS, member + "kind", fmt::format("{}, expected one of cardan_param_kind", p.kind));
      if (p.kind != CARDAN_TEXT) unit(member + "unit", p.unit);
      expect(p.count <= kMostVectors, member + "count", fmt::format("{}, expected at most {}", p.count, kMostVectors));
    }
  }

  const cardan_hinge_family& f_;
  std::vector<std::string> found_;
};

// ---- the functions ----

struct Record {
  Matrix3d R;
  Vector3d l;
  MatrixXd Ht;
  VectorXd Hdot_v;

  bool finite() const { return R.allFinite() && l.allFinite() && Ht.allFinite() && Hdot_v.allFinite(); }
  double distance(const Record& o) const { return (R - o.R).norm() + (l - o.l).norm() + (Ht - o.Ht).norm() + (Hdot_v - o.Hdot_v).norm(); }
};

Record record(const cardan_hinge_out& out, Eigen::Index nv) {
  return {Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.R_OP), Eigen::Map<const Vector3d>(out.p_OP),
          Eigen::Map<const MatrixXd>(out.Ht, 6, nv), Eigen::Map<const Eigen::Matrix<double, 6, 1>>(out.Hdot_v)};
}

constexpr double kStep = 3e-4;  // of the differences, in a coordinate [rad, m]: h^4 / 30 and eps / h are below 1e-12

class Instance {
 public:
  Instance(const cardan_hinge_family& family, const std::vector<double>& packed, const TellPhase& before)
      : f_(family), packed_(packed), before_(before) {}

  Record at(const VectorXd& q, const VectorXd& v) const {
    before_("kinematics");
    cardan_hinge_out out{};
    const std::uint32_t zero = 0;
    f_.kinematics(packed_.data(), 1, &zero, &zero, q.data(), v.data(), &out);
    return record(out, v.size());
  }
  /// Three of them at once, the first and the last at other coordinates: the middle one.
  Record in_batch(const VectorXd& q, const VectorXd& v) const {
    const VectorXd elsewhere = zero();
    before_("kinematics, three hinges,");
    const auto nq = static_cast<std::uint32_t>(q.size()), nv = static_cast<std::uint32_t>(v.size());
    VectorXd all_q = VectorXd::Zero(3 * q.size() + 2), all_v = VectorXd::Zero(3 * v.size() + 2);
    for (Eigen::Index k = 0; k < 3; ++k) all_q.segment(1 + k * q.size(), q.size()) = k == 1 ? q : elsewhere;
    all_v.segment(2 + v.size(), v.size()) = v;
    const std::uint32_t iq[] = {1, 1 + nq, 1 + 2 * nq}, iv[] = {2, 2 + nv, 2 + 2 * nv};
    std::vector<char> packed;
    for (int k = 0; k < 3; ++k) {
      const char* bytes = reinterpret_cast<const char*>(packed_.data());
      packed.insert(packed.end(), bytes, bytes + f_.params_size);
    }
    std::vector<double> aligned(packed.size() / sizeof(double) + 1);
    std::copy(packed.begin(), packed.end(), reinterpret_cast<char*>(aligned.data()));
    cardan_hinge_out out[3]{};
    f_.kinematics(aligned.data(), 3, iq, iv, all_q.data(), all_v.data(), out);
    return record(out[1], v.size());
  }
  VectorXd qdot(const VectorXd& q, const VectorXd& v) const {
    before_("qdot");
    VectorXd d(f_.nq);
    f_.qdot(packed_.data(), q.data(), v.data(), d.data());
    return d;
  }
  MatrixXd map_dot(const VectorXd& q, const VectorXd& u) const {
    before_("map_dot");
    MatrixXd d(6, f_.nv);
    f_.map_dot(packed_.data(), q.data(), u.data(), d.data());
    return d;
  }
  VectorXd zero() const {
    before_("zero");
    VectorXd q = VectorXd::Zero(f_.nq);
    if (f_.zero) f_.zero(packed_.data(), q.data());
    return q;
  }
  VectorXd normalise(VectorXd q) const {
    before_("normalise");
    if (f_.normalise) f_.normalise(packed_.data(), q.data());
    return q;
  }
  VectorXd retract(const VectorXd& q, const VectorXd& d) const {
    before_("retract");
    if (!f_.retract) return q + d;
    VectorXd r(f_.nq);
    f_.retract(packed_.data(), q.data(), d.data(), r.data());
    return r;
  }
  VectorXd difference(const VectorXd& a, const VectorXd& b) const {
    before_("difference");
    if (!f_.difference) return b - a;
    VectorXd d(f_.nv);
    f_.difference(packed_.data(), a.data(), b.data(), d.data());
    return d;
  }
  /// Is the record finite here and half a rad or m to either side along N(q) u? Nearer to the border of a domain than
  /// that, differences tell nothing.
  bool inside_of_domain(const VectorXd& q, const VectorXd& u) const {
    const VectorXd d = qdot(q, u);
    const double size = d.size() > 0 ? d.lpNorm<Eigen::Infinity>() : 0.0;
    const VectorXd step = size > 0.0 ? VectorXd(0.5 / size * d) : VectorXd(VectorXd::Zero(q.size()));
    return q.allFinite() && at(q - step, u).finite() && at(q, u).finite() && at(q + step, u).finite();
  }
  /// The records at q - 2h, q - h, q + h, q + 2h along q' = N(q) u, and the factor that makes their fourth-order
  /// difference d/dt.
  struct Along {
    Record m2, m1, p1, p2;
    double factor;

    template <class G>
    auto rate(const G& g) const {
      return (factor * (8.0 * (g(p1) - g(m1)) - (g(p2) - g(m2)))).eval();
    }
  };
  Along along(const VectorXd& q, const VectorXd& u, const VectorXd& v) const {
    const VectorXd d = qdot(q, u);
    const double size = d.size() > 0 ? d.lpNorm<Eigen::Infinity>() : 0.0;
    const double h = size > 0.0 ? kStep / size : 1.0;
    return {at(q - 2 * h * d, v), at(q - h * d, v), at(q + h * d, v), at(q + 2 * h * d, v), 1.0 / (12.0 * h)};
  }

 private:
  const cardan_hinge_family& f_;
  const std::vector<double>& packed_;
  const TellPhase& before_;
};

Vector3d vee(const Matrix3d& m) { return 0.5 * Vector3d(m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)); }

VectorXd random_vector(std::mt19937_64& rng, Eigen::Index n) {
  VectorXd v(n);
  for (Eigen::Index i = 0; i < n; ++i) v[i] = -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53;
  return v;
}

/// What the sweeps compute for a declared shape, by their own formulas and not by the family's functions.
struct Declared {
  Record record;
  VectorXd qdot;
  double axis = 1.0;  // its length
};
Declared declared(const cardan_hinge_family& f, const void* packed, const VectorXd& q, const VectorXd& v, const TellPhase& before) {
  const auto nv = static_cast<Eigen::Index>(f.nv);
  Declared d{{Matrix3d::Identity(), Vector3d::Zero(), MatrixXd::Zero(6, nv), VectorXd::Zero(6)}, v};
  if (f.nv == 0) return d;
  if (f.shape <= CARDAN_SHAPE_SCREW) {
    double axis[3]{}, pitch = 0.0;
    before("axis");
    f.axis(packed, axis, &pitch);
    const Vector3d a(axis[0], axis[1], axis[2]);
    d.axis = a.norm();
    const double advance = f.shape == CARDAN_SHAPE_SLIDE ? 1.0 : f.shape == CARDAN_SHAPE_SCREW ? pitch : 0.0;
    if (f.shape != CARDAN_SHAPE_SLIDE) {
      d.record.R = to_eigen(rotation_about(from_eigen(a), std::sin(q[0]), std::cos(q[0])));
      d.record.Ht.topRows<3>() = a;
    }
    d.record.l = advance * q[0] * a;
    d.record.Ht.bottomRows<3>() = advance * a;
    return d;
  }
  const Vector3d omega = v.head<3>();  // of P in O, P axes
  d.record.R = to_eigen(rotation_of_quaternion(q[0], q[1], q[2], q[3]));
  d.record.Ht.topLeftCorner<3, 3>().setIdentity();
  const Vector3d vector = q.segment<3>(1);
  d.qdot.resize(f.nq);
  d.qdot[0] = -0.5 * vector.dot(omega);  // q' = q o (0, omega) / 2
  d.qdot.segment<3>(1) = 0.5 * (q[0] * omega + vector.cross(omega));
  if (f.shape == CARDAN_SHAPE_BALL) return d;
  const Vector3d linear = v.tail<3>();
  const bool in_O = f.shape == CARDAN_SHAPE_FREE;
  d.record.l = q.tail<3>();
  d.qdot.tail<3>() = in_O ? linear : d.record.R * linear;
  d.record.Ht.bottomRightCorner<3, 3>() = in_O ? Matrix3d(d.record.R.transpose()) : Matrix3d(Matrix3d::Identity());
  if (in_O) d.record.Hdot_v.tail<3>() = -omega.cross(d.record.R.transpose() * linear);
  return d;
}

ParamTable random_parameters(const cardan_hinge_family& family, std::mt19937_64& rng, bool orthonormal) {
  ParamTable table;
  for (std::uint32_t i = 0; i < family.n_params; ++i) {
    const auto& d = family.params[i];
    const std::uint32_t n_vectors = d.kind == CARDAN_VECTOR || d.kind == CARDAN_UNIT_VECTOR ? 1u : d.count ? d.count : 1u;
    if (d.kind == CARDAN_TEXT) {  // optional texts stay absent
      if (d.required) table.texts[d.name] = "";
      continue;
    }
    if (d.kind == CARDAN_NUMBER) {
      table.numbers[d.name] = {0.3 + 0.7 * std::abs(random_vector(rng, 1)[0])};
      continue;
    }
    MatrixXd m(3, n_vectors);
    for (std::uint32_t k = 0; k < n_vectors; ++k) m.col(k) = random_vector(rng, 3);
    if (orthonormal && n_vectors <= 3) m = Eigen::HouseholderQR<MatrixXd>(m).householderQ() * MatrixXd::Identity(3, n_vectors);
    if (d.kind == CARDAN_UNIT_VECTOR || d.kind == CARDAN_UNIT_VECTORS) m.colwise().normalize();
    table.numbers[d.name].assign(m.data(), m.data() + m.size());
  }
  return table;
}

/// pack() into a block of params_size bytes with a margin; empty if it refuses.
struct Packed {
  std::vector<double> block;
  std::string fault;  // it wrote into the margin
};
Packed packed_with_margin(const cardan_hinge_family& family, ParamTable table) {
  constexpr std::size_t kMargin = 4096;
  constexpr unsigned char kMark = 0xA5;
  Packed out{std::vector<double>((family.params_size + kMargin) / sizeof(double) + 1), {}};
  auto* bytes = reinterpret_cast<unsigned char*>(out.block.data());
  std::memset(bytes + family.params_size, kMark, out.block.size() * sizeof(double) - family.params_size);
  const cardan_param_values values = table.view();
  if (family.pack(&values, bytes) != 0) return {};
  std::size_t end = out.block.size() * sizeof(double);
  while (end > family.params_size && bytes[end - 1] == kMark) --end;
  if (end > family.params_size) out.fault = fmt::format("pack writes {} bytes, params_size is {}", end, family.params_size);
  out.block.resize((family.params_size + sizeof(double) - 1) / sizeof(double) + 1);
  return out;
}

Packed random_instance(const cardan_hinge_family& family, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  for (const bool orthonormal : {false, true})
    if (Packed packed = packed_with_margin(family, random_parameters(family, rng, orthonormal)); !packed.block.empty()) return packed;
  return {};
}

// Sizes of coordinates and of rates, sample after sample. The first sample is `zero`.
constexpr double kCoordinates[] = {1.0, 1.0, 3.0, 10.0, 30.0}, kRates[] = {1.0, 0.1, 10.0};

class Laws {
 public:
  Laws(const cardan_hinge_family& family, std::uint64_t seed, const TellPhase& before)
      : f_(family), rng_(seed), seed_(seed), before_(before) {}

  /// False when further samples are of no use.
  bool sample(int i) {
    sample_ = i;
    before_("pack");
    const Packed packed = random_instance(f_, seed_ + 1000u * static_cast<std::uint64_t>(i));
    if (packed.block.empty() || !packed.fault.empty()) {
      found_ = {packed.block.empty() ? "pack refuses every set of random parameters" : packed.fault};
      return false;
    }
    const Instance hinge(f_, packed.block, before_);
    const auto nq = static_cast<Eigen::Index>(f_.nq), nv = static_cast<Eigen::Index>(f_.nv);
    const double size = i == 0 ? 0.0 : kCoordinates[static_cast<std::size_t>(i) % std::size(kCoordinates)];
    const double rate = kRates[static_cast<std::size_t>(i) % std::size(kRates)];
    const VectorXd v = rate * random_vector(rng_, nv), u = rate * random_vector(rng_, nv), d = random_vector(rng_, nv);
    const VectorXd any = size * random_vector(rng_, nq), q = hinge.normalise(i == 0 ? hinge.zero() : any);
    expect(hinge, packed.block, q, v, u, d, size > 1.0);
    return true;
  }
  std::vector<std::string> take() { return std::move(found_); }

 private:
  /// `scale` is the size of what was subtracted, so that the limit is one of relative precision.
  void law(const char* name, double error, double limit, double scale = 0.0) {
    error /= 1.0 + scale;
    if (!(error <= limit)) found_.push_back(fmt::format("{}: error {:.2g} (limit {:.0e}, sample {})", name, error, limit, sample_));
  }

  void expect(const Instance& hinge, const std::vector<double>& packed, const VectorXd& q, const VectorXd& v, const VectorXd& u,
              const VectorXd& d, bool far) {
    if (far && !(hinge.inside_of_domain(q, v) && hinge.inside_of_domain(q, u))) return;
    const Record r = hinge.at(q, v);
    const auto of_v = hinge.along(q, v, v), of_u = hinge.along(q, u, v);
    const double l = r.l.norm(), rate = v.norm() + u.norm();
    law("R is a rotation", (r.R.transpose() * r.R - Matrix3d::Identity()).norm() + std::abs(r.R.determinant() - 1.0), 1e-13);
    const VectorXd h = r.Ht * v;
    const Matrix3d Rdot = of_v.rate([](const Record& x) { return x.R; });
    const Vector3d ldot = of_v.rate([](const Record& x) { return x.l; });
    law("angular part of Ht v = vee(R* dR/dt)", (vee(r.R.transpose() * Rdot) - h.head<3>()).norm(), 1e-9, h.norm());
    law("linear part of Ht v = R* dl/dt", (r.R.transpose() * ldot - h.tail<3>()).norm(), 1e-9, h.norm() + l * rate);
    const double map = r.Ht.norm(), turn = map * rate;  // sizes of Ht and of its derivative
    const MatrixXd Hdot = of_v.rate([](const Record&x) { return x.Ht; }), Hdot_u = of_u.rate([](const Record&x) { return x.Ht; });
    const MatrixXd map_v = hinge.map_dot(q, v), map_u = hinge.map_dot(q, u);
    law("Hdot_v = (d/dt Ht) v", (Hdot * v - r.Hdot_v).norm(), 1e-9, turn * v.norm() + r.Hdot_v.norm());
    law("map_dot(q, v) v = Hdot_v", (map_v * v - r.Hdot_v).norm(), 1e-12, map_v.norm() * v.norm() + turn * v.norm());
    law("map_dot(q, u) is the derivative of Ht along u", (map_u - Hdot_u).norm(), 1e-9, turn + map_u.norm());
    law("map_dot is linear in u", (hinge.map_dot(q, v + 2.0 * u) - map_v - 2.0 * map_u).norm(), 1e-12, map_v.norm() + map_u.norm() + turn);
    const VectorXd qdot = hinge.qdot(q, v), qdot_u = hinge.qdot(q, u);
    law("qdot is linear in v", (hinge.qdot(q, v + 2.0 * u) - qdot - 2.0 * qdot_u).norm(), 1e-12, qdot.norm() + qdot_u.norm());

    const Record other = hinge.at(q, u);
    law("R, l and Ht do not depend on v", (other.R - r.R).norm() + (other.l - r.l).norm() + (other.Ht - r.Ht).norm(), 0.0);
    law("kinematics is a function of its arguments", hinge.at(q, v).distance(r), 0.0);
    law("kinematics of many hinges is that of each", hinge.in_batch(q, v).distance(r), 1e-14, l + map + r.Hdot_v.norm());

    const double position = q.norm();
    law("normalise leaves what is normalised", (hinge.normalise(q) - q).norm(), 1e-15, position);
    law("difference(q, retract(q, d)) = d", (hinge.difference(q, hinge.retract(q, d)) - d).norm(), 1e-12, position);
    const double e = 1e-4;
    law("retract(q, e v) moves along qdot", (hinge.retract(q, e * d) - hinge.retract(q, -e * d) - 2.0 * e * hinge.qdot(q, d)).norm() / e,
        1e-7);

    if (f_.shape < CARDAN_SHAPE_DENSE || f_.nv == 0) {
      const Declared shape = declared(f_, packed.data(), q, v, before_);
      law("the declared shape is true: length of the axis", std::abs(shape.axis - 1.0), 1e-12);
      law("the declared shape is true: R", (shape.record.R - r.R).norm(), 1e-12, position);
      law("the declared shape is true: l", (shape.record.l - r.l).norm(), 1e-12, position);
      law("the declared shape is true: Ht", (shape.record.Ht - r.Ht).norm(), 1e-12, position);
      law("the declared shape is true: Hdot_v", (shape.record.Hdot_v - r.Hdot_v).norm(), 1e-12, position + turn * v.norm());
      law("the declared shape is true: qdot", (shape.qdot - qdot).norm(), 1e-12, position + rate);
    }
  }

  const cardan_hinge_family& f_;
  std::mt19937_64 rng_;
  std::uint64_t seed_;
  const TellPhase& before_;
  int sample_ = 0;
  std::vector<std::string> found_;
};

}  // namespace

std::vector<std::string> hinge_table_faults(const cardan_hinge_family& family) { return TableFaults(family).all(); }

std::vector<std::string> hinge_law_violations(const cardan_hinge_family& family, int samples, std::uint64_t seed, const TellPhase& before) {
  if (auto faults = hinge_table_faults(family); !faults.empty()) return faults;
  Laws laws(family, seed, before);
  for (int i = 0; i < samples; ++i)
    if (!laws.sample(i)) break;
  return laws.take();
}

}  // namespace cardan
