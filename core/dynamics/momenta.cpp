#include "core/dynamics/momenta.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/diagnostic.hpp"
#include "core/base/units.hpp"
#include "core/soa/kernels_modes.hpp"
#include "core/soa/tangent.hpp"

namespace cardan {
namespace {

using Vec = Vec3<double>;

/// V x* f: what a force that moves with V changes by in the moving axes.
Force<double> moving(const Motion<double>& V, const Force<double>& f) { return {cross(V.w, f.n) + cross(V.v, f.f), cross(V.w, f.f)}; }

double component(const Vec& a, int i) { return i == 0 ? a.x : i == 1 ? a.y : a.z; }

/// Whether M_re and M_ee of a body are linear in eta: where they are at three points of a line that lies askew, they are on every one of
/// it, and no family is linear on such a line alone.
bool is_linear(const FlexibleBody& f, int m) {
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  std::vector<double> eta(at(m)), rr(10), re(at(6 * m)), ee(at(m * m)), values[3];
  for (int point = 0; point < 3; ++point) {
    for (int j = 0; j < m; ++j) eta[at(j)] = 0.01 * (point - 1) * std::cos(1.0 + j) / std::sqrt(f.M_ee[at(m * j + j)]);
    f.family->mass(f.packed.data(), eta.data(), rr.data(), f.M_re_constant ? nullptr : re.data(), f.M_ee_constant ? nullptr : ee.data());
    values[point] = re;
    values[point].insert(values[point].end(), ee.begin(), ee.end());
  }
  double bent = 0.0, size = 0.0;
  for (std::size_t i = 0; i < values[0].size(); ++i) {
    bent = std::max(bent, std::abs(values[0][i] - 2.0 * values[1][i] + values[2][i]));
    size = std::max(size, std::abs(values[0][i]) + std::abs(values[2][i]));
  }
  return bent <= 1e-14 * size;
}

/// sign times the rate of the momenta of the modes, of what passes through a node that they move: h is the momentum beyond it [about the
/// node; linear], w the angular velocity of the body, v the velocity of the node; body axes. With a column c = [Jl psi; phi] it is
/// (dc/dt) . h - c_w . (v x h_f).
void add_rate_through_node(const NodeShapes& shapes, const double* eta, const double* etadot, const Vec& w, const Vec& v,
                           const Force<double>& h, double sign, double* rate) {
  double x[6], dx[6];
  soa::sum_columns(shapes.columns.data(), eta, shapes.n_modes, x);
  soa::sum_columns(shapes.columns.data(), etadot, shapes.n_modes, dx);
  const Vec theta{x[0], x[1], x[2]}, theta_rate{dx[0], dx[1], dx[2]};
  const RotationCoefficients<double> c = rotation_coefficients(dot(theta, theta));
  const Mat3<double> Jl = rotation_of_vector(RotationCoefficients<double>{c.a, c.b, 0.0, 0.0, 0.0}, theta);
  const Vec turning = transpose_times(Jl, cross(h.n, w) - cross(v, h.f)) + left_jacobian_dot(c, -theta, -theta_rate, h.n);
  const Vec moving = cross(h.f, w);
  const double y[6] = {sign * turning.x, sign * turning.y, sign * turning.z, sign * moving.x, sign * moving.y, sign * moving.z};
  soa::add_to_modes(shapes.columns.data(), y, shapes.n_modes, rate);
}

}  // namespace

Momenta::Momenta(const Model& model) : model_(model), curved_of_(model.bodies.size(), -1), linear_(model.bodies.size()) {
  if (const UserBody* u = model.find_curved_nodes())
    refuse(Code::unsupported, {"momenta"}, "bodies whose nodes move along constant shapes",
           fmt::format("{}, whose type {} tells how they move", u->name, in_quotes(u->type)));
  std::size_t most = 0;
  for (std::size_t k = 1; k < model.bodies.size(); ++k) {
    const SweepBody& b = model.bodies[k];
    const auto m = static_cast<std::size_t>(b.n_modes);
    most = std::max(most, 10 + 7 * m + m * m);
    if (const FlexibleBody* f = m > 0 ? &model.flexible[static_cast<std::size_t>(b.flexible)] : nullptr; f && !f->constant)
      linear_[k] = is_linear(*f, b.n_modes);
    if (b.nv == 0 || b.shape != CARDAN_SHAPE_DENSE) continue;
    curved_of_[k] = static_cast<int>(curved_.size());
    Curved c{&model.user[static_cast<std::size_t>(model.owner[k])], false, Mat3<double>::identity()};
    for (const TurnedRecord& t : model.graded.turned)
      if (t.body == static_cast<int>(k)) c.turned = true, c.R_PS = t.R_PS;
    curved_.push_back(c);
  }
  for (std::vector<double>* x : {&ahead_, &back_, &work_}) x->resize(most);
}

void Momenta::at(Workspace& ws, const double* q, const double* v, double* p, double* rate) {
  const Model& m = model_;
  // With v as accelerations of a system at rest: gamma is the velocity of each body, z the momentum that its hinge passes on.
  inverse_dynamics(m, ws, Inputs{.q = q, .v = v, .vdot = v, .gravity = false}, p, {.velocity = false, .gravity = false, .elastic = false});
  std::fill_n(rate, m.nv, 0.0);
  for (int k = 1; k < static_cast<int>(m.bodies.size()); ++k) {
    const SweepBody& b = m.bodies[static_cast<std::size_t>(k)];
    if (b.kind == BodyKernel::rotor) continue;  // nothing depends on its angle
    if (is_axis(b.kind)) {
      const Motion<double>& V = ws.core(k).gamma;
      const Force<double>& h = ws.z(k);
      const Vec s = cross(V.w, h.n) + cross(V.v, h.f);
      rate[b.v] = -component(s, b.kind == BodyKernel::axis_x ? 0 : b.kind == BodyKernel::axis_y ? 1 : 2);
      continue;
    }
    of_hinge(ws, k, q, v, rate);
    if (b.n_modes > 0) of_inertia(ws, k, q, v, rate);
    const soa::Modal<double>* modal = ws.modal_of(k);
    if (!modal || !modal->node) continue;
    const SweepBody& inboard = m.bodies[static_cast<std::size_t>(b.parent)];
    const NodeShapes& shapes = m.shapes[static_cast<std::size_t>(b.onode)];
    const Motion<double>& V = ws.core(b.parent).gamma;
    Force<double> h = to_inboard(ws.X(k), ws.z(k));
    h.n -= cross(modal->node->rho, h.f);
    double dx[6];
    soa::sum_columns(shapes.columns.data(), v + inboard.etadot, shapes.n_modes, dx);
    add_rate_through_node(shapes, q + inboard.eta, v + inboard.etadot, V.w, V.v + cross(V.w, modal->node->rho) + Vec{dx[3], dx[4], dx[5]},
                          h, 1.0, rate + inboard.etadot);
  }
}

/// Through a column H of the hinge map: (dH/dt + V x H) . h = dH/dt . h - H . (V x* h), all at P in P axes.
void Momenta::of_hinge(const Workspace& ws, int k, const double* q, const double* v, double* rate) {
  const SweepBody& b = model_.bodies[static_cast<std::size_t>(k)];
  Motion<double> V = ws.core(k).gamma;
  Force<double> h = ws.z(k);
  Mat3<double> R = Mat3<double>::identity();
  Vec rho{};
  if (b.pnode >= 0) {  // from B to P
    const NodeShapes& shapes = model_.shapes[static_cast<std::size_t>(b.pnode)];
    soa::DeformedNode<double> at_P;
    soa::deform<double>(shapes, q + b.eta, v + b.etadot, at_P);
    R = at_P.R, rho = at_P.rho;
    h.n -= cross(rho, h.f);
    V = {V.w + at_P.rate.w, V.v + cross(V.w, rho) + at_P.rate.v};
    if (ws.modal_of(k)->C) add_rate_through_node(shapes, q + b.eta, v + b.etadot, ws.core(k).gamma.w, V.v, h, -1.0, rate + b.etadot);
    h = {transpose_times(R, h.n), transpose_times(R, h.f)};
    V = {transpose_times(R, V.w), transpose_times(R, V.v)};
  }
  const Force<double> s = moving(V, h);
  const double* rates = v + b.v;
  Motion<double> H[6], relative{};
  for (int j = 0; j < b.nv; ++j) {
    H[j] = soa::hinge_column(model_, ws, k, j);
    if (b.pnode >= 0) H[j] = {transpose_times(R, H[j].w), transpose_times(R, H[j].v + cross(H[j].w, rho))};
    rate[b.v + j] = -dot(H[j], s);
    relative += rates[j] * H[j];
  }
  if (b.shape == CARDAN_SHAPE_FREE)  // the position counts along axes of O, which turn with -omega seen from P
    for (int j = 3; j < 6; ++j) rate[b.v + j] += dot(H[j].v, cross(relative.w, h.f));
  if (curved_of_[static_cast<std::size_t>(k)] < 0) return;
  // Of dH_j/dt = sum_i v_i d_i H_j the part that is symmetric in i and j by the quadratic form Hdot* v, the other by
  // d_i H_j - d_j H_i = -H_i x H_j (Maurer, Cartan).
  const Curved& c = curved_[static_cast<std::size_t>(curved_of_[static_cast<std::size_t>(k)])];
  double size = 0.0;
  for (int j = 0; j < b.nv; ++j) size = std::max(size, std::abs(rates[j]));
  if (size == 0.0) return;
  const std::uint32_t first = 0;
  const auto form = [&](const double* at) {
    cardan_hinge_out out{};
    c.user->hinge->kinematics(c.user->hinge_packed.data(), 1, &first, &first, q + b.q, at, &out);
    const double* a = out.Hdot_v;
    const Motion<double> Hdot_v{{a[0], a[1], a[2]}, {a[3], a[4], a[5]}};
    return c.turned ? Motion<double>{transpose_times(c.R_PS, Hdot_v.w), transpose_times(c.R_PS, Hdot_v.v)} : Hdot_v;
  };
  const Force<double> half = moving(relative, 0.5 * h);
  for (int j = 0; j < b.nv; ++j) {
    double plus[6], minus[6];
    std::copy_n(rates, b.nv, plus), std::copy_n(rates, b.nv, minus);
    plus[j] += size, minus[j] -= size;
    rate[b.v + j] += 0.25 / size * (dot(form(plus), h) - dot(form(minus), h)) + dot(H[j], half);
  }
}

/// dT/d eta of the body's own kinetic energy at constant [V; eta']: (dM_er/dt) V + (dM_ee/dt) eta' - M_er [0; omega x v] - b_e.
void Momenta::of_inertia(const Workspace& ws, int k, const double* q, const double* v, double* rate) {
  const SweepBody& b = model_.bodies[static_cast<std::size_t>(k)];
  const FlexibleBody& f = model_.flexible[static_cast<std::size_t>(b.flexible)];
  const soa::Modal<double>& modal = *ws.modal_of(k);
  const Motion<double>& V = ws.core(k).gamma;
  const double *eta = q + b.eta, *etadot = v + b.etadot, *M_re = modal.P_re ? modal.P_re : f.M_re.data();
  double* out = rate + b.etadot;
  const int m = b.n_modes;
  const Vec a = cross(V.w, V.v);
  for (int j = 0; j < m; ++j) out[j] -= M_re[6 * j + 3] * a.x + M_re[6 * j + 4] * a.y + M_re[6 * j + 5] * a.z;
  if (f.constant) return;
  const int n_re = f.M_re_constant ? 0 : 6 * m, n_ee = f.M_ee_constant ? 0 : m * m, n = 10 + n_re + n_ee;
  f.family->bias(f.packed.data(), eta, etadot, &V.w.x, ahead_.data());
  for (int j = 0; j < m; ++j) out[j] -= ahead_[static_cast<std::size_t>(6 + j)];
  double moved = 0.0;  // [sqrt(kg) m/s] by the modal mass
  for (int j = 0; j < m; ++j) moved += std::abs(etadot[j]) * std::sqrt(f.M_ee[static_cast<std::size_t>(m * j + j)]);
  if (n == 10 || moved == 0.0) return;
  const double size = std::sqrt(0.5 * (f.M_rr.J.xx + f.M_rr.J.yy + f.M_rr.J.zz)), h = (size > 0.0 ? size : 1.0) / moved;
  double *slope = ahead_.data(), *work = back_.data(), *at = work_.data();
  const auto mass = [&](double s, double* to) {
    for (int j = 0; j < m; ++j) at[j] = eta[j] + s * etadot[j];
    f.family->mass(f.packed.data(), at, to, n_re > 0 ? to + 10 : nullptr, n_ee > 0 ? to + 10 + n_re : nullptr);
  };
  if (linear_[static_cast<std::size_t>(k)] != 0) {
    mass(h, slope), mass(-h, work);
    for (int i = 10; i < n; ++i) slope[i] = 0.5 / h * (slope[i] - work[i]);
  } else {
    soa::derivative(mass, 0.01 * h, n, slope, work);
  }
  const double w[6] = {V.w.x, V.w.y, V.w.z, V.v.x, V.v.y, V.v.z};
  for (int j = 0; j < m; ++j) {
    double sum = 0.0;
    for (int i = 0; i < 6 && n_re > 0; ++i) sum += slope[10 + 6 * j + i] * w[i];
    for (int i = 0; i < m && n_ee > 0; ++i) sum += slope[10 + n_re + m * i + j] * etadot[i];
    out[j] += sum;
  }
}

}  // namespace cardan
