// Multipliers of closed loops over the open tree (docs/mathematics/loops.md, 2): the ops `keep` and `loops`.
#include <algorithm>
#include <cmath>

#include "core/dynamics/loop_pass.hpp"

namespace cardan {
namespace {

constexpr double kRounding = 1e-12;      // of accelerations that cancel
constexpr double kTurning = 1e-3;        // of centripetal accelerations so much less: they are products, no sums of many
constexpr double kStill = 1e-12;         // [rad/s]
constexpr double kContradiction = 1e-6;  // what may be missing in the acceleration of a redundant row, relative to those of the open tree

/// [m/s^2] The accelerations of the ends of a loop, or of what it couples, which cancel in c'', and of rates that are none.
double what_cancels(const Model& model, const Workspace& ws, const Inputs& in, const Loop& loop, const double* vdot) {
  const LoopWork& work = *ws.loops;
  double size = kStill * kStill * loop.lever / kRounding;
  for (const LoopEnd* end : {&loop.from, &loop.to}) {
    const BodyMotion<double> body = motion_of_body(model, ws, in, end->sweep, vdot, After::forward);
    const Motion<double> a = body.gamma + body.delta;
    size += std::sqrt(dot(a.v, a.v)) + loop.lever * (std::sqrt(dot(a.w, a.w)) + kTurning * dot(body.w, body.w));
  }
  const std::vector<double>& gradient = work.gradient[static_cast<std::size_t>(&loop - model.loops.all.data())];
  for (std::size_t i = 0; i < gradient.size(); ++i)
    size += work.scale[static_cast<std::size_t>(loop.first)] * std::abs(gradient[i] * vdot[loop.coupling.terms[i].v]);
  return size;
}

bool stop(Workspace& ws, const Loop& loop, int row, double value, double limit) {
  const int outer = std::max(loop.from.sweep, loop.to.sweep);
  ws.breakdown = {.body = outer > 0 ? outer : 1, .component = -1, .value = value, .limit = limit, .row = row};
  return false;
}

}  // namespace

bool LoopPass::compliance(const std::vector<Run>& runs) {
  const int r = k_.rank;
  Inputs in = at_rest();
  for (int p = 0; p < r; ++p) {
    const int row = k_.row_at[at(p)];
    const Loop& loop = loop_of(row);
    const bool couples = loop.closing == Closing::coupling;
    in.wrenches = couples ? std::span<const NodeWrench>() : wrenches_of(loop, k_.W[at(row)]);
    in.tau = nullptr;
    if (couples) {
      add_gradient(loop, 1.0, k_.tau_of_row.data());
      in.tau = k_.tau_of_row.data();
    }
    double* U = k_.U.data() + at(p) * at(m_.nv);
    S_.ground(m_, ws_, in);
    S_.at_rest(m_, ws_);
    S_.node_wrenches(m_, ws_, in);
    for (auto run = runs.rbegin(); run != runs.rend(); ++run) S_.inward(m_, ws_, in, *run, {.inertia = false});
    for (const Run& run : runs) S_.acceleration(m_, ws_, in, run, U);
    for (std::size_t v = 0; v < m_.prescribed.size(); ++v)
      if (m_.prescribed[v]) U[v] = 0.0;
    if (couples)
      for (const CoupledRate& term : loop.coupling.terms) k_.tau_of_row[at(term.v)] = 0.0;
    responses(U, k_.y.data());
    for (int q = 0; q < r; ++q) k_.Lambda[at(q * r + p)] = k_.y[at(k_.row_at[at(q)])];
  }
  return factor_compliance();
}

void LoopPass::solve(const double* rhs, double* lambda) {
  const int r = k_.rank;
  double* y = k_.y.data();
  for (int p = 0; p < r; ++p) {
    y[p] = rhs[k_.row_at[at(p)]] * unit(p);
    for (int q = 0; q < p; ++q) y[p] -= k_.Lambda[at(p * r + q)] * y[q];
    y[p] /= k_.Lambda[at(p * r + p)];
  }
  for (int p = r - 1; p >= 0; --p) {
    for (int q = p + 1; q < r; ++q) y[p] -= k_.Lambda[at(q * r + p)] * y[q];
    y[p] /= k_.Lambda[at(p * r + p)];
  }
  for (int p = 0; p < r; ++p) lambda[k_.row_at[at(p)]] += y[p] * unit(p);
}

int LoopPass::find_left_null_space() {
  const int rows = loops_.rows, r = k_.rank, n = rows - r, columns = static_cast<int>(k_.columns.size());
  const auto L = [&](int i, int j) { return k_.B[at(k_.row_at[at(i)] * columns + k_.column_at[at(j)])]; };
  // Per redundant row: 1 on itself, -K on the others, where row = K (independent rows).
  for (int i = 0; i < n; ++i) {
    double* N = k_.N.data() + at(i * rows);
    std::fill_n(N, rows, 0.0);
    const int row = k_.row_at[at(r + i)];
    N[row] = 1.0;
    k_.others.clear();
    for (int p = r - 1; p >= 0; --p) {  // K L_I = L_row
      double x = L(r + i, p);
      for (auto q = k_.others.rbegin(); q != k_.others.rend(); ++q) x += N[k_.row_at[at(*q)]] * L(*q, p);
      if (x == 0.0) continue;
      N[k_.row_at[at(p)]] = -x;
      k_.others.push_back(p);
    }
    for (const int p : k_.others) {  // rows as they are, not scaled
      const int other = k_.row_at[at(p)];
      N[other] *= weight(other) / weight(row);
    }
  }
  return n;
}

void LoopPass::share() { take_left_null_space(find_left_null_space(), k_.lambda.data()); }

void LoopPass::reconcile(double* x) {
  const int rows = loops_.rows, n = find_left_null_space();
  for (int k = 0; k < rows; ++k) {
    x[k] *= k_.scale[at(k)];
    for (int i = 0; i < n; ++i) k_.N[at(i * rows + k)] /= k_.scale[at(k)];
  }
  take_left_null_space(n, x);
  for (int k = 0; k < rows; ++k) x[k] /= k_.scale[at(k)];
}

void LoopPass::take_left_null_space(int n, double* x) {
  const int rows = loops_.rows;
  for (int i = 0; i < n; ++i) {
    const double* N = k_.N.data() + at(i * rows);
    int first = 0, end = rows;  // of what it has, mostly rows of one loop
    while (first < end && N[first] == 0.0) ++first;
    while (end > first && N[end - 1] == 0.0) --end;
    for (int j = 0; j <= i; ++j) {
      double sum = 0.0;
      for (int k = first; k < end; ++k) sum += N[k] * k_.N[at(j * rows + k)];
      for (int k = 0; k < j; ++k) sum -= k_.NN[at(i * n + k)] * k_.NN[at(j * n + k)];
      k_.NN[at(i * n + j)] = i == j ? std::sqrt(sum) : sum / k_.NN[at(j * n + j)];
    }
  }
  double* y = k_.y.data();
  for (int i = 0; i < n; ++i) {
    y[i] = 0.0;
    for (int k = 0; k < rows; ++k) y[i] += k_.N[at(i * rows + k)] * x[k];
    for (int j = 0; j < i; ++j) y[i] -= k_.NN[at(i * n + j)] * y[j];
    y[i] /= k_.NN[at(i * n + i)];
  }
  for (int i = n - 1; i >= 0; --i) {
    for (int j = i + 1; j < n; ++j) y[i] -= k_.NN[at(j * n + i)] * y[j];
    y[i] /= k_.NN[at(i * n + i)];
  }
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < rows; ++k) x[k] -= k_.N[at(i * rows + k)] * y[i];
}

void LoopPass::push() {
  k_.wrenches.clear();
  if (k_.coupled)
    for (int v = 0; v < m_.nv; ++v) k_.tau[at(v)] = in_.tau ? in_.tau[v] : 0.0;
  for (const Loop& loop : loops_.all) {
    if (loop.closing == Closing::coupling) {
      add_gradient(loop, k_.lambda[at(loop.first)], k_.tau.data());
      continue;
    }
    Force<double> f{};
    for (int i = loop.first; i < loop.first + loop.rows; ++i) f += k_.lambda[at(i)] * k_.W[at(i)];
    for (const NodeWrench& w : wrenches_of(loop, f)) k_.wrenches.push_back(w);
  }
}

void LoopPass::move(double* vdot) {
  S_.ground(m_, ws_, in_);
  restore();
  Inputs in = in_;
  if (k_.coupled) in.tau = k_.tau.data();
  in.wrenches = k_.wrenches;
  S_.node_wrenches(m_, ws_, in);
  for (auto run = m_.runs.rbegin(); run != m_.runs.rend(); ++run) S_.inward(m_, ws_, in, *run, {.inertia = false});
  for (const Run& run : m_.runs) S_.acceleration(m_, ws_, in, run, vdot);
}

bool LoopPass::factor_compliance() {
  const int r = k_.rank;
  for (int p = 0; p < r; ++p) {
    const double diagonal = k_.Lambda[at(p * r + p)];
    if (!(diagonal > 0.0)) return false;
    k_.L[at(p)] = 1.0 / std::sqrt(diagonal);
  }
  for (int p = 0; p < r; ++p)
    for (int q = 0; q <= p; ++q) {
      const double both = 0.5 * (k_.Lambda[at(p * r + q)] + k_.Lambda[at(q * r + p)]);  // symmetric by nature
      k_.Lambda[at(p * r + q)] = both * unit(p) * unit(q);
    }
  for (int p = 0; p < r; ++p)
    for (int q = 0; q <= p; ++q) {
      double x = k_.Lambda[at(p * r + q)];
      for (int k = 0; k < q; ++k) x -= k_.Lambda[at(p * r + k)] * k_.Lambda[at(q * r + k)];
      if (p == q && !(x > 0.0)) return false;
      k_.Lambda[at(p * r + q)] = p == q ? std::sqrt(x) : x / k_.Lambda[at(q * r + q)];
    }
  return true;
}

std::span<const NodeWrench> LoopPass::wrenches_of(const Loop& loop, const Force<double>& f) {
  const LoopWork::Relative& r = k_.relative[static_cast<std::size_t>(&loop - loops_.all.data())];
  k_.one.clear();
  if (loop.to.node >= 0) k_.one.push_back({loop.to.node, false, {transpose_times(r.R, f.n), transpose_times(r.R, f.f)}});
  if (loop.from.node >= 0) k_.one.push_back({loop.from.node, false, {-(f.n + cross(r.d, f.f)), -f.f}});
  return k_.one;
}

void LoopPass::restore() {
  std::size_t mode = 0;
  for (std::size_t k = 1; k < m_.bodies.size(); ++k) {
    if (m_.bodies[k].kind == BodyKernel::rotor) continue;
    ws_.core(static_cast<int>(k)).gamma = k_.gamma[k];
    ws_.z(static_cast<int>(k)) = k_.z[k];
    if (soa::Modal<double>* modal = ws_.modal_of(static_cast<int>(k)))
      for (int j = 0; j < m_.bodies[k].n_modes; ++j) modal->z[j] = k_.z_modes[mode++];
  }
  for (std::size_t i = 0; i < m_.rotors.size(); ++i) ws_.axis(m_.rotors[i]).load = k_.rotor_loads[i];
}

LoopWork::LoopWork(const Model& model, Workspace& ws) {
  const Loops& loops = model.loops;
  const std::size_t n = loops.all.size(), rows = static_cast<std::size_t>(loops.rows), nv = static_cast<std::size_t>(model.nv);
  from.resize(n), to.resize(n), relative.resize(n), q.resize(n), v.resize(n), near_q.resize(n), gradient.resize(n);
  std::vector<std::uint8_t> moves(nv), marked(model.bodies.size());
  const auto mark = [&](int k) {
    for (; k > 0; k = model.bodies[static_cast<std::size_t>(k)].parent) marked[static_cast<std::size_t>(k)] = 1;
  };
  for (std::size_t l = 0; l < n; ++l) {
    const Loop& loop = loops.all[l];
    if (loop.hinge) q[l].resize(loop.hinge->nq), v[l].resize(loop.hinge->nv);
    for (const int i : loop.rates)
      if (!model.has_given_motion(i)) moves[static_cast<std::size_t>(i)] = 1;
    mark(loop.from.sweep), mark(loop.to.sweep);
    for (const CoupledRate& term : loop.coupling.terms) {
      gradient[l].push_back(term.coefficient);
      for (std::size_t k = 1; k < model.bodies.size(); ++k)
        if (const SweepBody& b = model.bodies[k]; term.v >= b.v && term.v < b.v + b.nv) mark(static_cast<int>(k));
    }
    coupled = coupled || loop.closing == Closing::coupling;
  }
  for (std::size_t k = 1; k < model.bodies.size(); ++k)  // what hangs on a flexible body may be eliminated with it
    if (const SweepBody& b = model.bodies[k]; b.onode >= 0 && marked[static_cast<std::size_t>(b.parent)]) marked[k] = 1;
  near = stretches(model.runs, marked);
  for (std::size_t i = 0; i < nv; ++i)
    if (moves[i]) columns.push_back(static_cast<int>(i));
  for (const SweepBody& b : model.bodies) {
    const auto of_hinge = [&b](int component) { return component >= b.v && component < b.v + b.nv; };
    if (std::ranges::none_of(columns, of_hinge)) continue;
    for (const DeviceHold& h : model.devices.holds)
      if (of_hinge(h.v)) may_be_held.push_back(h.v);
  }
  W.resize(rows), row_at.resize(rows), largest_of.resize(rows), others.reserve(rows), column_at.resize(columns.size());
  for (auto* x : {&c, &rate, &extra, &open, &acceleration, &rhs, &lambda, &step, &scale, &L, &y}) x->resize(rows);
  G.resize(rows * nv), U.resize(rows * nv), B.resize(rows * columns.size());
  for (auto* x : {&Lambda, &N, &NN}) x->resize(rows * rows);
  gamma.resize(model.bodies.size()), z.resize(model.bodies.size());
  for (std::size_t k = 1; k < model.bodies.size(); ++k)
    if (model.bodies[k].kind != BodyKernel::rotor) kept_z.emplace_back(&ws.z(static_cast<int>(k)), &z[k]);
  for (const int k : model.rotors) loads_on_rotors.push_back(&ws.axis(k).load);
  z_modes.resize(static_cast<std::size_t>(model.n_modes)), rotor_loads.resize(model.rotors.size());
  wrenches.reserve(2 * n), one.reserve(2);
  if (loops.embedding) {
    embedding = std::make_unique<soa::EmbeddingWork>(*loops.embedding, ws);
    std::size_t most = 0;
    for (const EmbeddedLoop& l : loops.embedding->loops)
      most = std::max(most, static_cast<std::size_t>(l.rank) * (static_cast<std::size_t>(l.rank) + 1) + static_cast<std::size_t>(l.inputs));
    few.resize(most), through.resize(model.bodies.size()), vdot.resize(nv), left.resize(nv), pushed.resize(nv),
        of_coordinates.resize(static_cast<std::size_t>(loops.embedding->n_x));
  }
  tau.resize(coupled ? nv : 0), tau_of_row.resize(nv), response.resize(nv), zero.resize(nv);
}

bool holds_loops(const Model& model, const LoopWork& work) {
  return std::ranges::any_of(work.may_be_held, [&](int v) { return model.prescribed[static_cast<std::size_t>(v)] != 0; });
}

void make_room_for_loops(const Model& model, Workspace& ws) {
  if (ws.loops) return;
  ws.loops = {new LoopWork(model, ws), [](LoopWork* work) { delete work; }};
}

void keep_loads(const Model& model, Workspace& ws) {
  make_room_for_loops(model, ws);
  LoopWork& work = *ws.loops;
  for (const auto& [from, to] : work.kept_z) *to = *from;
  std::size_t mode = 0;
  for (std::size_t k = 1; mode < work.z_modes.size(); ++k)
    if (const soa::Modal<double>* modal = ws.modal_of(static_cast<int>(k)))
      for (int j = 0; j < model.bodies[k].n_modes; ++j) work.z_modes[mode++] = modal->z[j];
  double* load = work.rotor_loads.data();
  for (const double* from : work.loads_on_rotors) *load++ = *from;
  if (!model.loops.embedding) keep_gamma(model, ws);
}

void keep_gamma(const Model& model, Workspace& ws) {
  for (std::size_t k = 1; k < model.bodies.size(); ++k)
    if (model.bodies[k].kind != BodyKernel::rotor) ws.loops->gamma[k] = ws.core(static_cast<int>(k)).gamma;
}

bool close_loops(const Model& model, Workspace& ws, const Inputs& in, double* vdot) {
  LoopWork& work = *ws.loops;
  LoopPass pass(model, ws, in);
  pass.place();
  pass.accelerations(vdot, work.open.data());
  pass.matrix();
  pass.find_rank();
  if (!pass.compliance(model.runs)) return stop(ws, pass.loop_of(work.row_at[0]), work.row_at[0], 0.0, 0.0);
  double size = 0.0;
  for (std::size_t i = 0; i < work.open.size(); ++i) {
    work.rhs[i] = -work.open[i], work.lambda[i] = 0.0;
    size = std::max(size, work.scale[i] * std::abs(work.open[i]));
  }
  if (model.loops.left_open) pass.reconcile(work.rhs.data());
  pass.solve(work.rhs.data(), work.lambda.data());
  for (int twice = 0; twice < 2; ++twice) {  // the second time with what rounding has left open
    pass.share();
    pass.push();
    pass.move(vdot);
    pass.accelerations(vdot, work.acceleration.data());
    for (std::size_t i = 0; i < work.rhs.size(); ++i) work.rhs[i] = -work.acceleration[i];
    if (model.loops.left_open) pass.reconcile(work.rhs.data());
    if (twice == 0) pass.solve(work.rhs.data(), work.lambda.data());
  }
  // What is less than the rounding of the multipliers still counts where what they push is light (rotors behind gears).
  std::ranges::fill(work.step, 0.0);
  pass.solve(work.rhs.data(), work.step.data());
  for (int p = 0; p < work.rank; ++p) {
    const double mu = work.step[static_cast<std::size_t>(work.row_at[static_cast<std::size_t>(p)])];
    const double* U = work.U.data() + static_cast<std::ptrdiff_t>(p) * model.nv;
    for (int i = 0; i < model.nv; ++i) vdot[i] += mu * U[i];
  }
  // Rows imply each other where loops are closed, and c'' of one that is left out where their rates are: trial states are off both.
  double drifting = 0.0;
  for (const Loop& loop : model.loops.all)
    for (int i = loop.first; i < loop.first + loop.rows && loop.turns(); ++i)
      drifting = std::max(
          drifting, work.scale[static_cast<std::size_t>(i)] * std::abs(work.rate[static_cast<std::size_t>(i)]) / std::sqrt(loop.lever));
  const double typed = model.loops.left_open ? 1e3 * model.loops.dependent : 0.0;
  const double limit = (kContradiction + 1e3 * pass.open() + typed) * size + 1e3 * drifting * std::sqrt(size);
  for (std::size_t i = static_cast<std::size_t>(work.rank); i < work.row_at.size(); ++i) {
    const int row = work.row_at[i];
    const auto at = static_cast<std::size_t>(row);
    const Loop& loop = pass.loop_of(row);
    if (const double missing = work.scale[at] * std::abs(work.acceleration[at]);
        !(missing <= limit) && !(missing <= (kRounding + typed) * what_cancels(model, ws, in, loop, vdot)))
      return stop(ws, loop, row, missing, limit);
  }
  return true;
}

LoopForces loop_forces(const Workspace& ws) {
  if (!ws.loops) return {};
  const LoopWork& work = *ws.loops;
  return {work.lambda, work.wrenches, work.c, work.rate, work.tau, work.W};
}

double loop_power(const Model& model, const Workspace& ws, const LoopDrive* drives, bool of_couplings) {
  double power = 0.0;
  for (const Loop& l : model.loops.all) {
    if (of_couplings && l.closing != Closing::coupling) continue;
    const bool given = l.drive >= 0 && drives;
    for (int i = l.first; i < l.first + l.rows; ++i)
      if (const auto at = static_cast<std::size_t>(i); given || !of_couplings)
        power += ws.loops->lambda[at] * (ws.loops->rate[at] + (given ? drives[l.drive].rate : 0.0));
  }
  return power;
}

int rows_that_counted(const Model& model, const Workspace& ws) {
  return model.loops.embedding && !holds_loops(model, *ws.loops) ? model.loops.rank : ws.loops->rank;
}

Eigen::MatrixXd idle_forces(const Model& model, const Workspace& ws, const std::vector<int>& components) {
  const LoopWork& work = *ws.loops;
  if (!holds_loops(model, work) || work.rank == model.loops.rows) return {};
  const auto rows = static_cast<std::size_t>(model.loops.rows), nv = static_cast<std::size_t>(model.nv);
  const std::size_t n = rows - static_cast<std::size_t>(work.rank);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(components.size()), static_cast<Eigen::Index>(n));
  const std::vector<double>& scale = model.loops.column_scale;
  // Rows that follow from others whatever is held push nothing but rounding, which is small beside what each row pushes anywhere.
  for (std::size_t k = 0; k < n; ++k) {
    double most = 0.0;
    for (std::size_t row = 0; row < rows; ++row)
      for (std::size_t v = 0; v < nv; ++v) most = std::max(most, std::abs(work.N[k * rows + row] * work.G[row * nv + v]) * scale[v]);
    for (std::size_t i = 0; i < components.size(); ++i) {
      const auto v = static_cast<std::size_t>(components[i]);
      double push = 0.0;
      for (std::size_t row = 0; row < rows; ++row) push += work.N[k * rows + row] * work.G[row * nv + v];
      if (std::abs(push) * scale[v] > kDependent * most) out(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = push;
    }
  }
  if (out.isZero(0.0)) return {};
  return out;
}

Force<double> loop_wrench(const Model& model, const Workspace& ws, int loop) {
  const Loop& l = model.loops.all[static_cast<std::size_t>(loop)];
  Force<double> f{};
  for (int i = l.first; i < l.first + l.rows; ++i)
    f += ws.loops->lambda[static_cast<std::size_t>(i)] * ws.loops->W[static_cast<std::size_t>(i)];
  return f;
}

}  // namespace cardan
