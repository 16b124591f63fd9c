#include "core/dynamics/inverse.hpp"

#include <algorithm>

#include "core/soa/gravity_field.hpp"
#include "core/soa/kernels_tangent.hpp"

namespace cardan {

template <class T>
void inverse_dynamics(const Model& model, soa::Workspace<T>& ws, const soa::Inputs<T>& in, T* tau, InverseTerms terms, const Part* part) {
  const soa::Sweeps<T>& S = soa::sweeps<T>();
  soa::Inputs<T> use = in;
  use.gravity = in.gravity && terms.gravity;
  const bool central = use.gravity && model.field.central;
  outward(model, S, ws, use, {.vdot = in.vdot != nullptr, .velocity = terms.velocity, .inertia = in.vdot == nullptr}, part);
  if (terms.elastic && !model.flexible.empty()) S.elastic(model, ws, use);
  if (central || std::ranges::any_of(in.wrenches, [](const auto& w) { return w.world_axes; })) {
    ws.require_world();
    world(model, S, ws, use, part);
  }
  if (central) S.central_gravity(model, ws, use);
  if (!part) {
    S.node_wrenches(model, ws, use);
    for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) S.gather(model, ws, use, *run, tau);
    return;
  }
  for (const int k : part->rotors_left_out)
    if (const SweepBody& rotor = model.bodies[k]; central && rotor.M.m > 0.0) {
      Vec3<T> c, r;
      ws.core(rotor.parent).z += soa::attraction(model.field, cast<T>(rotor.M_sweep), ws.pose_W(rotor.parent), c, r);
    }
  for (const soa::NodeWrench<T>& w : in.wrenches) {
    if (!part->takes_part[model.nodes[w.node].sweep]) continue;
    use.wrenches = {&w, 1};
    S.node_wrenches(model, ws, use);
  }
  for (auto run = part->runs.rbegin(); run != part->runs.rend(); ++run) S.gather(model, ws, use, *run, tau);
}
template void inverse_dynamics(const Model&, soa::Workspace<double>&, const soa::Inputs<double>&, double*, InverseTerms, const Part*);
template void inverse_dynamics(const Model&, soa::Workspace<soa::Lanes<4>>&, const soa::Inputs<soa::Lanes<4>>&, soa::Lanes<4>*,
                               InverseTerms, const Part*);
template void inverse_dynamics(const Model&, soa::Workspace<soa::Lanes<8>>&, const soa::Inputs<soa::Lanes<8>>&, soa::Lanes<8>*,
                               InverseTerms, const Part*);
template void inverse_dynamics(const Model&, soa::Workspace<soa::Tangent>&, const soa::Inputs<soa::Tangent>&, soa::Tangent*, InverseTerms,
                               const Part*);

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

/// With modes: column by column as inverse dynamics, and symmetric to the last bit.
void flexible_mass_matrix(const Model& model, Workspace& ws, const double* q, double* M) {
  Eigen::Map<Eigen::MatrixXd> mass(M, model.nv, model.nv);
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  Eigen::VectorXd unit = rest;
  for (int j = 0; j < model.nv; ++j) {
    unit[j] = 1.0;
    inverse_dynamics(model, ws, Inputs{.q = q, .v = rest.data(), .vdot = unit.data(), .gravity = false}, mass.col(j).data(),
                     {.velocity = false, .gravity = false, .elastic = false});
    unit[j] = 0.0;
  }
  mass.triangularView<Eigen::StrictlyUpper>() = mass.transpose().eval();
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

bool articulate_at_rest(const Model& model, Workspace& ws, const double* q) {
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  ws.rest.assign(model.nv, 0.0);
  const Inputs in{.q = q, .v = ws.rest.data(), .vdot = ws.rest.data(), .gravity = false};
  outward(model, S, ws, in, {.velocity = false});
  for (auto run = model.runs.rbegin(); run != model.runs.rend() && ws.breakdown.body == 0; ++run)
    S.inward(model, ws, in, *run, {.bias = false});
  return ws.breakdown.body == 0;
}

void solve_mass(const Model& model, Workspace& ws, const double* q, const double* f, double* vdot) {
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const Inputs in{.q = q, .v = ws.rest.data(), .tau = f, .vdot = ws.rest.data(), .gravity = false};
  S.ground(model, ws, in);
  S.at_rest(model, ws);
  for (auto run = model.runs.rbegin(); run != model.runs.rend(); ++run) S.inward(model, ws, in, *run, {.inertia = false});
  for (const Run& run : model.runs) S.acceleration(model, ws, in, run, vdot);
}

bool mass_matrix_inverse(const Model& model, Workspace& ws, const double* q, double* inverse) {
  if (model.has(OpCode::refine)) return refined_inverse(model, ws, q, inverse);
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const int nv = model.nv;
  if (model.rigid) {
    ws.rest.assign(nv, 0.0);
    const Inputs in{.q = q, .v = ws.rest.data(), .vdot = ws.rest.data(), .gravity = false};
    S.ground(model, ws, in);
    S.hinge_records(model, ws, in);
    S.at_rest(model, ws);
    for (const Run& run : model.runs)
      if (!is_axis(run.kind)) S.outward(model, ws, in, run, {.velocity = false});
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
  if (!model.rigid) return flexible_mass_matrix(model, ws, q, M);
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  ws.composite.resize(model.bodies.size());
  ws.rest.resize(static_cast<std::size_t>(model.nv));
  const Inputs in{.q = q, .v = ws.rest.data(), .gravity = false};
  S.hinge_records(model, ws, in);
  for (const Run& run : model.runs)
    if (!is_axis(run.kind)) S.outward(model, ws, in, run, {.velocity = false});
  S.mass_matrix(model, ws, in, M);
}

Eigen::MatrixXd mass_matrix(const Model& model, Workspace& ws, const double* q) {
  Eigen::MatrixXd M(model.nv, model.nv);
  mass_matrix(model, ws, q, M.data());
  return M;
}

}  // namespace cardan
