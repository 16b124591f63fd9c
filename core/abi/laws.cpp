#include "core/abi/laws.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cstring>
#include <random>

#include "core/abi/law_tools.hpp"
#include "core/spatial/eigen_bridge.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// ---- the table ----

constexpr std::uint32_t kMostCoordinates = 64;

void expect_shape(TableChecks& table, const cardan_hinge_family& f) {
  struct Size {
    std::uint32_t nq, nv;
  };
  constexpr Size kSizes[] = {{0, 0}, {1, 1}, {1, 1}, {1, 1}, {4, 3}, {7, 6}, {7, 6}};  // by cardan_hinge_shape, but DENSE
  table.expect(f.shape <= CARDAN_SHAPE_DENSE, "shape", fmt::format("{}, expected one of cardan_hinge_shape", f.shape));
  if (f.shape >= CARDAN_SHAPE_DENSE) return;
  const Size s = kSizes[f.shape];
  table.expect(f.nq == s.nq && f.nv == s.nv, "shape",
               fmt::format("{} has nq = {}, nv = {}, not nq = {}, nv = {}", f.shape, s.nq, s.nv, f.nq, f.nv));
  const bool axis = f.shape >= CARDAN_SHAPE_ROTATION && f.shape <= CARDAN_SHAPE_SCREW;
  table.expect(!axis || f.axis, "axis", "null, and shapes with an axis need it");
}

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

constexpr double kStep = 3e-4;       // of the differences, in a coordinate [rad, m]: h^4 / 30 and eps / h are below 1e-12
constexpr double kLeastStep = 1e-6;  // where eps / h comes near kRateLimit
constexpr double kRateLimit = 1e-9;

class HingeInstance {
 public:
  HingeInstance(const cardan_hinge_family& family, const PackedSample& packed, const TellPhase& before)
      : f_(family), packed_(packed), before_(before) {}

  /// What it wrote beyond what it was handed; empty: nothing.
  const std::string& overrun() const { return overrun_; }

  Record at(const VectorXd& q, const VectorXd& v) const {
    before_("kinematics");
    Records out(1);
    const std::uint32_t zero = 0;
    f_.kinematics(packed_.block.data(), 1, &zero, &zero, q.data(), v.data(), out.data());
    notice(out.handed, "kinematics");
    return record(out.data()[0], v.size());
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
    std::vector<double> packed(3 * packed_.bytes / sizeof(double) + 1);
    for (std::size_t k = 0; k < 3 && packed_.bytes > 0; ++k)
      std::memcpy(reinterpret_cast<char*>(packed.data()) + k * packed_.bytes, packed_.block.data(), packed_.bytes);
    Records out(3);
    f_.kinematics(packed.data(), 3, iq, iv, all_q.data(), all_v.data(), out.data());
    notice(out.handed, "kinematics of three hinges");
    return record(out.data()[1], v.size());
  }
  VectorXd qdot(const VectorXd& q, const VectorXd& v) const {
    return handed("qdot", f_.nq, [&](double* d) { f_.qdot(packed_.block.data(), q.data(), v.data(), d); });
  }
  VectorXd zero() const {
    if (!f_.zero) return VectorXd::Zero(f_.nq);
    return handed("zero", f_.nq, [&](double* q) { f_.zero(packed_.block.data(), q); });
  }
  VectorXd normalise(const VectorXd& q) const {
    if (!f_.normalise) return q;
    return handed("normalise", f_.nq, [&](double* d) {
      std::copy_n(q.data(), f_.nq, d);
      f_.normalise(packed_.block.data(), d);
    });
  }
  VectorXd retract(const VectorXd& q, const VectorXd& d) const {
    if (!f_.retract) return q + d;
    return handed("retract", f_.nq, [&](double* r) { f_.retract(packed_.block.data(), q.data(), d.data(), r); });
  }
  VectorXd difference(const VectorXd& a, const VectorXd& b) const {
    if (!f_.difference) return b - a;
    return handed("difference", f_.nv, [&](double* d) { f_.difference(packed_.block.data(), a.data(), b.data(), d); });
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
  Along along(const VectorXd& q, const VectorXd& u, const VectorXd& v, double step = kStep) const {
    const VectorXd d = qdot(q, u);
    const double size = d.size() > 0 ? d.lpNorm<Eigen::Infinity>() : 0.0;
    const double h = size > 0.0 ? step / size : 1.0;
    return {at(q - 2 * h * d, v), at(q - h * d, v), at(q + h * d, v), at(q + 2 * h * d, v), 1.0 / (12.0 * h)};
  }

 private:
  struct Records {
    Handed handed;
    explicit Records(std::size_t n) : handed(n * sizeof(cardan_hinge_out) / sizeof(double)) {}
    cardan_hinge_out* data() { return reinterpret_cast<cardan_hinge_out*>(handed.data()); }
  };
  void notice(const Handed& array, const char* call) const {
    if (overrun_.empty() && !array.intact()) overrun_ = fmt::format("{} writes beyond what it is handed", call);
  }
  template <class Call>
  VectorXd handed(const char* name, std::size_t n, const Call& call) const {
    before_(name);
    Handed out(n);
    call(out.data());
    notice(out, name);
    return out.vector();
  }

  const cardan_hinge_family& f_;
  const PackedSample& packed_;
  const TellPhase& before_;
  mutable std::string overrun_;
};

Vector3d vee(const Matrix3d& m) { return 0.5 * Vector3d(m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1)); }

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

// Sizes of coordinates and of rates, sample after sample. The first sample is `zero`.
constexpr double kCoordinates[] = {1.0, 1.0, 3.0, 10.0, 30.0}, kRateSizes[] = {1.0, 0.1, 10.0};

class HingeLaws {
 public:
  HingeLaws(const cardan_hinge_family& family, std::uint64_t seed, const TellPhase& before)
      : f_(family), rng_(seed), seed_(seed), before_(before) {
    found_.list(kPack);
    found_.list(kWrites);
    found_.list(kBatch, "its packed parameters have no size of their own");
    found_.list(kRates, "nq > nv, or it has no velocity");
    for (const char* law : kShapeLaws) found_.list(law, "its shape is CARDAN_SHAPE_DENSE");
  }

  /// False when further samples are of no use.
  bool sample(int i) {
    found_.sample = i;
    const PackedSample packed = packed_at_random(f_, seed_ + 1000u * static_cast<std::uint64_t>(i), before_);
    found_.law(kPack, packed.fault.empty(), packed.fault);
    if (!packed.fault.empty()) return false;
    const HingeInstance hinge(f_, packed, before_);
    const auto nq = static_cast<Eigen::Index>(f_.nq), nv = static_cast<Eigen::Index>(f_.nv);
    const double size = i == 0 ? 0.0 : kCoordinates[static_cast<std::size_t>(i) % std::size(kCoordinates)];
    const double rate = kRateSizes[static_cast<std::size_t>(i) % std::size(kRateSizes)];
    const VectorXd v = rate * random_vector(rng_, nv), u = rate * random_vector(rng_, nv), d = random_vector(rng_, nv);
    const VectorXd any = size * random_vector(rng_, nq), q = hinge.normalise(i == 0 ? hinge.zero() : any);
    found_.at = nq == 0 ? "" : fmt::format(", q = [{:.6g}]", fmt::join(q, ", "));
    expect(hinge, packed.block, q, v, u, d, size > 1.0);
    found_.law(kWrites, hinge.overrun().empty(), hinge.overrun());
    return hinge.overrun().empty();
  }
  std::vector<std::string> take(LawRecord* record) { return found_.take(record); }

 private:
  static constexpr const char* kBatch = "kinematics of many hinges is that of each";
  // Springs, stops, devices and couplings take q_i and v_i for one component and its rate.
  static constexpr const char* kRates = "where nq = nv, qdot is v";
  static constexpr const char* kShapeLaws[] = {"the declared shape is true: length of the axis",
                                               "the declared shape is true: R",
                                               "the declared shape is true: l",
                                               "the declared shape is true: Ht",
                                               "the declared shape is true: Hdot_v",
                                               "the declared shape is true: qdot"};

  template <class... Arguments>
  void law(const Arguments&... arguments) {
    found_.law(arguments...);
  }

  /// A law about rates, as far as differences tell. Next to a point where a hinge is singular they tell less, and what they miss shrinks
  /// with their step (by 4^4, once the step is shorter than the way to that point); what is wrong with the hinge stays. Where the error
  /// still changes at the least step, the sample tells nothing.
  template <class Along, class Error>
  void law_of_rates(const char* name, const Along& along, const Error& error, double scale) {
    const auto holds = [&](double e) { return e <= kRateLimit * (1.0 + scale); };
    const double first = error(along(kStep));
    double before = first, last = first;
    for (double step = kStep / 4.0; !holds(last) && step > kLeastStep; step /= 4.0) before = last, last = error(along(step));
    if (holds(last) || !(std::abs(last - before) > 0.1 * last)) law(name, holds(last) ? last : first, kRateLimit, scale);
  }

  void expect(const HingeInstance& hinge, const std::vector<double>& packed, const VectorXd& q, const VectorXd& v, const VectorXd& u,
              const VectorXd& d, bool far) {
    if (far && !(hinge.inside_of_domain(q, v) && hinge.inside_of_domain(q, u))) return;
    const Record r = hinge.at(q, v);
    const double l = r.l.norm(), rate = v.norm() + u.norm();
    law("R is a rotation", (r.R.transpose() * r.R - Matrix3d::Identity()).norm() + std::abs(r.R.determinant() - 1.0), 1e-13);
    const VectorXd h = r.Ht * v;
    const auto along_v = [&](double step) { return hinge.along(q, v, v, step); };
    const auto angular = [&](const HingeInstance::Along& a) {
      const Matrix3d Rdot = a.rate([](const Record& x) { return x.R; });
      return (vee(r.R.transpose() * Rdot) - h.head<3>()).norm();
    };
    const auto linear = [&](const HingeInstance::Along& a) {
      const Vector3d ldot = a.rate([](const Record& x) { return x.l; });
      return (r.R.transpose() * ldot - h.tail<3>()).norm();
    };
    const auto of_map = [&](const HingeInstance::Along& a) {
      const MatrixXd Hdot = a.rate([](const Record& x) { return x.Ht; });
      return (Hdot * v - r.Hdot_v).norm();
    };
    const double map = r.Ht.norm(), turn = map * rate;  // sizes of Ht and of its derivative
    law_of_rates("angular part of Ht v = vee(R* dR/dt)", along_v, angular, h.norm());
    law_of_rates("linear part of Ht v = R* dl/dt", along_v, linear, h.norm() + l * rate);
    law_of_rates("Hdot_v = (d/dt Ht) v", along_v, of_map, turn * v.norm() + r.Hdot_v.norm());
    const VectorXd qdot = hinge.qdot(q, v), qdot_u = hinge.qdot(q, u);
    law("qdot is linear in v", (hinge.qdot(q, v + 2.0 * u) - qdot - 2.0 * qdot_u).norm(), 1e-12, qdot.norm() + qdot_u.norm());
    if (f_.nq == f_.nv && f_.nv > 0) law(kRates, (qdot - v).norm(), 1e-12, v.norm());

    const Record other = hinge.at(q, u);
    law("R, l and Ht do not depend on v", (other.R - r.R).norm() + (other.l - r.l).norm() + (other.Ht - r.Ht).norm(), 0.0);
    law("kinematics is a function of its arguments", hinge.at(q, v).distance(r), 0.0);
    Record there;
    in_another_thread([&] { there = hinge.at(q, v); });
    law("kinematics is the same in another thread", there.distance(r), 0.0);
    if (!f_.packed_size) law(kBatch, hinge.in_batch(q, v).distance(r), 1e-14, l + map + r.Hdot_v.norm());

    const double position = q.norm();
    law("normalise leaves what is normalised", (hinge.normalise(q) - q).norm(), 1e-15, position);
    law("difference(q, retract(q, d)) = d", (hinge.difference(q, hinge.retract(q, d)) - d).norm(), 1e-12, position);
    const double e = 1e-4;
    law("retract(q, e v) moves along qdot", (hinge.retract(q, e * d) - hinge.retract(q, -e * d) - 2.0 * e * hinge.qdot(q, d)).norm() / e,
        1e-7);

    if (f_.shape < CARDAN_SHAPE_DENSE || f_.nv == 0) {
      const Declared shape = declared(f_, packed.data(), q, v, before_);
      law(kShapeLaws[0], std::abs(shape.axis - 1.0), 1e-12);
      law(kShapeLaws[1], (shape.record.R - r.R).norm(), 1e-12, position);
      law(kShapeLaws[2], (shape.record.l - r.l).norm(), 1e-12, position);
      law(kShapeLaws[3], (shape.record.Ht - r.Ht).norm(), 1e-12, position);
      law(kShapeLaws[4], (shape.record.Hdot_v - r.Hdot_v).norm(), 1e-12, position + turn * v.norm());
      law(kShapeLaws[5], (shape.qdot - qdot).norm(), 1e-12, position + rate);
    }
  }

  const cardan_hinge_family& f_;
  std::mt19937_64 rng_;
  std::uint64_t seed_;
  const TellPhase& before_;
  Violations found_;
};

}  // namespace

std::vector<std::string> hinge_table_faults(const cardan_hinge_family& f) {
  TableChecks table;
  table.text("type", f.type, true);
  table.text("summary", f.summary, false);
  for (const auto& [name, missing] : {std::pair{"pack", !f.pack}, {"kinematics", !f.kinematics}, {"qdot", !f.qdot}})
    table.expect(!missing, name, "null, and every hinge needs it");
  table.expect(f.nv <= 6 && f.nq >= f.nv && f.nq <= kMostCoordinates, "nq, nv",
               fmt::format("nq = {}, nv = {}, expected nv <= 6 and nv <= nq <= {}", f.nq, f.nv, kMostCoordinates));
  table.expect(f.params_size <= kMostBytes, "params_size", fmt::format("{}, expected at most {} bytes", f.params_size, kMostBytes));
  table.expect(f.nq <= f.nv || (f.retract && f.difference && f.normalise && f.zero), "zero, normalise, retract, difference",
               "null, and nq > nv needs all four");
  expect_shape(table, f);
  if (!table.good()) return table.take();  // counts to go by
  table.names("q_names", "q_units", f.q_names, f.q_units, f.nq);
  table.names("v_names", "v_units", f.v_names, f.v_units, f.nv);
  table.parameters(f.params, f.n_params);
  return table.take();
}

std::vector<std::string> hinge_law_violations(const cardan_hinge_family& family, int samples, std::uint64_t seed, const TellPhase& before,
                                              LawRecord* record) {
  if (auto faults = hinge_table_faults(family); !faults.empty()) return faults;
  HingeLaws laws(family, seed, before);
  for (int i = 0; i < samples; ++i)
    if (!laws.sample(i)) break;
  return laws.take(record);
}

}  // namespace cardan
