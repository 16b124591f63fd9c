// modal_flexible: a body in a floating frame B with modal coordinates eta, at fidelity level 0, 1 or 2
// (Jain & Rodriguez 1992; Shabana 2013; docs/mathematics/flexible.md).
//   level 0: M_fl(0), except M_wv = (mc)~ which follows the mass centre;  level 1: M_fl(0) + sum eta_i dM_i;  level 2: exact.
// Mass matrix and bias come from one truncation of the kinetic energy, which is what conserves energy at every level.
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstring>
#include <new>

#include "core/abi/cardan_abi.h"
#include "core/spatial/eigen_bridge.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

using Eigen::Map;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using ConstMat = Map<const MatrixXd>;
using ConstMat3 = Map<const Matrix3d>;
using ConstVec3 = Map<const Vector3d>;

// Small matrices on the stack: a step allocates nothing. The nodal form serves up to this many modes.
constexpr int kMaxNodalModes = 128;
using Shapes = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, kMaxNodalModes>;
using Modal = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMaxNodalModes, 1>;

// The packed parameters: a header and a copy of all arrays behind it.
struct Packed {
  std::uint32_t m, level, n_nodes;
  std::uint32_t rotary, quadratic, nodal;  // rotary terms, second-order field Q, nodal form in use
  double I1;
  // offsets into the doubles that follow the header
  std::uint32_t I2, I3, I4, I5, I6, I7, I8, I9, r_ww, r_we, r_ee, mass, position, inertia, Phi, Psi, Q, has_I9, has_inertia, has_Psi;

  const double* data() const { return reinterpret_cast<const double*>(this + 1); }
  ConstVec3 vec(std::uint32_t at, std::uint32_t i = 0) const { return ConstVec3(data() + at + 3 * i); }
  ConstMat3 mat(std::uint32_t at, std::uint32_t i = 0) const { return ConstMat3(data() + at + 9 * i); }
  ConstMat block(std::uint32_t at, Eigen::Index rows, std::uint32_t i = 0) const {
    return ConstMat(data() + at + rows * m * i, rows, m);
  }
};
static_assert(sizeof(Packed) % sizeof(double) == 0);

// Counts (measure) or copies (write) the arrays of the view, in one order.
template <class Copy>
void lay_out(const cardan_modal_view& v, Packed& p, const Copy& copy) {
  const std::uint32_t m = v.n_modes, n = v.n_mass_nodes;
  p.I2 = copy(v.I2, 3);
  p.I3 = copy(v.I3, 3 * m);
  p.I4 = copy(v.I4, 3 * m);
  p.I5 = copy(v.I5, 3 * m * m);
  p.I6 = copy(v.I6, m * m);
  p.I7 = copy(v.I7, 9);
  p.I8 = copy(v.I8, 9 * m);
  p.I9 = copy(v.I9, v.I9 ? 9 * m * m : 0);
  p.r_ww = copy(v.rotary_ww, v.rotary_ww ? 9 * m : 0);
  p.r_we = copy(v.rotary_we, v.rotary_we ? 3 * m * m : 0);
  p.r_ee = copy(v.rotary_ee, v.rotary_ee ? m * m * m : 0);
  const bool nodal = p.nodal != 0;
  p.mass = copy(v.node_mass, nodal ? n : 0);
  p.position = copy(v.node_position, nodal ? 3 * n : 0);
  p.inertia = copy(v.node_inertia, nodal && v.node_inertia ? 9 * n : 0);
  p.Phi = copy(v.node_Phi, nodal ? 3 * m * n : 0);
  p.Psi = copy(v.node_Psi, nodal && v.node_Psi ? 3 * m * n : 0);
  p.Q = copy(v.node_Q, nodal && v.node_Q ? 3 * m * m * n : 0);
}

Packed header_of(const cardan_modal_view& v) {
  Packed p{};
  p.m = v.n_modes;
  p.level = v.level;
  p.n_nodes = v.n_mass_nodes;
  p.rotary = v.rotary_ww != nullptr;
  p.quadratic = v.node_Q != nullptr;
  p.has_I9 = v.I9 != nullptr;
  p.has_inertia = v.node_inertia != nullptr;
  p.has_Psi = v.node_Psi != nullptr;
  // Level 2 is a polynomial in eta for translational lumps; nodal rotary inertia and Q need the loop over the nodes.
  p.nodal = v.level == 2 && (p.rotary || p.quadratic);
  p.I1 = v.I1;
  return p;
}

std::uint64_t packed_size(const cardan_modal_view* v) {
  Packed p = header_of(*v);
  std::uint32_t total = 0;
  lay_out(*v, p, [&](const double*, std::uint32_t count) {
    const std::uint32_t at = total;
    total += count;
    return at;
  });
  return sizeof(Packed) + sizeof(double) * total;
}

int pack(const cardan_modal_view* v, void* out) {
  Packed p = header_of(*v);
  if (p.nodal && (p.n_nodes == 0 || p.m > kMaxNodalModes)) return 1;  // level 2 with rotary inertia: lumped masses
  if (v->level == 2 && !p.nodal && !v->I9) return 1;
  double* data = reinterpret_cast<double*>(static_cast<char*>(out) + sizeof(Packed));
  std::uint32_t total = 0;
  lay_out(*v, p, [&](const double* source, std::uint32_t count) {
    if (count > 0) std::memcpy(data + total, source, count * sizeof(double));
    const std::uint32_t at = total;
    total += count;
    return at;
  });
  new (out) Packed(p);
  return 0;
}

const Packed& self(const void* packed) { return *static_cast<const Packed*>(packed); }

void facts(const void* packed, cardan_body_facts* f) {
  const Packed& p = self(packed);
  f->m_ee_constant = p.level == 0 || (!p.rotary && !p.quadratic);
  f->m_re_constant = p.level == 0;
}

void write_rr(double m, const Vector3d& mc, const Matrix3d& J, double* M_rr) {
  const double values[10] = {m, mc.x(), mc.y(), mc.z(), J(0, 0), J(1, 1), J(2, 2), J(0, 1), J(0, 2), J(1, 2)};
  std::memcpy(M_rr, values, sizeof values);
}

// dM_ww / d eta_k at eta (levels 1 and 2 without nodal form).
Matrix3d dM_ww(const Packed& p, std::uint32_t k, const double* eta) {
  Matrix3d d = p.mat(p.I8, k);
  if (p.level == 2)
    for (std::uint32_t l = 0; l < p.m; ++l) d += eta[l] * p.mat(p.I9, k * p.m + l);
  d += d.transpose().eval();
  if (p.rotary) d += p.mat(p.r_ww, k);
  return d;
}

// A mass node at (eta, eta'): everything the nodal form needs (mathematics 3.2, 3.4, 3.6).
struct NodeState {
  double mass;
  Vector3d rho, rho_rate, quadratic_rate;  // quadratic_rate = eta'* Q eta'
  Shapes Phi, W;                           // effective shapes: Phi + Q eta, Jl Psi
  Matrix3d I;
  Vector3d w_rel, w_rel_rate;              // W eta', dJl(theta; theta') theta'
};

void node_at(const Packed& p, std::uint32_t j, const double* eta, const double* rate, NodeState& s) {
  const Map<const VectorXd> e(eta, p.m), ed(rate, p.m);
  s.mass = p.data()[p.mass + j];
  s.Phi = p.block(p.Phi, 3, j);
  s.rho = p.vec(p.position, j) + s.Phi * e;
  s.quadratic_rate.setZero();
  if (p.quadratic)
    for (int i = 0; i < 3; ++i) {
      const ConstMat Q(p.data() + p.Q + (3 * j + static_cast<std::uint32_t>(i)) * p.m * p.m, p.m, p.m);
      Modal Qe(p.m);
      Qe.noalias() = 0.5 * (Q * e);
      Qe.noalias() += 0.5 * (Q.transpose() * e);
      s.rho[i] += 0.5 * e.dot(Qe);
      s.Phi.row(i) += Qe.transpose();
      Modal Qed(p.m);
      Qed.noalias() = Q * ed;
      s.quadratic_rate[i] = ed.dot(Qed);
    }
  s.rho_rate = s.Phi * ed;
  s.W.setZero(3, p.m);
  s.I.setZero();
  s.w_rel.setZero();
  s.w_rel_rate.setZero();
  if (!p.has_Psi) {
    if (p.has_inertia) s.I = p.mat(p.inertia, j);
    return;
  }
  const ConstMat Psi = p.block(p.Psi, 3, j);
  const Vec3<double> t = from_eigen(Vector3d(Psi * e)), td = from_eigen(Vector3d(Psi * ed));
  const auto c = rotation_coefficients(dot(t, t));
  for (std::uint32_t k = 0; k < p.m; ++k) s.W.col(k) = to_eigen(left_jacobian(c, t, from_eigen(Vector3d(Psi.col(k)))));
  if (p.has_inertia) {
    const Matrix3d R = to_eigen(rotation_of_vector(c, t));
    s.I = R * p.mat(p.inertia, j) * R.transpose();
  }
  s.w_rel = s.W * ed;
  s.w_rel_rate = to_eigen(left_jacobian_dot(c, t, td, td));
}

void nodal_mass(const Packed& p, const double* eta, double* M_rr, double* M_re, double* M_ee) {
  const double zero[kMaxNodalModes] = {};
  Vector3d mc = Vector3d::Zero();
  Matrix3d J = Matrix3d::Zero();
  if (M_re) Map<MatrixXd>(M_re, 6, p.m).setZero();
  if (M_ee) Map<MatrixXd>(M_ee, p.m, p.m).setZero();
  NodeState s;
  for (std::uint32_t j = 0; j < p.n_nodes; ++j) {
    node_at(p, j, eta, zero, s);
    const Matrix3d t = to_eigen(tilde(from_eigen(s.rho)));
    mc += s.mass * s.rho;
    J += s.I - s.mass * t * t;
    if (M_re) {
      Map<MatrixXd> re(M_re, 6, p.m);
      re.topRows<3>() += s.mass * t * s.Phi + s.I * s.W;
      re.bottomRows<3>() += s.mass * s.Phi;
    }
    if (M_ee) {
      Map<MatrixXd> ee(M_ee, p.m, p.m);
      const Shapes IW = s.I * s.W;
      for (std::uint32_t k = 0; k < p.m; ++k)
        for (std::uint32_t l = 0; l < p.m; ++l)
          ee(l, k) += s.mass * s.Phi.col(l).dot(s.Phi.col(k)) + s.W.col(l).dot(IW.col(k));
    }
  }
  if (M_rr) write_rr(p.I1, mc, J, M_rr);
}

void nodal_bias(const Packed& p, const double* eta, const double* rate, const Vector3d& w, double* b) {
  Map<VectorXd> out(b, 6 + p.m);
  out.setZero();
  NodeState s;
  for (std::uint32_t j = 0; j < p.n_nodes; ++j) {
    node_at(p, j, eta, rate, s);
    const Vector3d force = s.mass * (w.cross(w.cross(s.rho)) + 2.0 * w.cross(s.rho_rate) + s.quadratic_rate);
    const Vector3d total = w + s.w_rel;
    const Vector3d moment = s.I * (s.w_rel_rate + w.cross(s.w_rel)) + total.cross(s.I * total);
    out.head<3>() += s.rho.cross(force) + moment;
    out.segment<3>(3) += force;
    for (std::uint32_t k = 0; k < p.m; ++k) out[6 + k] += s.Phi.col(k).dot(force) + s.W.col(k).dot(moment);
  }
}

void mass(const void* packed, const double* eta, double* M_rr, double* M_re, double* M_ee) {
  const Packed& p = self(packed);
  if (p.nodal) return nodal_mass(p, eta, M_rr, M_re, M_ee);
  const Map<const VectorXd> e(eta, p.m);
  if (M_rr) {
    const Vector3d mc = p.vec(p.I2) + p.block(p.I3, 3) * e;
    Matrix3d J = p.mat(p.I7);
    if (p.level >= 1)
      for (std::uint32_t k = 0; k < p.m; ++k) {
        Matrix3d d = p.mat(p.I8, k) + p.mat(p.I8, k).transpose();
        if (p.rotary) d += p.mat(p.r_ww, k);
        if (p.level == 2)
          for (std::uint32_t l = 0; l < p.m; ++l) d += eta[l] * p.mat(p.I9, k * p.m + l);
        J += eta[k] * d;
      }
    write_rr(p.I1, mc, J, M_rr);
  }
  if (M_re) {
    Map<MatrixXd> re(M_re, 6, p.m);
    re.topRows<3>() = p.block(p.I4, 3);
    re.bottomRows<3>() = p.block(p.I3, 3);
    if (p.level >= 1)
      for (std::uint32_t l = 0; l < p.m; ++l) {
        re.topRows<3>() += eta[l] * p.block(p.I5, 3, l);
        if (p.rotary) re.topRows<3>() += eta[l] * p.block(p.r_we, 3, l);
      }
  }
  if (M_ee) {
    Map<MatrixXd> ee(M_ee, p.m, p.m);
    ee = p.block(p.I6, p.m);
    if (p.level >= 1 && p.rotary)
      for (std::uint32_t i = 0; i < p.m; ++i) ee += eta[i] * p.block(p.r_ee, p.m, i);
  }
}

// b_w = w x (M_ww w + M_we eta') + Mdot_ww w + Mdot_we eta';  b_v = w x (w x mc) + 2 w x u;
// b_e,k = (Mdot_we* w + Mdot_ee eta')_k - 1/2 w* dM_ww,k w - w* dM_we,k eta' - 1/2 eta'* dM_ee,k eta'   (mathematics 3.4)
void bias(const void* packed, const double* eta, const double* etadot, const double* omega, double* b) {
  const Packed& p = self(packed);
  const Vector3d w(omega[0], omega[1], omega[2]);
  if (p.nodal) return nodal_bias(p, eta, etadot, w, b);
  const Map<const VectorXd> e(eta, p.m), ed(etadot, p.m);
  const Vector3d mc = p.vec(p.I2) + p.block(p.I3, 3) * e, u = p.block(p.I3, 3) * ed;
  Map<VectorXd> out(b, 6 + p.m);
  out.segment<3>(3) = w.cross(w.cross(mc) + 2.0 * u);
  out.tail(p.m).setZero();
  Vector3d p_w = p.mat(p.I7) * w + p.block(p.I4, 3) * ed;  // M_ww w + M_we eta'
  Vector3d rate = Vector3d::Zero();                        // Mdot_ww w + Mdot_we eta'
  if (p.level >= 1)
    for (std::uint32_t k = 0; k < p.m; ++k) {
      const Matrix3d d = dM_ww(p, k, eta);
      // eta_k times dM_ww / d eta_k overcounts the quadratic term of level 2 twice: subtract one half of it
      Matrix3d d_value = d;
      if (p.level == 2) {
        d_value = p.mat(p.I8, k) + p.mat(p.I8, k).transpose();
        if (p.rotary) d_value += p.mat(p.r_ww, k);
        for (std::uint32_t l = 0; l < p.m; ++l) d_value += eta[l] * p.mat(p.I9, k * p.m + l);
      }
      const Vector3d dw = d * w;
      p_w += eta[k] * (d_value * w);
      rate += ed[k] * dw;
      out[6 + k] -= 0.5 * w.dot(dw);
      Vector3d we = p.block(p.I5, 3, k) * ed;  // dM_we,k eta'
      if (p.rotary) we.noalias() += p.block(p.r_we, 3, k) * ed;  // no temporary vector
      p_w += eta[k] * we;
      rate += ed[k] * we;
      out[6 + k] -= w.dot(we);
      for (std::uint32_t l = 0; l < p.m; ++l) out[6 + l] += ed[k] * p.block(p.I5, 3, k).col(l).dot(w);  // Mdot_we* w
      if (p.rotary) {
        for (std::uint32_t l = 0; l < p.m; ++l) out[6 + l] += ed[k] * p.block(p.r_we, 3, k).col(l).dot(w);
        const ConstMat dM_ee = p.block(p.r_ee, p.m, k);  // columns of a symmetric matrix: no temporary vector
        double quadratic = 0.0;
        for (std::uint32_t l = 0; l < p.m; ++l) {
          const double dee = dM_ee.col(l).dot(ed);
          out[6 + l] += ed[k] * dee;
          quadratic += ed[l] * dee;
        }
        out[6 + k] -= 0.5 * quadratic;
      }
    }
  out.head<3>() = w.cross(p_w) + rate;
}

}  // namespace

const cardan_body_family& modal_flexible_family() {
  static constexpr cardan_body_family family{sizeof(cardan_body_family), "modal_flexible",
                                             "flexible body: floating frame and modal coordinates", 1, packed_size, pack, facts, mass, bias};
  return family;
}

}  // namespace cardan
