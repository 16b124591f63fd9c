#include "core/abi/laws.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <random>

#include "core/abi/param_values.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

struct Record {
  Matrix3d R;
  Vector3d l;
  MatrixXd Ht;
  VectorXd Hdot_v;
};

class Instance {
 public:
  Instance(const cardan_hinge_family& family, const std::vector<double>& packed) : f_(family), packed_(packed) {}

  Record at(const VectorXd& q, const VectorXd& v) const {
    cardan_hinge_out out{};
    const std::uint32_t zero = 0;
    f_.kinematics(packed_.data(), 1, &zero, &zero, q.data(), v.data(), &out);
    return {Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.R_OP), Eigen::Map<const Vector3d>(out.p_OP),
            Eigen::Map<const MatrixXd>(out.Ht, 6, f_.nv), Eigen::Map<const Eigen::Matrix<double, 6, 1>>(out.Hdot_v)};
  }
  VectorXd qdot(const VectorXd& q, const VectorXd& v) const {
    VectorXd d(f_.nq);
    f_.qdot(packed_.data(), q.data(), v.data(), d.data());
    return d;
  }
  MatrixXd map_dot(const VectorXd& q, const VectorXd& u) const {
    MatrixXd d(6, f_.nv);
    f_.map_dot(packed_.data(), q.data(), u.data(), d.data());
    return d;
  }
  VectorXd retract(const VectorXd& q, const VectorXd& d) const {
    if (!f_.retract) return q + d;
    VectorXd r(f_.nq);
    f_.retract(packed_.data(), q.data(), d.data(), r.data());
    return r;
  }
  VectorXd difference(const VectorXd& a, const VectorXd& b) const {
    if (!f_.difference) return b - a;
    VectorXd d(f_.nv);
    f_.difference(packed_.data(), a.data(), b.data(), d.data());
    return d;
  }
  /// d/dt of g(q) along q' = N(q) u, fourth-order central differences (error about 1e-12 for coordinates of size 1).
  template <class G>
  auto along(const VectorXd& q, const VectorXd& u, const G& g) const {
    const double h = 1e-3;
    const VectorXd d = qdot(q, u);
    const auto p1 = g((q + h * d).eval()), m1 = g((q - h * d).eval()), p2 = g((q + 2 * h * d).eval()),
               m2 = g((q - 2 * h * d).eval());
    return ((8.0 * (p1 - m1) - (p2 - m2)) / (12.0 * h)).eval();
  }

 private:
  const cardan_hinge_family& f_;
  const std::vector<double>& packed_;
};

Vector3d vee(const Matrix3d& m) {
  return 0.5 * Vector3d(m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1));
}

VectorXd random_vector(std::mt19937_64& rng, Eigen::Index n) {
  VectorXd v(n);
  for (Eigen::Index i = 0; i < n; ++i) v[i] = -1.0 + 2.0 * static_cast<double>(rng() >> 11) * 0x1.0p-53;
  return v;
}

}  // namespace

std::vector<double> random_packed(const cardan_hinge_family& family, std::uint64_t seed) {
  std::mt19937_64 rng(seed);
  for (const bool orthonormal : {false, true}) {
    ParamTable table;
    for (std::uint32_t i = 0; i < family.n_params; ++i) {
      const auto& d = family.params[i];
      const std::uint32_t n_vectors = d.kind == CARDAN_VECTOR || d.kind == CARDAN_UNIT_VECTOR ? 1u : d.count ? d.count : 1u;
      if (d.kind == CARDAN_TEXT) continue;  // optional texts stay absent
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
    if (auto packed = pack(family, table); !packed.empty()) return packed;
  }
  return {};
}

std::vector<std::string> hinge_law_violations(const cardan_hinge_family& family, int samples, std::uint64_t seed) {
  std::vector<std::string> found;
  const auto nq = static_cast<Eigen::Index>(family.nq), nv = static_cast<Eigen::Index>(family.nv);
  if (!family.type || !family.kinematics || !family.qdot || !family.pack || !family.map_dot) return {"a required function is null"};
  if (nv > 6 || nq < nv) return {fmt::format("nq = {}, nv = {}: expected nv <= 6 and nq >= nv", nq, nv)};
  if (nq != nv && !(family.retract && family.difference && family.normalise && family.zero))
    return {"nq > nv needs zero, normalise, retract and difference"};
  const bool axis_shape = family.shape >= CARDAN_SHAPE_ROTATION && family.shape <= CARDAN_SHAPE_SCREW;
  if (axis_shape && (!family.axis || nv != 1)) return {"an axis shape needs the function axis and one velocity"};

  std::mt19937_64 rng(seed);
  for (int sample = 0; sample < samples; ++sample) {
    const std::vector<double> packed = random_packed(family, seed + 1000u * static_cast<std::uint64_t>(sample));
    if (packed.empty()) return {"pack refuses every set of random parameters"};
    const Instance hinge(family, packed);
    const auto law = [&](const char* name, double error, double limit) {
      if (!(error <= limit)) found.push_back(fmt::format("{}: error {:.2g} (limit {:.0e}, sample {})", name, error, limit, sample));
    };
    const VectorXd v = random_vector(rng, nv), u = random_vector(rng, nv);
    VectorXd q = random_vector(rng, nq);
    if (family.normalise) family.normalise(packed.data(), q.data());
    const Record r = hinge.at(q, v);

    law("R is a rotation", (r.R.transpose() * r.R - Matrix3d::Identity()).norm() + std::abs(r.R.determinant() - 1.0), 1e-13);
    const Matrix3d Rdot = hinge.along(q, v, [&](const VectorXd& x) { return hinge.at(x, v).R; });
    const Vector3d ldot = hinge.along(q, v, [&](const VectorXd& x) { return hinge.at(x, v).l; });
    const VectorXd h = r.Ht * v;
    law("angular part of Ht v = vee(R* dR/dt)", (vee(r.R.transpose() * Rdot) - h.head<3>()).norm(), 1e-9);
    law("linear part of Ht v = R* dl/dt", (r.R.transpose() * ldot - h.tail<3>()).norm(), 1e-9);
    const MatrixXd Hdot = hinge.along(q, v, [&](const VectorXd& x) { return hinge.at(x, v).Ht; });
    law("Hdot_v = (d/dt Ht) v", (Hdot * v - r.Hdot_v).norm(), 1e-9);
    law("map_dot(q, v) v = Hdot_v", (hinge.map_dot(q, v) * v - r.Hdot_v).norm(), 1e-12);
    const MatrixXd Hdot_u = hinge.along(q, u, [&](const VectorXd& x) { return hinge.at(x, v).Ht; });
    law("map_dot(q, u) is the derivative of Ht along u", (hinge.map_dot(q, u) - Hdot_u).norm(), 1e-9);
    law("qdot is linear in v", (hinge.qdot(q, v + 2.0 * u) - hinge.qdot(q, v) - 2.0 * hinge.qdot(q, u)).norm(), 1e-12);
    law("difference(q, retract(q, d)) = d", (hinge.difference(q, hinge.retract(q, u)) - u).norm(), 1e-12);
    const double e = 1e-4;
    law("retract(q, e v) moves along qdot",
        (hinge.retract(q, e * v) - hinge.retract(q, -e * v) - 2.0 * e * hinge.qdot(q, v)).norm() / e, 1e-7);
    if (axis_shape) {
      double axis[3], pitch = 0.0;
      family.axis(packed.data(), axis, &pitch);
      const Vector3d a(axis[0], axis[1], axis[2]);
      Matrix3d t;
      t << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
      const bool turns = family.shape != CARDAN_SHAPE_SLIDE;
      const Matrix3d R = turns ? (Matrix3d::Identity() + std::sin(q[0]) * t + (1 - std::cos(q[0])) * t * t).eval()
                               : Matrix3d::Identity().eval();
      const double advance = family.shape == CARDAN_SHAPE_SLIDE ? 1.0 : family.shape == CARDAN_SHAPE_SCREW ? pitch : 0.0;
      law("the declared axis shape is true",
          (R - r.R).norm() + (advance * q[0] * a - r.l).norm() + std::abs(a.norm() - 1.0), 1e-12);
    }
    if (family.shape == CARDAN_SHAPE_BALL || family.shape == CARDAN_SHAPE_FREE)
      law("second derivative of l vanishes (ball, free)",
          (Vector3d(h.head<3>()).cross(Vector3d(h.tail<3>())) + r.Hdot_v.tail<3>()).norm(), 1e-12);
  }
  return found;
}

}  // namespace cardan
