// modal_flexible: a body in a floating frame B with modal coordinates eta, at fidelity level 0, 1 or 2
// (Jain & Rodriguez 1992; Shabana 2013; docs/mathematics/flexible.md).
//   level 0: M_fl(0), except M_wv = (mc)~ which follows the mass centre;  level 1: M_fl(0) + sum eta_i dM_i;  level 2: exact.
// Mass matrix and bias come from one truncation of the kinetic energy, which is what conserves energy at every level.
// Everything that does not depend on the state is summed when the parameters are packed; what is left are plain loops.
#include <Eigen/QR>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <new>
#include <vector>

#include "core/abi/cardan_body.h"
#include "core/base/clones.hpp"
#include "core/spatial/rotation.hpp"

// mass and bias are compiled for three instruction sets and the best is taken at load; many states at once for the set whose registers hold
// them. A program whose sweeps are built for one set alone (CARDAN_ONE_SET) has all for that. Without fused
// multiplications (-ffp-contract=off) all give the same bits.
#ifdef CARDAN_ONE_SET
#define CARDAN_KERNEL_CLONES __attribute__((target(CARDAN_ONE_SET)))
#else
#define CARDAN_KERNEL_CLONES CARDAN_CLONES("default", "arch=x86-64-v3", "arch=x86-64-v4")
#endif
#define CARDAN_INTO_CLONES __attribute__((always_inline)) inline

namespace cardan {
namespace {

using V3 = Vec3<double>;
using M3 = Mat3<double>;

// N numbers side by side, of as many states: what follows is written for a number T, double or these. `a - T{}` is the double a in each
// state. No function takes or returns a T, which calls would hand over in other ways on each instruction set.
template <int N>
struct SideBySide {
  using type [[gnu::vector_size(8 * N)]] = double;
};

constexpr std::uint32_t kMaxNodalModes = 128;  // of the nodal form, whose work stands on the stack: a step allocates nothing
constexpr std::uint32_t kBlock = 32;           // modes whose sums over the other modes are formed together
constexpr std::uint32_t kWork = 1024;          // numbers formed together on the stack; no body with rotary terms has more modes

// The packed parameters: a header and all arrays behind it. Symmetric matrices as six numbers: xx yy zz xy xz yz.
struct Packed {
  std::uint32_t m, level, n_nodes;
  std::uint32_t rotary, coupled;   // rotary terms, such of W too
  std::uint32_t quadratic, nodal;  // second-order field Q, nodal form in use
  std::uint32_t rank;              // dM_ee / d eta_i = sum_r F_ri S_r, r < rank
  std::uint32_t sparse, entries;   // W by its entries, which are few
  double I1;
  // offsets into the doubles that follow the header
  std::uint32_t I2, J, M_re, M_ee;        // 3; 6: I7; 6 m: [I4_k; I3_k]; m m
  std::uint32_t dJ;                       // 6 m: I8_k + I8_k* + rotary_ww_k
  std::uint32_t W, Z;                     // W_lk = I5_lk + rotary_we_lk; W_lk - W_kl where that is not 2 W_lk: 3 m m, index (l m + k), or
  std::uint32_t begin, of;                // 3 of each entry, by k, that of k from begin_k on, l = of_entry; whole numbers, two in a double
  std::uint32_t d2J_entries;              // six of each entry, zero where they are not sparse
  std::uint32_t d2J[6];                   // d2 M_ww / d eta_k d eta_l, number by number: m m each; the six together where W is not sparse
  std::uint32_t F, S;                     // m rank; rank m m: entry (k, l) of S_r, symmetric in k and l, at (l rank + r) m + k
  std::uint32_t mass, position, inertia;  // nodal form, per node: 1, 3, 9 (row-major)
  std::uint32_t Phi, Psi, Q;              // per node 3 rows of m; 3 matrices m x m, symmetrised
  std::uint32_t has_inertia, has_Psi;

  const double* at(std::uint32_t offset) const { return reinterpret_cast<const double*>(this + 1) + offset; }
  const std::uint32_t* whole(std::uint32_t offset) const { return reinterpret_cast<const std::uint32_t*>(at(offset)); }
  V3 vec(std::uint32_t offset) const { return {at(offset)[0], at(offset)[1], at(offset)[2]}; }
};
static_assert(sizeof(Packed) % sizeof(double) == 0);

void symmetric(const double* a, double scale, double* out);

/// What stands between two modes: W_lk, W_lk - W_kl, d2 M_ww / d eta_k d eta_l.
struct Couplings {
  const cardan_modal_view& v;

  double W(std::uint32_t l, std::uint32_t k, std::uint32_t r) const {
    const std::uint32_t lk = 3 * (l * v.n_modes + k) + r;
    return v.I5[lk] + (v.rotary_we ? v.rotary_we[lk] : 0.0);
  }
  double Z(std::uint32_t l, std::uint32_t k, std::uint32_t r) const {
    const std::uint32_t lk = 3 * (l * v.n_modes + k) + r, kl = 3 * (k * v.n_modes + l) + r;
    return (v.I5[lk] - v.I5[kl]) + (v.rotary_we ? v.rotary_we[lk] - v.rotary_we[kl] : 0.0);
  }
  double d2J(std::uint32_t l, std::uint32_t k, std::uint32_t r) const {
    double six[6] = {};
    symmetric(v.I9 + 9 * (l * v.n_modes + k), 1.0, six);
    symmetric(v.I9 + 9 * (k * v.n_modes + l), 1.0, six);
    return six[r];
  }
  /// Whether number r is in the list of entries: 0 ... 2 of W, 3 ... 8 of d2J.
  bool differs(std::uint32_t l, std::uint32_t k, std::uint32_t r) const {
    return r < 3 ? W(l, k, r) != 0.0 || W(k, l, r) != 0.0 : d2J(l, k, r - 3) != 0.0;
  }
  /// A bit for each of these that is zero nearly everywhere. A plate's modes couple in its plane with those out of it, and hardly others.
  std::uint32_t sparse() const {
    std::uint32_t bits = 0;
    const std::uint32_t m = v.n_modes, numbers = v.level == 2 ? 9 : 3;
    for (std::uint32_t r = 0; r < numbers; ++r) {
      std::uint32_t n = 0;
      for (std::uint32_t l = 0; l < m; ++l)
        for (std::uint32_t k = 0; k < m; ++k) n += differs(l, k, r);
      if (3 * n < m * m) bits |= 1u << r;
    }
    return (bits & 7u) == 7u ? bits : 0u;
  }
  bool entry(std::uint32_t l, std::uint32_t k, std::uint32_t sparse) const {
    for (std::uint32_t r = 0; r < 9; ++r)
      if ((sparse >> r & 1u) != 0 && differs(l, k, r)) return true;
    return false;
  }
};

/// Columns: dM_ee / d eta_i. They are made of as many matrices as this has independent columns.
auto factored(const cardan_modal_view& v) {
  const std::uint32_t m = v.n_modes;
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(Eigen::Map<const Eigen::MatrixXd>(v.rotary_ee, m * m, m));
  return qr.setThreshold(1e-15 * m), qr;
}

Packed header_of(const cardan_modal_view& v) {
  Packed p{};
  p.m = v.n_modes;
  p.n_nodes = v.n_mass_nodes;
  p.level = v.level;
  p.rotary = v.rotary_ww != nullptr;
  p.coupled = v.rotary_we != nullptr;
  p.quadratic = v.node_Q != nullptr;
  p.has_inertia = v.node_inertia != nullptr;
  p.has_Psi = v.node_Psi != nullptr;
  // Level 2 is a polynomial in eta for translational lumps; nodal rotary inertia beyond first order and Q need the loop over the nodes.
  p.nodal = v.level == 2 && ((p.rotary && p.n_nodes > 0) || p.quadratic);
  p.rank = !p.nodal && v.level >= 1 && v.rotary_ee ? static_cast<std::uint32_t>(factored(v).rank()) : 0;
  if (p.level >= 1 && !p.nodal && (p.level < 2 || v.I9)) {
    const Couplings couplings{v};
    p.sparse = couplings.sparse();
    for (std::uint32_t l = 0; p.sparse != 0 && l < p.m; ++l)
      for (std::uint32_t k = 0; k < p.m; ++k) p.entries += couplings.entry(l, k, p.sparse);
  }
  p.I1 = v.I1;
  return p;
}

// Offsets of the arrays; returns how many doubles they take.
std::uint32_t lay_out(Packed& p) {
  const std::uint32_t m = p.m, n = p.n_nodes;
  std::uint32_t total = 0;
  const auto take = [&](bool wanted, std::uint32_t count) {
    const std::uint32_t at = total;
    total += wanted ? count : 0;
    return at;
  };
  const bool polynomial = !p.nodal, slopes = polynomial && p.level >= 1;
  p.I2 = take(polynomial, 3);
  p.J = take(polynomial, 6);
  p.M_re = take(polynomial, 6 * m);
  p.M_ee = take(polynomial, m * m);
  p.dJ = take(slopes, 6 * m);
  p.W = take(slopes, 3 * (p.sparse ? p.entries : m * m));
  p.Z = take(slopes && p.coupled, 3 * (p.sparse ? p.entries : m * m));
  p.begin = take(slopes && p.sparse, m / 2 + 1);
  p.of = take(slopes && p.sparse, (p.entries + 1) / 2);
  if (!p.sparse) p.d2J[0] = take(polynomial && p.level == 2, 6 * m * m);
  for (std::uint32_t r = 0; r < 6 && p.sparse; ++r) p.d2J[r] = take(polynomial && p.level == 2 && (p.sparse >> (3 + r) & 1u) == 0, m * m);
  p.d2J_entries = take(polynomial && p.level == 2 && p.sparse != 0, 6 * p.entries);
  p.F = take(p.rank > 0, m * p.rank);
  p.S = take(p.rank > 0, p.rank * m * m);
  p.mass = take(p.nodal, n);
  p.position = take(p.nodal, 3 * n);
  p.inertia = take(p.nodal && p.has_inertia, 9 * n);
  p.Phi = take(p.nodal, 3 * m * n);
  p.Psi = take(p.nodal && p.has_Psi, 3 * m * n);
  p.Q = take(p.nodal && p.quadratic, 3 * m * m * n);
  return total;
}

std::uint64_t packed_size(const cardan_param_values*, const cardan_modal_view* v) {
  Packed p = header_of(*v);
  return sizeof(Packed) + sizeof(double) * lay_out(p);
}

// out += scale times the symmetric part of a 3 x 3 matrix.
void symmetric(const double* a, double scale, double* out) {
  const double half = 0.5 * scale;
  out[0] += scale * a[0], out[1] += scale * a[4], out[2] += scale * a[8];
  out[3] += half * (a[1] + a[3]), out[4] += half * (a[2] + a[6]), out[5] += half * (a[5] + a[7]);
}

int refuse(const cardan_param_values* values) {
  values->fail(values, nullptr, "lumped masses or the integrals I9 for level 2 (at most 128 modes with nodal rotary inertia)",
               "modal data without them",
               "level 2 takes `lumped`, and a `plate` with `rotary_inertia: false` and no yoke; a `beam` has rotary inertia at every "
               "node: take level 1");
  return 1;
}

int pack(const cardan_param_values* values, const cardan_modal_view* v, void* out) {
  Packed p = header_of(*v);
  const std::uint32_t m = p.m, count = lay_out(p);
  const bool nodal_fits = p.n_nodes > 0 && m <= kMaxNodalModes, no_I9 = p.level == 2 && !p.nodal && !v->I9;
  if ((p.nodal && !nodal_fits) || no_I9 || (p.rotary && m > kWork)) return refuse(values);
  double* const data = reinterpret_cast<double*>(static_cast<char*>(out) + sizeof(Packed));
  std::fill(data, data + count, 0.0);
  new (out) Packed(p);
  const auto copy = [&](std::uint32_t at, const double* from, std::size_t n) { std::copy(from, from + n, data + at); };
  if (p.nodal) {
    copy(p.mass, v->node_mass, p.n_nodes);
    copy(p.position, v->node_position, 3 * p.n_nodes);
    for (std::uint32_t j = 0; j < p.n_nodes; ++j)
      for (std::uint32_t r = 0; r < 3; ++r) {
        for (std::uint32_t c = 0; p.has_inertia && c < 3; ++c) data[p.inertia + 9 * j + 3 * r + c] = v->node_inertia[9 * j + 3 * c + r];
        for (std::uint32_t k = 0; k < m; ++k) {
          data[p.Phi + (3 * j + r) * m + k] = v->node_Phi[3 * m * j + 3 * k + r];
          if (p.has_Psi) data[p.Psi + (3 * j + r) * m + k] = v->node_Psi[3 * m * j + 3 * k + r];
        }
        const std::uint32_t first = (3 * j + r) * m * m;
        for (std::uint32_t k = 0; p.quadratic && k < m; ++k)
          for (std::uint32_t l = 0; l < m; ++l)
            data[p.Q + first + k * m + l] = 0.5 * (v->node_Q[first + k * m + l] + v->node_Q[first + l * m + k]);
      }
    return 0;
  }
  copy(p.I2, v->I2, 3);
  symmetric(v->I7, 1.0, data + p.J);
  for (std::uint32_t k = 0; k < m; ++k) {
    copy(p.M_re + 6 * k, v->I4 + 3 * k, 3);
    copy(p.M_re + 6 * k + 3, v->I3 + 3 * k, 3);
  }
  copy(p.M_ee, v->I6, m * m);
  if (p.level == 0) return 0;
  const Couplings couplings{*v};
  if (p.sparse) {
    std::vector<std::uint32_t> begin, of;
    for (std::uint32_t k = 0; k < m; ++k) {
      begin.push_back(static_cast<std::uint32_t>(of.size()));
      for (std::uint32_t l = 0; l < m; ++l) {
        if (!couplings.entry(l, k, p.sparse)) continue;
        for (std::uint32_t r = 0; r < 6; ++r)
          if ((p.sparse >> (3 + r) & 1u) != 0) data[p.d2J_entries + 6 * of.size() + r] = couplings.d2J(l, k, r);
        for (std::uint32_t r = 0; r < 3; ++r) {
          data[p.W + 3 * of.size() + r] = couplings.W(l, k, r);
          if (p.coupled) data[p.Z + 3 * of.size() + r] = couplings.Z(l, k, r);
        }
        of.push_back(l);
      }
    }
    begin.push_back(static_cast<std::uint32_t>(of.size()));
    std::memcpy(data + p.begin, begin.data(), begin.size() * sizeof(std::uint32_t));
    if (!of.empty()) std::memcpy(data + p.of, of.data(), of.size() * sizeof(std::uint32_t));
  }
  for (std::uint32_t k = 0; k < m; ++k) {
    symmetric(v->I8 + 9 * k, 2.0, data + p.dJ + 6 * k);
    if (p.rotary) symmetric(v->rotary_ww + 9 * k, 1.0, data + p.dJ + 6 * k);
    for (std::uint32_t l = 0; l < m; ++l) {
      for (std::uint32_t r = 0; r < 3 && !p.sparse; ++r) {
        const std::uint32_t lk = 3 * (l * m + k) + r;
        data[p.W + lk] = couplings.W(l, k, r);
        if (p.coupled) data[p.Z + lk] = couplings.Z(l, k, r);
      }
      if (p.level < 2) continue;
      for (std::uint32_t r = 0; r < 6; ++r)
        if ((p.sparse >> (3 + r) & 1u) == 0)
          data[p.sparse ? p.d2J[r] + l * m + k : p.d2J[0] + 6 * (l * m + k) + r] = couplings.d2J(l, k, r);
    }
  }
  if (p.rank == 0) return 0;
  const auto qr = factored(*v);
  const Eigen::MatrixXd S = qr.householderQ() * Eigen::MatrixXd::Identity(m * m, p.rank);
  const Eigen::MatrixXd R = qr.matrixQR().topRows(p.rank).triangularView<Eigen::Upper>();
  Eigen::Map<Eigen::MatrixXd>(data + p.F, p.rank, m) = R * qr.colsPermutation().transpose();
  for (std::uint32_t r = 0; r < p.rank; ++r)
    for (std::uint32_t l = 0; l < m; ++l) copy(p.S + (l * p.rank + r) * m, S.col(r).data() + l * m, m);
  return 0;
}

const Packed& self(const void* packed) { return *static_cast<const Packed*>(packed); }

void facts(const void* packed, cardan_body_facts* f) {
  const Packed& p = self(packed);
  f->m_ee_constant = !p.nodal && p.rank == 0;
  f->m_re_constant = p.level == 0;
  f->j_constant = p.level == 0;
  f->states = !p.nodal;
}

// y += sum_l x_l a_l, vectors of length n that stand `stride` apart.
template <class A, class T>
CARDAN_INTO_CLONES void add_combination(const A* a, std::uint32_t stride, const T* x, std::uint32_t m, std::uint32_t n, T* __restrict y) {
  std::uint32_t l = 0;
  for (; l + 4 <= m; l += 4) {
    const A *a0 = a + l * stride, *a1 = a0 + stride, *a2 = a1 + stride, *a3 = a2 + stride;
    for (std::uint32_t i = 0; i < n; ++i) y[i] += (x[l] * a0[i] + x[l + 1] * a1[i]) + (x[l + 2] * a2[i] + x[l + 3] * a3[i]);
  }
  for (; l < m; ++l)
    for (std::uint32_t i = 0; i < n; ++i) y[i] += x[l] * a[l * stride + i];
}

// y_i = sum_l x_l W_l,k+i, n of them; `at`: of W or of Z.
template <class T>
CARDAN_INTO_CLONES void couplings(const Packed& p, std::uint32_t at, const T* x, std::uint32_t k, std::uint32_t n, T* __restrict y) {
  const double* a = p.at(at);
  if (!p.sparse) {
    std::fill(y, y + 3 * n, T{});
    return add_combination(a + 3 * k, 3 * p.m, x, p.m, 3 * n, y);
  }
  const std::uint32_t *begin = p.whole(p.begin) + k, *of = p.whole(p.of);
  for (std::uint32_t i = 0; i < n; ++i, y += 3) {
    T s[3] = {}, t[3] = {};
    std::uint32_t e = begin[i];
    for (; e + 2 <= begin[i + 1]; e += 2) {
      const T u = x[of[e]], v = x[of[e + 1]];
      s[0] += u * a[3 * e], s[1] += u * a[3 * e + 1], s[2] += u * a[3 * e + 2];
      t[0] += v * a[3 * e + 3], t[1] += v * a[3 * e + 4], t[2] += v * a[3 * e + 5];
    }
    if (e < begin[i + 1])
      for (int r = 0; r < 3; ++r) s[r] += x[of[e]] * a[3 * e + r];
    for (int r = 0; r < 3; ++r) y[r] = s[r] + t[r];
  }
}

// sum_l x_l a_l of six numbers each, added to `out`.
template <class T>
CARDAN_INTO_CLONES void add_six(const double* a, const T* x, std::uint32_t m, T* out) {
  T s[6] = {}, t[6] = {};
  std::uint32_t l = 0;
  for (; l + 2 <= m; l += 2, a += 12) {
    for (int i = 0; i < 6; ++i) s[i] += x[l] * a[i];
    for (int i = 0; i < 6; ++i) t[i] += x[l + 1] * a[6 + i];
  }
  for (int i = 0; l < m && i < 6; ++i) s[i] += x[l] * a[i];
  for (int i = 0; i < 6; ++i) out[i] += s[i] + t[i];
}

// The same with two sets of factors.
template <class T>
CARDAN_INTO_CLONES void add_six(const double* a, const T* x, const T* y, std::uint32_t m, T* out_x, T* out_y) {
  T s[6] = {}, t[6] = {};
  for (std::uint32_t l = 0; l < m; ++l)
    for (int i = 0; i < 6; ++i) {
      s[i] += x[l] * a[6 * l + i];
      t[i] += y[l] * a[6 * l + i];
    }
  for (int i = 0; i < 6; ++i) out_x[i] += s[i], out_y[i] += t[i];
}

// y += scale a* b.
template <class A, class T>
CARDAN_INTO_CLONES void add_dot(const A* a, const T* b, std::uint32_t n, double scale, T& y) {
  T sum{};
  for (std::uint32_t i = 0; i < n; ++i) sum += a[i] * b[i];
  y += scale * sum;
}
CARDAN_INTO_CLONES double dot(const double* a, const double* b, std::uint32_t n) {
  double sum = 0.0;
  add_dot(a, b, n, 1.0, sum);
  return sum;
}

template <class T>
CARDAN_INTO_CLONES Vec3<T> times(const T* s, const Vec3<T>& a) {
  return {s[0] * a.x + s[3] * a.y + s[4] * a.z, s[3] * a.x + s[1] * a.y + s[5] * a.z, s[4] * a.x + s[5] * a.y + s[2] * a.z};
}

template <class T>
CARDAN_INTO_CLONES void write_rr(double m, const Vec3<T>& mc, const T* J, T* M_rr) {
  M_rr[0] = m - T{}, M_rr[1] = mc.x, M_rr[2] = mc.y, M_rr[3] = mc.z;
  std::copy(J, J + 6, M_rr + 4);
}

// A mass node at (eta, eta'): everything the nodal form needs (mathematics 3.2, 3.4, 3.6).
struct NodeState {
  double mass;
  V3 rho, rho_rate, quadratic_rate;                     // quadratic_rate = eta'* Q eta'
  double Phi[3][kMaxNodalModes], W[3][kMaxNodalModes];  // effective shapes by rows: Phi + Q eta, Jl Psi
  M3 I;
  V3 w_rel, w_rel_rate;  // W eta', dJl(theta; theta') theta'
};

// rate may be null: then no rates.
void node_at(const Packed& p, std::uint32_t j, const double* eta, const double* rate, NodeState& s) {
  const std::uint32_t m = p.m;
  s.mass = p.at(p.mass)[j];
  s.rho = p.vec(p.position + 3 * j);
  s.rho_rate = s.quadratic_rate = s.w_rel = s.w_rel_rate = {};
  double* const rho[3] = {&s.rho.x, &s.rho.y, &s.rho.z};
  double* const rho_rate[3] = {&s.rho_rate.x, &s.rho_rate.y, &s.rho_rate.z};
  double* const quadratic[3] = {&s.quadratic_rate.x, &s.quadratic_rate.y, &s.quadratic_rate.z};
  for (std::uint32_t r = 0; r < 3; ++r) {
    const double* Phi = p.at(p.Phi + (3 * j + r) * m);
    std::copy(Phi, Phi + m, s.Phi[r]);
    *rho[r] += dot(Phi, eta, m);
    if (p.quadratic) {  // Phi + Q eta; rho with one half of it
      const double* Q = p.at(p.Q + (3 * j + r) * m * m);
      double Qe[kMaxNodalModes] = {}, Qr[kMaxNodalModes] = {};
      add_combination(Q, m, eta, m, m, Qe);
      *rho[r] += 0.5 * dot(Qe, eta, m);
      for (std::uint32_t k = 0; k < m; ++k) s.Phi[r][k] += Qe[k];
      if (rate) {
        add_combination(Q, m, rate, m, m, Qr);
        *quadratic[r] = dot(Qr, rate, m);
      }
    }
    if (rate) *rho_rate[r] = dot(s.Phi[r], rate, m);
  }
  const double* I = p.at(p.inertia + 9 * j);
  s.I = p.has_inertia ? M3{I[0], I[1], I[2], I[3], I[4], I[5], I[6], I[7], I[8]} : M3{};
  if (!p.has_Psi) {
    for (auto& row : s.W) std::fill(row, row + m, 0.0);
    return;
  }
  const double *x = p.at(p.Psi + 3 * j * m), *y = x + m, *z = y + m;
  const V3 t{dot(x, eta, m), dot(y, eta, m), dot(z, eta, m)};
  const auto c = rotation_coefficients(cardan::dot(t, t));
  const M3 Jl = rotation_of_vector(RotationCoefficients<double>{c.a, c.b, 0, 0, 0}, t);
  const double rows[3][3] = {{Jl.xx, Jl.xy, Jl.xz}, {Jl.yx, Jl.yy, Jl.yz}, {Jl.zx, Jl.zy, Jl.zz}};
  for (int r = 0; r < 3; ++r)
    for (std::uint32_t k = 0; k < m; ++k) s.W[r][k] = rows[r][0] * x[k] + rows[r][1] * y[k] + rows[r][2] * z[k];
  if (p.has_inertia) {
    const M3 R = rotation_of_vector(c, t);
    s.I = R * s.I * transpose(R);
  }
  if (!rate) return;
  const V3 td{dot(x, rate, m), dot(y, rate, m), dot(z, rate, m)};
  s.w_rel = Jl * td;
  s.w_rel_rate = left_jacobian_dot(c, t, td, td);
}

void nodal_mass(const Packed& p, const double* eta, double* M_rr, double* M_re, double* M_ee) {
  const std::uint32_t m = p.m;
  V3 mc{};
  double J[6] = {};
  if (M_re) std::fill(M_re, M_re + 6 * m, 0.0);
  if (M_ee) std::fill(M_ee, M_ee + m * m, 0.0);
  NodeState s;
  for (std::uint32_t j = 0; j < p.n_nodes; ++j) {
    node_at(p, j, eta, nullptr, s);
    const V3 h = s.mass * s.rho;
    mc += h;
    J[0] += s.I.xx + (h.y * s.rho.y + h.z * s.rho.z), J[1] += s.I.yy + (h.x * s.rho.x + h.z * s.rho.z);
    J[2] += s.I.zz + (h.x * s.rho.x + h.y * s.rho.y);
    J[3] += s.I.xy - h.x * s.rho.y, J[4] += s.I.xz - h.x * s.rho.z, J[5] += s.I.yz - h.y * s.rho.z;
    for (std::uint32_t k = 0; k < m; ++k) {
      const V3 f = s.mass * V3{s.Phi[0][k], s.Phi[1][k], s.Phi[2][k]}, n = s.I * V3{s.W[0][k], s.W[1][k], s.W[2][k]};
      if (M_re) {
        const V3 moment = n + cross(s.rho, f);
        double* c = M_re + 6 * k;
        c[0] += moment.x, c[1] += moment.y, c[2] += moment.z, c[3] += f.x, c[4] += f.y, c[5] += f.z;
      }
      if (!M_ee) continue;
      double* column = M_ee + m * k;
      for (std::uint32_t l = k; l < m; ++l)
        column[l] += (f.x * s.Phi[0][l] + f.y * s.Phi[1][l] + f.z * s.Phi[2][l]) + (n.x * s.W[0][l] + n.y * s.W[1][l] + n.z * s.W[2][l]);
    }
  }
  for (std::uint32_t k = 0; M_ee && k < m; ++k)
    for (std::uint32_t l = 0; l < k; ++l) M_ee[m * k + l] = M_ee[m * l + k];
  if (M_rr) write_rr(p.I1, mc, J, M_rr);
}

void nodal_bias(const Packed& p, const double* eta, const double* rate, const V3& w, double* b) {
  const std::uint32_t m = p.m;
  std::fill(b, b + 6 + m, 0.0);
  NodeState s;
  V3 moments{}, forces{};
  for (std::uint32_t j = 0; j < p.n_nodes; ++j) {
    node_at(p, j, eta, rate, s);
    const V3 force = s.mass * (cross(w, cross(w, s.rho)) + 2.0 * cross(w, s.rho_rate) + s.quadratic_rate);
    const V3 total = w + s.w_rel;
    const V3 moment = s.I * (s.w_rel_rate + cross(w, s.w_rel)) + cross(total, s.I * total);
    moments += cross(s.rho, force) + moment;
    forces += force;
    for (std::uint32_t k = 0; k < m; ++k)
      b[6 + k] += (s.Phi[0][k] * force.x + s.Phi[1][k] * force.y + s.Phi[2][k] * force.z) +
                  (s.W[0][k] * moment.x + s.W[1][k] * moment.y + s.W[2][k] * moment.z);
  }
  b[0] = moments.x, b[1] = moments.y, b[2] = moments.z, b[3] = forces.x, b[4] = forces.y, b[5] = forces.z;
}

// Of n modes from k on: second[r][i] = number r of sum_l eta_l d2J_k+i,l.
template <class T>
CARDAN_INTO_CLONES void second_slopes(const Packed& p, const T* eta, std::uint32_t k, std::uint32_t n, T (&second)[6][kBlock]) {
  const std::uint32_t *begin = p.whole(p.begin) + k, *of = p.whole(p.of);
  for (std::uint32_t i = 0; i < n; ++i) {
    T sum[6] = {};
    if (!p.sparse) add_six(p.at(p.d2J[0]) + 6 * p.m * (k + i), eta, p.m, sum);
    for (std::uint32_t e = p.sparse ? begin[i] : 0; p.sparse && e < begin[i + 1]; ++e) {
      const double* a = p.at(p.d2J_entries) + 6 * e;
      for (std::uint32_t r = 0; r < 6; ++r) sum[r] += eta[of[e]] * a[r];
    }
    for (std::uint32_t r = 0; r < 6; ++r) second[r][i] = sum[r];
  }
  for (std::uint32_t r = 0; r < 6; ++r)
    if (p.sparse && (p.sparse >> (3 + r) & 1u) == 0) add_combination(p.at(p.d2J[r]) + k, p.m, eta, p.m, n, second[r]);
}

template <class T>
CARDAN_INTO_CLONES void polynomial_mass(const Packed& p, const T* eta, T* M_rr, T* M_re, T* M_ee) {
  const std::uint32_t m = p.m;
  const double* re = p.at(p.M_re);
  if (M_rr) {
    T first[6] = {}, J[6];
    add_six(re, eta, m, first);
    for (int i = 0; i < 6; ++i) J[i] = p.at(p.J)[i] - T{};
    if (p.level >= 1) add_six(p.at(p.dJ), eta, m, J);
    // 1/2 sum_kl eta_k eta_l d2J_kl
    for (std::uint32_t k = 0; p.level == 2 && !p.sparse && k < m; ++k) {
      T d[6] = {};
      const double* d2J = p.at(p.d2J[0]) + 6 * (m * k + k);
      add_six(d2J + 6, eta + k + 1, m - k - 1, d);
      for (int i = 0; i < 6; ++i) J[i] += eta[k] * (d[i] + 0.5 * eta[k] * d2J[i]);
    }
    for (std::uint32_t k = 0; p.level == 2 && p.sparse && k < m; k += kBlock) {
      const std::uint32_t n = std::min(kBlock, m - k);
      T second[6][kBlock];
      second_slopes(p, eta, k, n, second);
      for (std::uint32_t r = 0; r < 6; ++r) add_dot(second[r], eta + k, n, 0.5, J[r]);
    }
    const double* I2 = p.at(p.I2);
    write_rr(p.I1, Vec3<T>{I2[0] + first[3], I2[1] + first[4], I2[2] + first[5]}, J, M_rr);
  }
  if (M_re) {
    for (std::uint32_t i = 0; i < 6 * m; ++i) M_re[i] = re[i] - T{};
    if (p.level >= 1)
      for (std::uint32_t k = 0; k < m; k += kBlock) {
        const std::uint32_t n = std::min(kBlock, m - k);
        T we[3 * kBlock];
        couplings(p, p.W, eta, k, n, we);
        for (std::uint32_t i = 0; i < n; ++i)
          for (std::uint32_t r = 0; r < 3; ++r) M_re[6 * (k + i) + r] += we[3 * i + r];
      }
  }
  if (M_ee) {
    for (std::uint32_t i = 0; i < m * m; ++i) M_ee[i] = p.at(p.M_ee)[i] - T{};
    if (p.rank == 0) return;
    T factor[kWork];  // sum_i F_ri eta_i
    std::fill(factor, factor + p.rank, T{});
    add_combination(p.at(p.F), p.rank, eta, m, p.rank, factor);
    for (std::uint32_t l = 0; l < m; ++l) {
      add_combination(p.at(p.S) + m * p.rank * l + l, m, factor, p.rank, m - l, M_ee + m * l + l);
      for (std::uint32_t k = l + 1; k < m; ++k) M_ee[m * k + l] = M_ee[m * l + k];
    }
  }
}

// b_w = w x (M_ww w + M_we eta') + Mdot_ww w + Mdot_we eta';  b_v = w x (w x mc) + 2 w x u;
// b_e,k = (Mdot_we* w + Mdot_ee eta')_k - 1/2 w* dM_ww,k w - w* dM_we,k eta' - 1/2 eta'* dM_ee,k eta'   (mathematics 3.4)
template <class T>
CARDAN_INTO_CLONES void polynomial_bias(const Packed& p, const T* eta, const T* etadot, const Vec3<T>& w, T* b) {
  const std::uint32_t m = p.m;
  T first[6] = {}, rates[6] = {};
  add_six(p.at(p.M_re), eta, etadot, m, first, rates);
  const double* I2 = p.at(p.I2);
  const Vec3<T> mc{I2[0] + first[3], I2[1] + first[4], I2[2] + first[5]}, u{rates[3], rates[4], rates[5]};
  Vec3<T> we{rates[0], rates[1], rates[2]}, we_rate{};  // M_we eta', Mdot_we eta'
  T J[6], J_rate[6] = {};                               // M_ww, Mdot_ww
  for (int i = 0; i < 6; ++i) J[i] = p.at(p.J)[i] - T{};
  if (p.level == 0) std::fill(b + 6, b + 6 + m, T{});
  if (p.level >= 1) {
    const T ww[6] = {w.x * w.x, w.y * w.y, w.z * w.z, 2 * w.x * w.y, 2 * w.x * w.z, 2 * w.y * w.z};
    add_six(p.at(p.dJ), eta, etadot, m, J, J_rate);
    for (std::uint32_t k = 0; k < m; k += kBlock) {
      const std::uint32_t n = std::min(kBlock, m - k);
      T B[3 * kBlock], Z[3 * kBlock];  // sum_l eta'_l W_lk, sum_l eta'_l (W_lk - W_kl)
      couplings(p, p.W, etadot, k, n, B);
      if (p.coupled) couplings(p, p.Z, etadot, k, n, Z);
      T second[6][kBlock];
      if (p.level == 2) second_slopes(p, eta, k, n, second);
      for (std::uint32_t i = 0; i < n; ++i) {
        const std::uint32_t mode = k + i;
        const Vec3<T> column{B[3 * i], B[3 * i + 1], B[3 * i + 2]};
        const Vec3<T> turn = p.coupled ? Vec3<T>{Z[3 * i], Z[3 * i + 1], Z[3 * i + 2]} : column + column;  // I5_lk = -I5_kl
        we_rate += etadot[mode] * column;
        we += eta[mode] * (column - turn);  // sum_l W_kl eta'_l
        const double* d = p.at(p.dJ) + 6 * mode;
        T slope[6];
        for (std::uint32_t r = 0; r < 6; ++r) slope[r] = d[r] - T{};
        for (std::uint32_t r = 0; p.level == 2 && r < 6; ++r) {
          J[r] += 0.5 * eta[mode] * second[r][i];
          J_rate[r] += etadot[mode] * second[r][i];
          slope[r] += second[r][i];
        }
        b[6 + mode] = (w.x * turn.x + w.y * turn.y + w.z * turn.z) - 0.5 * ((ww[0] * slope[0] + ww[1] * slope[1] + ww[2] * slope[2]) +
                                                                            (ww[3] * slope[3] + ww[4] * slope[4] + ww[5] * slope[5]));
      }
    }
    if (p.rank > 0) {  // Mdot_ee eta' - 1/2 eta'* dM_ee eta'
      T factor[kWork], half[kWork];
      std::fill(factor, factor + p.rank, T{});
      add_combination(p.at(p.F), p.rank, etadot, m, p.rank, factor);
      const std::uint32_t rows = kWork / m;
      for (std::uint32_t r = 0; r < p.rank; r += rows) {
        const std::uint32_t n = std::min(rows, p.rank - r);
        T S[kWork];  // S_r eta', n of m
        std::fill(S, S + n * m, T{});
        add_combination(p.at(p.S) + m * r, m * p.rank, etadot, m, n * m, S);
        add_combination(S, m, factor + r, n, m, b + 6);
        for (std::uint32_t i = 0; i < n; ++i) half[r + i] = T{}, add_dot(S + m * i, etadot, m, 0.5, half[r + i]);
      }
      for (std::uint32_t k = 0; k < m; ++k) add_dot(p.at(p.F) + p.rank * k, half, p.rank, -1.0, b[6 + k]);
    }
  }
  const Vec3<T> b_w = cross(w, times(J, w) + we) + times(J_rate, w) + we_rate, b_v = cross(w, cross(w, mc) + (u + u));
  b[0] = b_w.x, b[1] = b_w.y, b[2] = b_w.z, b[3] = b_v.x, b[4] = b_v.y, b[5] = b_v.z;
}

CARDAN_KERNEL_CLONES void mass(const void* packed, const double* eta, double* M_rr, double* M_re, double* M_ee) {
  const Packed& p = self(packed);
  if (p.nodal) return nodal_mass(p, eta, M_rr, M_re, M_ee);
  polynomial_mass(p, eta, M_rr, M_re, M_ee);
}

CARDAN_KERNEL_CLONES void bias(const void* packed, const double* eta, const double* etadot, const double* omega, double* b) {
  const Packed& p = self(packed);
  const V3 w{omega[0], omega[1], omega[2]};
  if (p.nodal) return nodal_bias(p, eta, etadot, w, b);
  polynomial_bias(p, eta, etadot, w, b);
}

template <int N>
CARDAN_INTO_CLONES void both_of(const Packed& p, const double* eta, const double* etadot, const double* omega, double* M_rr, double* M_re,
                                double* M_ee, double* b) {
  using T = typename SideBySide<N>::type;
  const auto in = [](const double* a) __attribute__((always_inline)) { return reinterpret_cast<const T*>(a); };
  const auto out = [](double* a) __attribute__((always_inline)) { return reinterpret_cast<T*>(a); };
  polynomial_mass(p, in(eta), out(M_rr), out(M_re), out(M_ee));
  if (etadot) polynomial_bias(p, in(eta), in(etadot), Vec3<T>{in(omega)[0], in(omega)[1], in(omega)[2]}, out(b));
}
#define CARDAN_STATES(N, TARGET)                                                                                                    \
  TARGET void states_##N(const Packed& p, const double* eta, const double* etadot, const double* omega, double* M_rr, double* M_re, \
                         double* M_ee, double* b) {                                                                                 \
    both_of<N>(p, eta, etadot, omega, M_rr, M_re, M_ee, b);                                                                         \
  }
#ifdef CARDAN_ONE_SET
#define CARDAN_TARGET(set) CARDAN_KERNEL_CLONES
#elif defined(__x86_64__)
#define CARDAN_TARGET(set) __attribute__((target(set)))
#else
#define CARDAN_TARGET(set)
#endif
CARDAN_STATES(2, )
CARDAN_STATES(4, CARDAN_TARGET("arch=x86-64-v3"))
CARDAN_STATES(8, CARDAN_TARGET("arch=x86-64-v4"))
#undef CARDAN_TARGET
#undef CARDAN_STATES

void states(const void* packed, std::uint32_t n, const double* eta, const double* etadot, const double* omega, double* M_rr, double* M_re,
            double* M_ee, double* b) {
  const auto of = n == 2 ? states_2 : n == 4 ? states_4 : states_8;
  of(self(packed), eta, etadot, omega, M_rr, M_re, M_ee, b);
}

}  // namespace

const cardan_body_family& modal_flexible_family() {
  static const cardan_body_family family = [] {
    cardan_body_family f{};
    f.struct_size = sizeof(cardan_body_family);
    f.type = "modal_flexible";
    f.summary = "flexible body: floating frame and modal coordinates";
    f.mass_source = CARDAN_MASS_MODES;
    f.packed_size = packed_size;
    f.pack = pack;
    f.facts = facts;
    f.mass = mass;
    f.bias = bias;
    f.states = states;
    return f;
  }();
  return family;
}

}  // namespace cardan
