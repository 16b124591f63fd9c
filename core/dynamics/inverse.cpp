#include "core/dynamics/inverse.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/model/loops.hpp"
#include "core/soa/gravity_field.hpp"
#include "core/soa/kernels_columns.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan {

template <class T>
void inverse_dynamics_of_tree(const Model& model, soa::Workspace<T>& ws, const soa::Inputs<T>& in, T* tau, InverseTerms terms,
                              const Part* part) {
  if (part && !kHasParts<T>) throw std::logic_error("inverse_dynamics: a part is of one state");
  const soa::Sweeps<T>& S = soa::sweeps<T>();
  soa::Inputs<T> use = in;
  use.gravity = in.gravity && terms.gravity;
  const bool central = use.gravity && model.field.pulls();
  outward(model, S, ws, use, {.vdot = in.vdot != nullptr, .velocity = terms.velocity, .inertia = in.vdot == nullptr}, part);
  if (terms.elastic && !model.flexible.empty()) S.elastic(model, ws, use);
  if (central || std::ranges::any_of(in.wrenches, [](const auto& w) { return w.world_axes; })) {
    ws.require_world();
    world(model, S, ws, use, part);
  }
  if (central) S.central_gravity(model, ws, use);
  if constexpr (kHasParts<T>)
    if (part) return gather_of_part(model, S, ws, use, tau, *part);
  S.node_wrenches(model, ws, use);
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) S.gather(model, ws, use, *run, tau);
}
template void inverse_dynamics_of_tree(const Model&, soa::Workspace<double>&, const soa::Inputs<double>&, double*, InverseTerms,
                                       const Part*);

template <class T>
void inverse_dynamics(const Model& model, soa::Workspace<T>& ws, const soa::Inputs<T>& in, T* tau, InverseTerms terms, const Part* part) {
  require_open_tree(model, "inverse dynamics");
  inverse_dynamics_of_tree(model, ws, in, tau, terms, part);
}
template void inverse_dynamics(const Model&, soa::Workspace<double>&, const soa::Inputs<double>&, double*, InverseTerms, const Part*);
template void inverse_dynamics(const Model&, soa::Workspace<soa::Lanes<2>>&, const soa::Inputs<soa::Lanes<2>>&, soa::Lanes<2>*,
                               InverseTerms, const Part*);
template void inverse_dynamics(const Model&, soa::Workspace<soa::Lanes<4>>&, const soa::Inputs<soa::Lanes<4>>&, soa::Lanes<4>*,
                               InverseTerms, const Part*);
template void inverse_dynamics(const Model&, soa::Workspace<soa::Lanes<8>>&, const soa::Inputs<soa::Lanes<8>>&, soa::Lanes<8>*,
                               InverseTerms, const Part*);
template void inverse_dynamics(const Model&, soa::Workspace<soa::Tangent>&, const soa::Inputs<soa::Tangent>&, soa::Tangent*, InverseTerms,
                               const Part*);
template void inverse_dynamics(const Model&, soa::Workspace<soa::Tangents>&, const soa::Inputs<soa::Tangents>&, soa::Tangents*,
                               InverseTerms, const Part*);

Eigen::VectorXd gravity_force(const Model& model, Workspace& ws, const double* q) {
  Eigen::VectorXd tau(model.nv);
  const Eigen::VectorXd v = Eigen::VectorXd::Zero(model.nv);
  inverse_dynamics(model, ws, Inputs{.q = q, .v = v.data()}, tau.data(), {.velocity = false, .gravity = true, .elastic = false});
  return -tau;
}

Eigen::VectorXd bias_force(const Model& model, Workspace& ws, const double* q, const double* v) {
  Eigen::VectorXd tau(model.nv);
  inverse_dynamics(model, ws, Inputs{.q = q, .v = v}, tau.data(), {.velocity = true, .gravity = false, .elastic = false});
  return tau;
}

Eigen::VectorXd elastic_force(const Model& model, const double* q, const double* v) {
  Eigen::VectorXd tau = Eigen::VectorXd::Zero(model.nv);
  for (const auto& u : model.user) {
    if (u.n_modes == 0) continue;
    const ModalData& d = *model.flexible[model.bodies[u.sweep].flexible].data;
    auto part = tau.segment(u.etadot, u.n_modes);
    if (d.K.size() > 0) part -= d.K * Eigen::Map<const Eigen::VectorXd>(q + u.eta, u.n_modes);
    if (d.C.size() > 0) part -= d.C * Eigen::Map<const Eigen::VectorXd>(v + u.etadot, u.n_modes);
  }
  return tau;
}

Eigen::VectorXd external_force(const Model& model, Workspace& ws, const double* q, std::span<const NodeWrench> wrenches) {
  Eigen::VectorXd tau(model.nv);
  const Eigen::VectorXd v = Eigen::VectorXd::Zero(model.nv);
  inverse_dynamics(model, ws, Inputs{.q = q, .v = v.data(), .wrenches = wrenches}, tau.data(),
                   {.velocity = false, .gravity = false, .elastic = false});
  return -tau;
}

namespace {

using Matrix6X = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// First six rows of Phi*(p, k): [X, A] (6 x (6 + mp)).
Matrix6X phi_star_rows(const Model& model, const Workspace& ws, int k, const double* q) {
  const SweepBody& b = model.bodies[k];
  Matrix6X rows(6, 6 + b.n_parent_modes);
  for (int j = 0; j < 6; ++j) {
    double e[6] = {};
    e[j] = 1.0;
    rows.col(j) = to_eigen(to_outboard(soa::pose_in_inboard(model, ws, k, q), motion(e)));
  }
  if (b.n_parent_modes == 0) return rows;
  const soa::ModalNode<double>& node = *ws.modal_of(k)->node;
  soa::with_columns(model.shapes[b.onode], node, [&](const double* S) {
    for (int j = 0; j < b.n_parent_modes; ++j) rows.col(6 + j) = to_eigen(to_outboard(ws.X(k), soa::motion_of_node(node, S + 6 * j)));
  });
  return rows;
}

/// With modes: composite inertia of 6 + m rows per body.
Eigen::MatrixXd flexible_mass_matrix(const Model& model, Workspace& ws, const double* q) {
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const Eigen::VectorXd v = Eigen::VectorXd::Zero(model.nv);
  const Inputs in{.q = q, .v = v.data(), .gravity = false};
  outward(model, S, ws, in, {.velocity = false});

  const int n = static_cast<int>(model.bodies.size());
  std::vector<Eigen::MatrixXd> R(static_cast<std::size_t>(n));  // composite inertia, (6 + m) square
  std::vector<Matrix6X> A(static_cast<std::size_t>(n));
  for (int k = 1; k < n; ++k) {
    const SweepBody& b = model.bodies[k];
    Eigen::MatrixXd& M = R[k];
    M.setZero(6 + b.n_modes, 6 + b.n_modes);
    M.topLeftCorner<6, 6>() = to_eigen(b.n_modes > 0 ? ws.core(k).P : articulated(b.M));
    if (b.n_modes > 0) {
      const auto& modal = *ws.modal_of(k);
      const FlexibleBody& f = model.flexible[b.flexible];
      const double *M_ee = modal.P_ee ? modal.P_ee : f.M_ee.data(), *M_re = modal.P_re ? modal.P_re : f.M_re.data();
      M.topRightCorner(6, b.n_modes) = Eigen::Map<const Matrix6X>(M_re, 6, b.n_modes);
      M.bottomLeftCorner(b.n_modes, 6) = M.topRightCorner(6, b.n_modes).transpose();
      M.bottomRightCorner(b.n_modes, b.n_modes) = Eigen::Map<const Eigen::MatrixXd>(M_ee, b.n_modes, b.n_modes);
    }
    A[k] = phi_star_rows(model, ws, k, q);
  }
  const auto H_star = [&](int k) {  // (6 + m) x (nv + m) of mathematics 3.8
    const SweepBody& b = model.bodies[k];
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(6 + b.n_modes, b.nv + b.n_modes);
    for (int j = 0; j < b.nv; ++j) H.col(j).head<6>() = to_eigen(soa::hinge_column(model, ws, k, j));
    if (b.n_modes > 0) {
      if (const double* C = ws.modal_of(k)->C) H.topRightCorner(6, b.n_modes) = -Eigen::Map<const Matrix6X>(C, 6, b.n_modes);
      H.bottomRightCorner(b.n_modes, b.n_modes).setIdentity();
    }
    return H;
  };
  // Columns of a block in the user's v: hinge then modes of one body stand side by side.
  Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(model.nv, model.nv);
  const auto place = [&](int j, int k, const Eigen::MatrixXd& block) {
    const SweepBody &bj = model.bodies[j], &bk = model.bodies[k];
    const auto index = [](const SweepBody& b, Eigen::Index i) { return i < b.nv ? b.v + i : b.etadot + i - b.nv; };
    for (Eigen::Index r = 0; r < block.rows(); ++r)
      for (Eigen::Index c = 0; c < block.cols(); ++c) {
        mass(index(bj, r), index(bk, c)) = block(r, c);
        mass(index(bk, c), index(bj, r)) = block(r, c);
      }
  };
  for (int k = n - 1; k >= 1; --k) {
    const SweepBody& b = model.bodies[k];
    const auto& Rk = R[k];
    if (b.parent > 0) {
      const auto& Ak = A[k];
      const Eigen::Index size = Ak.cols();
      Eigen::MatrixXd& Rp = R[b.parent];
      Rp.topLeftCorner(size, size) += Ak.transpose() * Rk.topLeftCorner<6, 6>() * Ak;  // size < 6 + m when O does not deform
    }
    const Eigen::MatrixXd H = H_star(k);
    Eigen::MatrixXd X = Rk * H;
    place(k, k, H.transpose() * X);
    for (int j = k; model.bodies[j].parent > 0;) {
      const int p = model.bodies[j].parent;
      const Eigen::MatrixXd up = A[j].transpose() * X.topRows<6>();
      X = Eigen::MatrixXd::Zero(6 + model.bodies[p].n_modes, H.cols());
      X.topRows(up.rows()) = up;
      j = p;
      place(j, k, H_star(j).transpose() * X);
    }
  }
  return mass;
}

}  // namespace

/// Column by column as forward dynamics, refined. Of an entry and its mirror image that of the smaller column has the smaller error.
static bool refined_inverse(const Model& model, Workspace& ws, const double* q, double* inverse) {
  Eigen::Map<Eigen::MatrixXd> columns(inverse, model.nv, model.nv);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  Eigen::VectorXd unit = rest;
  for (int j = 0; j < model.nv; ++j) {
    unit[j] = 1.0;
    if (!forward_dynamics(model, ws, Inputs{.q = q, .v = rest.data(), .tau = unit.data(), .vdot = rest.data(), .gravity = false},
                          columns.col(j).data()))
      return false;
    unit[j] = 0.0;
  }
  for (int j = 0; j < model.nv; ++j)
    for (int i = 0; i < j; ++i) {
      const bool mine = columns.col(j).cwiseAbs().maxCoeff() < columns.col(i).cwiseAbs().maxCoeff();
      (mine ? columns(j, i) : columns(i, j)) = mine ? columns(i, j) : columns(j, i);
    }
  return true;
}

template <class T>
bool articulate_at_rest(const Model& model, soa::Workspace<T>& ws, const T* q) {
  require_open_tree(model, "inverse mass matrices");
  const soa::Sweeps<T>& S = soa::sweeps<T>();
  ws.rest.assign(model.nv, T(0));
  const soa::Inputs<T> in{.q = q, .v = ws.rest.data(), .vdot = ws.rest.data(), .gravity = false};
  outward(model, S, ws, in, {.velocity = false});
  for (auto run = model.runs.rbegin(); run != model.runs.rend() && ws.breakdown.body == 0; ++run)
    S.inward(model, ws, in, *run, {.bias = false});
  return ws.breakdown.body == 0;
}
template bool articulate_at_rest(const Model&, soa::Workspace<double>&, const double*);
template bool articulate_at_rest(const Model&, soa::Workspace<soa::Tangent>&, const soa::Tangent*);

void solve_mass(const Model& model, Workspace& ws, const double* q, const double* f, double* vdot) {
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const Inputs in{.q = q, .v = ws.rest.data(), .tau = f, .vdot = ws.rest.data(), .gravity = false};
  S.ground(model, ws, in);
  S.at_rest(model, ws);
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) S.inward(model, ws, in, *run, {.inertia = false});
  for (const Run& run : model.runs) S.acceleration(model, ws, in, run, vdot);
}

Inputs stand_rigid(const Model& model, Workspace& ws, const double* q) {
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  ws.rest.resize(static_cast<std::size_t>(model.nv));
  const Inputs in{.q = q, .v = ws.rest.data(), .vdot = ws.rest.data(), .gravity = false};
  S.ground(model, ws, in);
  S.hinge_records(model, ws, in);
  for (const Run& run : model.runs)
    if (!is_axis(run.kind)) S.outward(model, ws, in, run, {.velocity = false});
  return in;
}

bool mass_matrix_inverse(const Model& model, Workspace& ws, const double* q, double* inverse) {
  require_open_tree(model, "inverse mass matrices");
  if (model.has(OpCode::refine)) return refined_inverse(model, ws, q, inverse);
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const int nv = model.nv;
  if (model.rigid) {
    const Inputs in = stand_rigid(model, ws, q);
    ws.columns.resize(soa::columns_size(model));
    S.mass_matrix_inverse(model, ws, in, inverse);
    return ws.breakdown.body == 0;
  }
  if (!articulate_at_rest(model, ws, q)) return false;
  std::vector<double> unit(nv, 0.0);
  for (int j = 0; j < nv; ++j) {
    unit[j] = 1.0;
    solve_mass(model, ws, q, unit.data(), inverse + static_cast<std::ptrdiff_t>(nv) * j);
    unit[j] = 0.0;
  }
  for (int j = 0; j < nv; ++j)  // symmetric by nature; exactly so
    for (int i = 0; i < j; ++i) inverse[nv * i + j] = inverse[nv * j + i] = 0.5 * (inverse[nv * i + j] + inverse[nv * j + i]);
  return true;
}

void mass_matrix(const Model& model, Workspace& ws, const double* q, double* M) {
  require_open_tree(model, "mass matrices");
  if (!model.rigid) {
    Eigen::Map<Eigen::MatrixXd>(M, model.nv, model.nv) = flexible_mass_matrix(model, ws, q);
    return;
  }
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  ws.composite.resize(model.bodies.size());
  ws.columns.resize(soa::columns_size(model));
  const Inputs in = stand_rigid(model, ws, q);
  S.mass_matrix(model, ws, in, M);
}

Eigen::MatrixXd mass_matrix(const Model& model, Workspace& ws, const double* q) {
  Eigen::MatrixXd M(model.nv, model.nv);
  mass_matrix(model, ws, q, M.data());
  return M;
}

}  // namespace cardan
