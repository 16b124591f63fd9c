#include "core/dynamics/diagonal_velocities.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/dynamics/inverse.hpp"
#include "core/model/loops.hpp"
#include "core/soa/kernels_axis.hpp"
#include "core/soa/kernels_free.hpp"
#include "core/soa/kernels_modes.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan {
namespace {

using soa::Tangent;

/// What the square block of a body with the factor S (lower, D = S S*) does to x: S* x, S^-* x, or the root of the sums of squares of the
/// parts of S* x.
enum class Root : std::uint8_t { times, divide, size };
template <class T, class Lower>
void apply_root(Root what, int n, const Lower& S, T* x) {
  if (what == Root::divide) {
    for (int j = n - 1; j >= 0; --j) {
      for (int i = j + 1; i < n; ++i) x[j] = x[j] - S(i, j) * x[i];
      x[j] = x[j] / S(j, j);
    }
    return;
  }
  using std::sqrt;
  for (int j = 0; j < n; ++j) {
    T sum(0);
    for (int i = j; i < n; ++i) {
      const T part = S(i, j) * x[i];
      sum = sum + (what == Root::size ? part * part : part);
    }
    x[j] = what == Root::size ? T(sqrt(sum)) : sum;
  }
}

/// The same for the hinge of a body, for its modes.
template <class T>
void apply_hinge_root(Root what, const SweepModel& model, soa::Workspace<T>& ws, int k, T* x) {
  using std::sqrt;
  const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
  const auto packed = [](const T* L) { return [L](int i, int j) { return L[i * (i + 1) / 2 + j]; }; };
  if (b.kind == BodyKernel::rotor) {
    const T root(std::sqrt(model.axis_bodies[static_cast<std::size_t>(k)].J_axial));
    apply_root(what, 1, packed(&root), x);
  } else if (is_axis(b.kind)) {
    const T root = T(1) / T(sqrt(ws.axis(k).inverse_D));
    apply_root(what, 1, packed(&root), x);
  } else if (b.kind == BodyKernel::free) {
    const T* L = ws.free(k).L;
    T root[6];
    for (int j = 0; j < 6; ++j) root[j] = T(1) / T(sqrt(L[j * (j + 1) / 2 + j]));
    apply_root(
        what, 6, [&](int i, int j) { return i == j ? root[j] : L[i * (i + 1) / 2 + j] * root[j]; }, x);
  } else {
    soa::with_hinge_size<T>(b.nv, [&]<int NV>() {
      const T* L = ws.template hinge<NV>(k).L;
      const T root = NV == 1 && !is_general(b.kind) ? T(sqrt(L[0])) : T(0);  // D itself in the rigid kernel
      apply_root(what, NV, packed(NV == 1 && !is_general(b.kind) ? &root : L), x);
    });
  }
}
template <class T>
void apply_modal_root(Root what, const SweepModel& model, soa::Workspace<T>& ws, int k, T* x) {
  using std::sqrt;
  const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int m = b.n_modes;
  const soa::Modal<T>& modal = *ws.modal_of(k);
  if (modal.P_ee) {  // L, and 1/d on its diagonal
    const T* L = modal.P_ee;
    T* root = modal.nu;
    for (int j = 0; j < m; ++j) root[j] = T(1) / T(sqrt(L[m * j + j]));
    apply_root(
        what, m, [&](int i, int j) { return i == j ? root[j] : L[m * j + i] * root[j]; }, x);
  } else if (f.M_ee_identity) {
    for (int j = 0; what == Root::size && j < m; ++j) x[j] = T(sqrt(x[j] * x[j]));
  } else {
    apply_root(
        what, m, [&](int i, int j) { return T(f.L_ee[static_cast<std::size_t>(m * j + i)]); }, x);
  }
}

/// P_ee'^-1 P_re'* V of the modes of a body that moves with V, had they no rates: of those that have none given.
template <class T>
void modes_along(const SweepModel& model, const soa::Workspace<T>& ws, int k, const Motion<T>& V, T* out) {
  const SweepBody& b = model.bodies[static_cast<std::size_t>(k)];
  const FlexibleBody& f = model.flexible[static_cast<std::size_t>(b.flexible)];
  const int m = b.n_modes;
  const soa::Modal<T>& modal = *ws.modal_of(k);
  if (!modal.P_ee && f.M_re_constant) {
    const double* U = f.U.data();
    for (int j = 0; j < m; ++j)
      out[j] = dot(V, Force<T>{{T(U[j]), T(U[j + m]), T(U[j + 2 * m])}, {T(U[j + 3 * m]), T(U[j + 4 * m]), T(U[j + 5 * m])}});
    return;
  }
  for (int j = 0; j < m; ++j) out[j] = dot(V, soa::force_column(modal.U, j));
  if (!modal.P_ee) return;
  const T* L = modal.P_ee;
  for (int j = m - 1; j >= 0; --j) {
    out[j] = out[j] * L[m * j + j];
    for (int i = j + 1; i < m; ++i) out[j] = out[j] - L[m * j + i] * out[i];
  }
}

/// Base to tip: V of each body, and nu = S* ( v + G* x ) of v, or v of nu. x: what reaches the body but for its own free components. Both
/// hold the components with a given motion beforehand.
template <class T>
class Scatter {
 public:
  Scatter(const SweepModel& model, soa::Workspace<T>& ws, std::vector<Motion<T>>& V, const T* q, bool normalised)
      : model_(model), ws_(ws), V_(V), q_(q), normalised_(normalised) {}

  void run(bool to_nu, T* v, T* nu) {
    to_nu_ = to_nu, v_ = v, nu_ = nu;
    V_[0] = Motion<T>{};
    for (int k = 1; k < static_cast<int>(model_.bodies.size()); ++k) {
      const SweepBody& b = body(k);
      if (is_axis(b.kind))
        axis(k);
      else if (b.kind == BodyKernel::free)
        free(k);
      else
        soa::with_hinge_size<T>(b.nv, [&]<int NV>() { hinge<NV>(k); });
      if (b.n_modes > 0) modes(k);
    }
  }

 private:
  const SweepBody& body(int k) const { return model_.bodies[static_cast<std::size_t>(k)]; }
  Motion<T>& V(int k) { return V_[static_cast<std::size_t>(k)]; }
  bool given(int v) const { return model_.has_prescribed() && model_.prescribed[static_cast<std::size_t>(v)] != 0; }

  /// n components from v on, which G* x moves by `along`.
  template <class ApplyRoot>
  void exchange(int v, int n, const T* along, const ApplyRoot& apply) {
    T *x = v_ + v, *y = nu_ + v;
    if (to_nu_) {
      for (int j = 0; j < n; ++j) y[j] = given(v + j) ? T(0) : x[j] + along[j];
      if (normalised_) apply(Root::times, y);
      for (int j = 0; j < n; ++j)
        if (given(v + j)) y[j] = x[j];
      return;
    }
    for (int j = 0; j < n; ++j) x[j] = given(v + j) ? T(0) : y[j];
    if (normalised_) apply(Root::divide, x);
    for (int j = 0; j < n; ++j) x[j] = given(v + j) ? y[j] : x[j] - along[j];
  }
  void exchange_hinge(int k, const T* along) {
    exchange(body(k).v, body(k).nv, along, [&](Root what, T* x) { apply_hinge_root(what, model_, ws_, k, x); });
  }

  void axis(int k) {
    const AxisBody& a = model_.axis_bodies[static_cast<std::size_t>(k)];
    if (a.kind == BodyKernel::rotor) {
      const T along = dot(soa::rotor_axis<T>(a), V(a.parent).w);
      return exchange_hinge(k, &along);
    }
    const T c = ws_.cosines[static_cast<std::size_t>(a.angle)], s = ws_.sines[static_cast<std::size_t>(a.angle)];
    const Force<T>& G = ws_.axis(k).G;
    soa::for_axis(a.kind, [&]<int I, soa::Tilt TILT>() {
      constexpr int J = (I + 1) % 3, K = (I + 2) % 3;
      Motion<T>& x = V(k);
      x = soa::motion_to_outboard<T, I, TILT>(a, c, s, V(a.parent));
      const T along =
          cardan::at<I>(x.w) + cardan::at<J>(x.w) * cardan::at<J>(G.n) + cardan::at<K>(x.w) * cardan::at<K>(G.n) + dot(x.v, G.f);
      exchange_hinge(k, &along);
      cardan::at<I>(x.w) = cardan::at<I>(x.w) + v_[a.v];
    });
  }

  /// G = H^-1: x counts in the axes of P, and so does nu.
  void free(int k) {
    const SweepBody& b = body(k);
    const bool of_O = b.shape == CARDAN_SHAPE_FREE;
    const Mat3<T> R = soa::free_rotation(b, q_);
    Motion<T>& x = V(k);
    x = to_outboard(ws_.X(k), V(b.parent));
    const T along[6] = {x.w.x, x.w.y, x.w.z, x.v.x, x.v.y, x.v.z};
    T* v = v_ + b.v;
    const auto turn = [&](const Vec3<T>& u) { v[3] = u.x, v[4] = u.y, v[5] = u.z; };
    const Vec3<T> linear{v[3], v[4], v[5]};
    if (to_nu_ && of_O) turn(transpose_times(R, linear));
    exchange_hinge(k, along);
    x += Motion<T>{{v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
    if (of_O) turn(to_nu_ ? linear : R * Vec3<T>{v[3], v[4], v[5]});
  }

  template <int NV>
  void hinge(int k) {
    const SweepBody& b = body(k);
    Motion<T> at_O = V(b.parent);
    if (const soa::Modal<T>* modal = ws_.modal_of(k); modal && modal->node) {
      T s[6];
      soa::with_columns(model_.shapes[static_cast<std::size_t>(b.onode)], *modal->node,
                        [&](const auto* S) { soa::sum_columns(S, v_ + body(b.parent).etadot, b.n_parent_modes, s); });
      at_O += soa::motion_of_node(*modal->node, s);
    }
    Motion<T>& x = V(k);
    x = to_outboard(ws_.X(k), at_O);
    if constexpr (NV > 0) {
      const soa::Hinge<T, NV>& h = ws_.template hinge<NV>(k);
      const T* known = to_nu_ ? v_ : nu_;
      for (int j = 0; j < NV; ++j)
        if (given(b.v + j)) x += known[b.v + j] * h.H[j];
      T along[NV];
      for (int j = 0; j < NV; ++j) along[j] = dot(x, h.G[j]);
      exchange_hinge(k, along);
      for (int j = 0; j < NV; ++j)
        if (!given(b.v + j)) x += v_[b.v + j] * h.H[j];
    }
  }

  void modes(int k) {
    const SweepBody& b = body(k);
    soa::Modal<T>& modal = *ws_.modal_of(k);
    T* along = modal.accel;
    modes_along(model_, ws_, k, V(k), along);
    exchange(b.etadot, b.n_modes, along, [&](Root what, T* x) { apply_modal_root(what, model_, ws_, k, x); });
    for (int j = 0; modal.C && j < b.n_modes; ++j) V(k) -= v_[b.etadot + j] * soa::motion_column(modal.C, j);
  }

  const SweepModel& model_;
  soa::Workspace<T>& ws_;
  std::vector<Motion<T>>& V_;
  const T* q_;
  bool normalised_, to_nu_ = false;
  T *v_ = nullptr, *nu_ = nullptr;
};

Model factored(const Model& model) {
  require_open_tree(model, "diagonalised dynamics");
  Model out = model;
  for (FlexibleBody& f : out.flexible) f.by_nodes = false;
  return out;
}

}  // namespace

DiagonalVelocities::DiagonalVelocities(std::shared_ptr<const Model> model, bool normalised)
    : original_(std::move(model)),
      model_(factored(*original_)),
      normalised_(normalised),
      workspace_(model_),
      along_(model_),
      q_(static_cast<std::size_t>(model_.nq), std::numeric_limits<double>::quiet_NaN()),
      v_(static_cast<std::size_t>(model_.nv)),
      V_(model_.bodies.size()),
      q_t_(static_cast<std::size_t>(model_.nq)),
      v_t_(static_cast<std::size_t>(model_.nv)),
      nu_t_(static_cast<std::size_t>(model_.nv)),
      V_t_(model_.bodies.size()) {
  workspace_.rest.assign(static_cast<std::size_t>(model_.nv), 0.0);
  along_.rest.assign(static_cast<std::size_t>(model_.nv), Tangent(0.0));
}

void DiagonalVelocities::look_at_given() {
  if (std::ranges::equal(model_.prescribed, original_->prescribed)) return;
  model_.prescribed = original_->prescribed;
  std::ranges::fill(q_, std::numeric_limits<double>::quiet_NaN());
}

bool DiagonalVelocities::at(const double* q) {
  if (!q_.empty() && std::memcmp(q, q_.data(), sizeof(double) * q_.size()) == 0) return true;
  std::ranges::fill(q_, std::numeric_limits<double>::quiet_NaN());
  if (!articulate_at_rest(model_, workspace_, q)) {
    breakdown_ = workspace_.breakdown;
    return false;
  }
  std::copy_n(q, q_.size(), q_.begin());
  return true;
}

void DiagonalVelocities::from_velocity(const double* v, double* nu) {
  std::copy_n(v, model_.nv, v_.begin());
  Scatter<double>(model_, workspace_, V_, q_.data(), normalised_).run(true, v_.data(), nu);
}

void DiagonalVelocities::to_velocity(const double* nu, double* v) {
  std::copy_n(nu, model_.nv, v_.begin());
  Scatter<double>(model_, workspace_, V_, q_.data(), normalised_).run(false, v, v_.data());
}

void DiagonalVelocities::size(const double* v, double* nu) {
  std::copy_n(v, model_.nv, nu);
  if (!normalised_) return;
  for (int k = 1; k < static_cast<int>(model_.bodies.size()); ++k) {
    const SweepBody& b = model_.bodies[static_cast<std::size_t>(k)];
    apply_hinge_root(Root::size, model_, workspace_, k, nu + b.v);
    if (b.n_modes > 0) apply_modal_root(Root::size, model_, workspace_, k, nu + b.etadot);
  }
  for (int i = 0; i < model_.nv; ++i)
    if (is_given(i)) nu[i] = v[i];
}

bool DiagonalVelocities::rate(const double* q, const double* qdot, const double* v, const double* vdot, double* nudot) {
  for (std::size_t i = 0; i < q_t_.size(); ++i) q_t_[i] = {q[i], qdot[i]};
  for (std::size_t i = 0; i < v_t_.size(); ++i) v_t_[i] = {v[i], vdot[i]};
  if (!articulate_at_rest(model_, along_, q_t_.data())) {
    breakdown_ = along_.breakdown;
    return false;
  }
  Scatter<Tangent>(model_, along_, V_t_, q_t_.data(), normalised_).run(true, v_t_.data(), nu_t_.data());
  for (std::size_t i = 0; i < nu_t_.size(); ++i) nudot[i] = nu_t_[i].d;
  return true;
}

}  // namespace cardan
