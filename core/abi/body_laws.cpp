#include "core/abi/body_laws.hpp"

#include <Eigen/Dense>
#include <array>
#include <optional>

#include "core/abi/law_tools.hpp"
#include "core/abi/modal_view.hpp"
#include "core/base/processor.hpp"
#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Doubles in a register.
Eigen::Index lanes_of_this_processor() { return has_x86_64_v4() ? 8 : has_x86_64_v3() ? 4 : 2; }

Matrix3d tilde(const Vector3d& a) {
  Matrix3d t;
  t << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return t;
}

// ---- a flexible body to try ----

/// The integrals of lumped masses, by their definitions (core/spatial/modal_data.hpp).
ModalIntegrals integrals_of(const std::vector<MassNode>& nodes, int n_modes, bool rotary) {
  const auto m = static_cast<std::size_t>(n_modes);
  ModalIntegrals I;
  I.I3 = I.I4 = MatrixXd::Zero(3, n_modes);
  I.I6 = MatrixXd::Zero(n_modes, n_modes);
  I.I5.assign(m, MatrixXd::Zero(3, n_modes));
  I.I8.assign(m, Matrix3d::Zero());
  I.I9.assign(m * m, Matrix3d::Zero());
  if (rotary) {
    I.rotary_ww.assign(m, Matrix3d::Zero());
    I.rotary_we.assign(m, MatrixXd::Zero(3, n_modes));
    I.rotary_ee.assign(m, MatrixXd::Zero(n_modes, n_modes));
  }
  for (const MassNode& n : nodes) {
    const Matrix3d r = tilde(n.position), J = n.inertia;
    I.I1 += n.mass;
    I.I2 += n.mass * n.position;
    I.I3 += n.mass * n.Phi;
    I.I4 += n.mass * r * n.Phi;
    I.I6 += n.mass * n.Phi.transpose() * n.Phi;
    I.I7 += n.mass * r.transpose() * r;
    for (std::size_t l = 0; l < m; ++l) {
      const auto column = static_cast<Eigen::Index>(l);
      const Matrix3d phi = tilde(n.Phi.col(column));
      I.I5[l] += n.mass * phi * n.Phi;
      I.I8[l] += n.mass * r.transpose() * phi;
      for (std::size_t k = 0; k < m; ++k) I.I9[l * m + k] += n.mass * phi.transpose() * tilde(n.Phi.col(static_cast<Eigen::Index>(k)));
      if (!rotary) continue;
      const Matrix3d psi = tilde(n.Psi.col(column)), commutator = psi * J - J * psi;
      I.rotary_ww[l] += commutator;
      I.rotary_we[l] += (psi * J - 0.5 * J * psi) * n.Psi;
      I.rotary_ee[l] += 0.5 * n.Psi.transpose() * commutator * n.Psi;
    }
    if (!rotary) continue;
    I.I4 += J * n.Psi;
    I.I6 += n.Psi.transpose() * J * n.Psi;
    I.I7 += J;
  }
  return I;
}

/// Eight masses about the origin with shapes of order one, so that eta = 1 is a deformation as large as the body.
ModalData random_modes(std::mt19937_64& rng, int n_modes, bool rotary, bool quadratic) {
  ModalData data;
  data.n_modes = n_modes;
  const auto matrix = [&](Eigen::Index rows, Eigen::Index cols) -> MatrixXd {
    const VectorXd all = random_vector(rng, rows * cols);
    return Eigen::Map<const MatrixXd>(all.data(), rows, cols);
  };
  for (int j = 0; j < 8; ++j) {
    MassNode n;
    n.mass = 1.0 + 0.5 * random_vector(rng, 1)[0];
    n.position = random_vector(rng, 3);
    n.Phi = matrix(3, n_modes);
    n.Psi = rotary ? matrix(3, n_modes) : MatrixXd::Zero(3, n_modes);
    const MatrixXd a = matrix(3, 3);
    if (rotary) n.inertia = 0.05 * (a * a.transpose() + 0.2 * Matrix3d::Identity());
    for (int i = 0; i < 3 && quadratic; ++i) {
      const MatrixXd q = 0.2 * matrix(n_modes, n_modes);
      n.Q.push_back(q + q.transpose());
    }
    data.mass_nodes.push_back(std::move(n));
  }
  for (int j = 0; j < 2; ++j)
    data.nodes.push_back({fmt::format("node_{}", j), random_vector(rng, 3), Matrix3d::Identity(), matrix(3, n_modes), matrix(3, n_modes)});
  data.integrals = integrals_of(data.mass_nodes, n_modes, rotary);
  data.K = MatrixXd::Identity(n_modes, n_modes);
  data.C = MatrixXd::Zero(n_modes, n_modes);
  return data;
}

// ---- the functions ----

struct Inertia {
  VectorXd rr, re, ee;  // as they are handed

  bool finite() const { return rr.allFinite() && re.allFinite() && ee.allFinite(); }
  double distance(const Inertia& o) const { return (rr - o.rr).norm() + (re - o.re).norm() + (ee - o.ee).norm(); }
  Eigen::Index modes() const { return re.size() / 6; }
  /// M of [omega; v; eta'].
  MatrixXd matrix() const {
    const Eigen::Index m = modes();
    MatrixXd M = MatrixXd::Zero(6 + m, 6 + m);
    M.topLeftCorner<3, 3>() << rr[4], rr[7], rr[8], rr[7], rr[5], rr[9], rr[8], rr[9], rr[6];
    M.block<3, 3>(0, 3) = tilde(rr.segment<3>(1));
    M.block<3, 3>(3, 0) = -M.block<3, 3>(0, 3);
    M.block<3, 3>(3, 3) = rr[0] * Matrix3d::Identity();
    M.topRightCorner(6, m) = Eigen::Map<const MatrixXd>(re.data(), 6, m);
    M.bottomLeftCorner(m, 6) = M.topRightCorner(6, m).transpose();
    M.bottomRightCorner(m, m) = Eigen::Map<const MatrixXd>(ee.data(), m, m);
    return M;
  }
};

/// How a node has moved.
struct Moved {
  VectorXd x;
  MatrixXd S;
  VectorXd a;

  bool finite() const { return x.allFinite() && S.allFinite() && a.allFinite(); }
  double distance(const Moved& o) const { return (x - o.x).norm() + (S - o.S).norm() + (a - o.a).norm(); }
};

class BodyInstance {
 public:
  BodyInstance(const cardan_body_family& family, const PackedSample& packed, int modes, const TellPhase& before)
      : f_(family), packed_(packed.block), m_(static_cast<std::size_t>(modes)), before_(before) {}

  const std::string& overrun() const { return overrun_; }
  /// From now on the packed parameters stand somewhere else.
  void move() { packed_ = std::vector<double>(packed_); }

  Inertia mass(const VectorXd& eta) const {
    before_("mass");
    Handed rr(10), re(6 * m_), ee(m_ * m_);
    f_.mass(packed_.data(), eta.data(), rr.data(), re.data(), ee.data());
    for (const Handed* out : {&rr, &re, &ee}) notice(*out, "mass");
    return {rr.vector(), re.vector(), ee.vector()};
  }
  /// Each part asked for alone.
  Inertia mass_by_parts(const VectorXd& eta) const {
    before_("mass, part by part,");
    Handed rr(10), re(6 * m_), ee(m_ * m_);
    f_.mass(packed_.data(), eta.data(), rr.data(), nullptr, nullptr);
    f_.mass(packed_.data(), eta.data(), nullptr, re.data(), nullptr);
    f_.mass(packed_.data(), eta.data(), nullptr, nullptr, ee.data());
    for (const Handed* out : {&rr, &re, &ee}) notice(*out, "mass");
    return {rr.vector(), re.vector(), ee.vector()};
  }
  VectorXd bias(const VectorXd& eta, const VectorXd& etadot, const Vector3d& omega) const {
    before_("bias");
    Handed b(6 + m_);
    f_.bias(packed_.data(), eta.data(), etadot.data(), omega.data(), b.data());
    notice(b, "bias");
    return b.vector();
  }
  /// Each state's mass and bias, a column of `eta` and `etadot` and `omega` each, all at once.
  std::vector<std::pair<Inertia, VectorXd>> states(const MatrixXd& eta, const MatrixXd& etadot, const MatrixXd& omega) const {
    before_("states");
    const auto n = static_cast<std::size_t>(eta.cols());
    Handed e(m_ * n), ed(m_ * n), w(3 * n), rr(10 * n), re(6 * m_ * n), ee(m_ * m_ * n), b((6 + m_) * n);
    const auto lay = [n](const MatrixXd& from, Handed& to) {  // number by number, state beside state
      Eigen::Map<MatrixXd>(to.data(), static_cast<Eigen::Index>(n), from.rows()) = from.transpose();
    };
    lay(eta, e), lay(etadot, ed), lay(omega, w);
    f_.states(packed_.data(), static_cast<std::uint32_t>(n), e.data(), ed.data(), w.data(), rr.data(), re.data(), ee.data(), b.data());
    for (const Handed* out : {&rr, &re, &ee, &b}) notice(*out, "states");
    std::vector<std::pair<Inertia, VectorXd>> all;
    for (std::size_t l = 0; l < n; ++l) {
      const auto state = [&](const Handed& h) -> VectorXd {
        const auto numbers = static_cast<Eigen::Index>(h.vector().size()) / eta.cols();
        return Eigen::Map<const MatrixXd>(h.data(), eta.cols(), numbers).row(static_cast<Eigen::Index>(l));
      };
      all.push_back({{state(rr), state(re), state(ee)}, state(b)});
    }
    return all;
  }
  Moved node(std::uint32_t i, const VectorXd& eta, const VectorXd& etadot) const {
    before_("node");
    Handed x(6), S(6 * m_), a(6);
    f_.node(packed_.data(), i, eta.data(), etadot.data(), x.data(), S.data(), a.data());
    return moved(x, S, a);
  }
  /// Each part asked for alone, and the first two without rates.
  Moved node_by_parts(std::uint32_t i, const VectorXd& eta, const VectorXd& etadot) const {
    before_("node, part by part,");
    Handed x(6), S(6 * m_), a(6);
    f_.node(packed_.data(), i, eta.data(), nullptr, x.data(), nullptr, nullptr);
    f_.node(packed_.data(), i, eta.data(), nullptr, nullptr, S.data(), nullptr);
    f_.node(packed_.data(), i, eta.data(), etadot.data(), nullptr, nullptr, a.data());
    return moved(x, S, a);
  }
  cardan_body_facts facts() const {
    before_("facts");
    cardan_body_facts facts{};
    facts.struct_size = sizeof facts;
    if (f_.facts) f_.facts(packed_.data(), &facts);
    return facts;
  }

 private:
  Moved moved(const Handed& x, const Handed& S, const Handed& a) const {
    for (const Handed* out : {&x, &S, &a}) notice(*out, "node");
    return {x.vector(), Eigen::Map<const MatrixXd>(S.data(), 6, static_cast<Eigen::Index>(m_)), a.vector()};
  }
  void notice(const Handed& array, const char* call) const {
    if (overrun_.empty() && !array.intact()) overrun_ = fmt::format("{} writes beyond what it is handed", call);
  }

  const cardan_body_family& f_;
  std::vector<double> packed_;
  std::size_t m_;
  const TellPhase& before_;
  mutable std::string overrun_;
};

/// b = Mdot V + [w x p_w; w x p_v; -dT/d eta] with p = M V and V = [w; 0; eta'] (Boltzmann-Hamel equations at v = 0), M by differences.
VectorXd bias_of_energy(const BodyInstance& body, const VectorXd& eta, const VectorXd& etadot, const Vector3d& omega) {
  constexpr double kStep = 1e-3;
  const Eigen::Index m = eta.size();
  const auto along = [&](const VectorXd& d) {  // fourth-order difference of M
    const auto M = [&](double h) { return body.mass(eta + h * kStep * d).matrix(); };
    return MatrixXd((8.0 * (M(1) - M(-1)) - (M(2) - M(-2))) / (12.0 * kStep));
  };
  VectorXd V = VectorXd::Zero(6 + m);
  V << omega, Vector3d::Zero(), etadot;
  const VectorXd p = body.mass(eta).matrix() * V;
  VectorXd b = VectorXd::Zero(6 + m);
  b.head<3>() = omega.cross(p.head<3>());
  b.segment<3>(3) = omega.cross(p.segment<3>(3));
  for (Eigen::Index k = 0; k < m; ++k) {
    const MatrixXd slope = along(VectorXd::Unit(m, k));
    b += etadot[k] * (slope * V);
    b[6 + k] -= 0.5 * V.dot(slope * V);
  }
  return b;
}

class BodyLaws {
 public:
  BodyLaws(const cardan_body_family& family, std::uint64_t seed, const TellPhase& before)
      : f_(family), rng_(seed), seed_(seed), before_(before) {
    found_.list(kAccepts, "its mass is given by the host");
    found_.list(kWrites, "its mass is given by the host");
    const char* no_fact = f_.mass_source == CARDAN_MASS_MODES ? "no sample declares it" : "it has no modes";
    for (const char* fact : kFacts) found_.list(fact, no_fact);
    found_.list(kStates, !f_.states ? "it evaluates one state at a time" : "no sample declares it");
    const char* no_curve = f_.mass_source == CARDAN_MASS_MODES ? "its nodes move along constant shapes" : "it has no modes";
    for (const char* of_node : kNode) found_.list(of_node, f_.node ? "no sample came to it" : no_curve);
  }

  std::vector<std::string> violations(int samples, LawRecord* record) {
    for (found_.sample = 0; found_.sample < samples; ++found_.sample)
      if (!(f_.mass_source == CARDAN_MASS_MODES ? modal_sample() : computed_sample())) return found_.take(record);
    if (f_.mass_source == CARDAN_MASS_MODES) found_.law(kAccepts, accepted_ > 0, "pack refuses every set of random parameters and modes");
    return found_.take(record);
  }

 private:
  static constexpr const char* kFacts[] = {"the fact is true: m_ee_constant", "the fact is true: m_re_constant",
                                           "the fact is true: j_constant"};
  static constexpr const char* kStates = "states gives each state what mass and bias give it";
  static constexpr const char* kNode[] = {"the motion of nodes is finite",
                                          "node is the same again, and in another thread",
                                          "node does not depend on where the packed parameters stand",
                                          "node gives the same part by part",
                                          "nodes have not moved at eta = 0",
                                          "S is the derivative of x along eta",
                                          "a is the derivative of S along eta', times eta'"};

  template <class... Arguments>
  void law(const Arguments&... arguments) {
    found_.law(arguments...);
  }
  std::span<const cardan_param_desc> schema() const { return {f_.params, f_.n_params}; }

  /// False when further samples are of no use.
  bool computed_sample() {
    if (f_.mass_source != CARDAN_MASS_COMPUTED) return false;
    struct Rigid {
      double mass, com[3], inertia[6];
    };
    const auto rigid = [&](const cardan_param_values* values, void* out) {
      Rigid& r = *static_cast<Rigid*>(out);
      return f_.rigid(values, &r.mass, r.com, r.inertia);
    };
    before_("rigid");
    const std::uint64_t seed = seed_ + 1000u * static_cast<std::uint64_t>(found_.sample);
    const auto compute = [&] {
      return packed_at_random(
          schema(), seed, [](const cardan_param_values*) { return sizeof(Rigid); }, rigid);
    };
    const PackedSample computed = compute(), again = compute();
    law(kAccepts, !computed.block.empty(), "rigid refuses every set of random parameters");
    law(kWrites, computed.fault.empty(), "rigid writes beyond what it is handed");
    if (computed.block.empty() || !computed.fault.empty()) return false;
    Rigid r;
    std::memcpy(&r, computed.block.data(), sizeof r);
    law("rigid is a function of its arguments", std::memcmp(computed.block.data(), again.block.data(), sizeof r) == 0);
    Matrix3d J;
    J << r.inertia[0], r.inertia[3], r.inertia[4], r.inertia[3], r.inertia[1], r.inertia[5], r.inertia[4], r.inertia[5], r.inertia[2];
    law("the mass is a number > 0", r.mass > 0.0 && std::isfinite(r.mass));
    law("mass centre and inertia are finite", Vector3d(r.com[0], r.com[1], r.com[2]).allFinite() && J.allFinite());
    if (!J.allFinite()) return true;
    const Vector3d p = Eigen::SelfAdjointEigenSolver<Matrix3d>(J, Eigen::EigenvaluesOnly).eigenvalues();
    law("principal moments are > 0 and satisfy the triangle inequality", p[0] > 0.0 && p[2] <= (p[0] + p[1]) * (1.0 + 1e-6));
    return true;
  }

  bool modal_sample() {
    struct Form {
      int level;
      bool rotary, quadratic;
    };
    constexpr std::array<Form, 12> kForms = {{{0, false, false},
                                              {1, false, false},
                                              {2, false, false},
                                              {0, true, false},
                                              {1, true, false},
                                              {2, true, false},
                                              {2, true, true},
                                              {2, false, true},
                                              {1, false, false},
                                              {2, false, false},
                                              {1, true, false},
                                              {2, true, true}}};
    const Form form = kForms[static_cast<std::size_t>(found_.sample) % kForms.size()];
    const int modes = 1 + static_cast<int>(rng_() % 5);
    const ModalData data = random_modes(rng_, modes, form.rotary, form.quadratic);
    const ModalView view(data, form.level);
    before_("pack");
    const PackedSample packed = packed_at_random(
        schema(), seed_ + 1000u * static_cast<std::uint64_t>(found_.sample),
        [&](const cardan_param_values* values) { return f_.packed_size(values, view.get()); },
        [&](const cardan_param_values* values, void* out) { return f_.pack(values, view.get(), out); });
    law(kPack, packed.fault.empty(), packed.fault);
    if (!packed.fault.empty()) return false;
    if (packed.block.empty()) return true;
    ++accepted_;
    BodyInstance body(f_, packed, modes, before_);
    const cardan_body_facts facts = body.facts();
    const Inertia at_rest = body.mass(VectorXd::Zero(modes));
    for (const double size : {0.01, 0.1, 1.0})
      if (!expect(body, facts, at_rest, data.integrals.I1, size)) break;
    law(kWrites, body.overrun().empty(), body.overrun());
    return body.overrun().empty();
  }

  bool expect(BodyInstance& body, const cardan_body_facts& facts, const Inertia& at_rest, double total, double size) {
    const Eigen::Index m = at_rest.modes();
    const VectorXd eta = size * random_vector(rng_, m), etadot = random_vector(rng_, m);
    const Vector3d omega = random_vector(rng_, 3);
    const Inertia I = body.mass(eta);
    const VectorXd b = body.bias(eta, etadot, omega);
    law("mass and bias are finite", I.finite() && b.allFinite() && at_rest.finite());
    if (!I.finite() || !b.allFinite() || !at_rest.finite()) return false;
    Inertia there;
    VectorXd b_there;
    in_another_thread([&] { there = body.mass(eta), b_there = body.bias(eta, etadot, omega); });
    law("mass is the same again, and in another thread", body.mass(eta).distance(I) + there.distance(I), 0.0);
    law("bias is the same again, and in another thread", (body.bias(eta, etadot, omega) - b).norm() + (b_there - b).norm(), 0.0);
    body.move();
    law("mass and bias do not depend on where the packed parameters stand",
        body.mass(eta).distance(I) + (body.bias(eta, etadot, omega) - b).norm(), 0.0);
    law("mass gives the same part by part", body.mass_by_parts(eta).distance(I), 1e-14, I.matrix().norm());

    const MatrixXd M = I.matrix(), M_ee = M.bottomRightCorner(m, m);
    const double scale = M.norm();
    law("the mass is that of the modal data", std::abs(I.rr[0] - total), 1e-12, total);
    law("M_ee is symmetric", (M_ee - M_ee.transpose()).norm(), 1e-13, scale);
    if (size < 0.1) law("the mass matrix is positive definite", cholesky(M).has_value());
    constexpr double kStep = 1e-3;
    MatrixXd centre(3, m);  // d(m c)/d eta
    for (Eigen::Index k = 0; k < m; ++k) {
      const auto mc = [&](double h) { return Vector3d(body.mass(eta + h * kStep * VectorXd::Unit(m, k)).rr.segment<3>(1)); };
      centre.col(k) = (8.0 * (mc(1) - mc(-1)) - (mc(2) - mc(-2))) / (12.0 * kStep);
    }
    law("M_ve is the derivative of m c along eta", (centre - M.block(3, 6, 3, m)).norm(), 1e-9, scale);
    const VectorXd wanted = bias_of_energy(body, eta, etadot, omega);
    law("b_w is what the kinetic energy gives", (wanted.head<3>() - b.head<3>()).norm(), 1e-9, scale);
    law("b_v is what the kinetic energy gives", (wanted.segment<3>(3) - b.segment<3>(3)).norm(), 1e-9, scale);
    law("b_e is what the kinetic energy gives", (wanted.tail(m) - b.tail(m)).norm(), 1e-9, scale);

    for (std::uint32_t i = 0; f_.node && i < 2; ++i)
      if (!expect_node(body, i, eta, etadot)) return false;
    if (facts.states && f_.states) expect_states(body, m, size);
    if (facts.m_ee_constant) law(kFacts[0], I.ee == at_rest.ee);
    if (facts.m_re_constant) law(kFacts[1], I.re == at_rest.re);
    if (facts.j_constant) law(kFacts[2], I.rr.tail<6>() == at_rest.rr.tail<6>());
    return true;
  }

  /// In as many lanes as this processor has.
  void expect_states(const BodyInstance& body, Eigen::Index m, double size) {
    for (const Eigen::Index n : {2, 4, 8}) {
      if (n > lanes_of_this_processor()) return;
      MatrixXd eta(m, n), etadot(m, n), omega(3, n);
      for (Eigen::Index l = 0; l < n; ++l) {
        eta.col(l) = size * random_vector(rng_, m);
        etadot.col(l) = random_vector(rng_, m);
        omega.col(l) = random_vector(rng_, 3);
      }
      const auto all = body.states(eta, etadot, omega);
      double apart = 0.0;
      for (Eigen::Index l = 0; l < n; ++l) {
        const auto& [I, b] = all[static_cast<std::size_t>(l)];
        apart += body.mass(eta.col(l)).distance(I) + (body.bias(eta.col(l), etadot.col(l), omega.col(l)) - b).norm();
      }
      law(kStates, apart, 0.0);
    }
  }

  bool expect_node(BodyInstance& body, std::uint32_t i, const VectorXd& eta, const VectorXd& etadot) {
    const Eigen::Index m = eta.size();
    const Moved n = body.node(i, eta, etadot);
    law(kNode[0], n.finite());
    if (!n.finite()) return false;
    Moved there;
    in_another_thread([&] { there = body.node(i, eta, etadot); });
    law(kNode[1], body.node(i, eta, etadot).distance(n) + there.distance(n), 0.0);
    body.move();
    law(kNode[2], body.node(i, eta, etadot).distance(n), 0.0);
    law(kNode[3], body.node_by_parts(i, eta, etadot).distance(n), 1e-14, 1.0 + n.S.norm());
    law(kNode[4], body.node(i, VectorXd::Zero(m), etadot).x.norm(), 0.0);
    constexpr double kStep = 1e-3;
    const auto along = [&](const VectorXd& d, auto part) {  // fourth-order difference
      const auto at = [&](double h) { return part(body.node(i, eta + h * kStep * d, etadot)); };
      return VectorXd((8.0 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12.0 * kStep));
    };
    MatrixXd S(6, m);
    for (Eigen::Index k = 0; k < m; ++k) S.col(k) = along(VectorXd::Unit(m, k), [](const Moved& o) { return o.x; });
    const double size = 1.0 + n.x.norm() + n.S.norm();
    law(kNode[5], (S - n.S).norm(), 1e-9, size);
    const VectorXd a = along(etadot, [&](const Moved& o) { return VectorXd(o.S * etadot); });
    law(kNode[6], (a - n.a).norm(), 1e-9, size * (1.0 + etadot.squaredNorm()));
    return true;
  }

  const cardan_body_family& f_;
  std::mt19937_64 rng_;
  std::uint64_t seed_;
  const TellPhase& before_;
  int accepted_ = 0;
  Violations found_;
};

}  // namespace

std::vector<std::string> body_table_faults(const cardan_body_family& f) {
  TableChecks table;
  table.text("type", f.type, true);
  table.text("summary", f.summary, false);
  table.expect(f.mass_source <= CARDAN_MASS_MODES, "mass_source", fmt::format("{}, expected one of cardan_mass_source", f.mass_source));
  const bool modes = f.mass_source == CARDAN_MASS_MODES;
  for (const auto& [name, missing] : {std::pair{"packed_size", !f.packed_size}, {"pack", !f.pack}, {"mass", !f.mass}, {"bias", !f.bias}})
    table.expect(!modes || !missing, name, "null, and a body with modes needs it");
  table.expect(f.mass_source != CARDAN_MASS_COMPUTED || f.rigid, "rigid", "null, and a body whose mass is computed needs it");
  table.parameters(f.params, f.n_params);
  return table.take();
}

std::vector<std::string> body_law_violations(const cardan_body_family& family, int samples, std::uint64_t seed, const TellPhase& before,
                                             LawRecord* record) {
  if (auto faults = body_table_faults(family); !faults.empty()) return faults;
  return BodyLaws(family, seed, before).violations(samples, record);
}

}  // namespace cardan
