#include "core/dynamics/absolute.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/base/finite.hpp"
#include "core/dynamics/hinge_fit.hpp"
#include "core/dynamics/inverse.hpp"

namespace cardan {
namespace {

using Vec = Vec3<double>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

std::size_t at(int i) { return static_cast<std::size_t>(i); }
double power(const Force<double>& f, const Vec& w, const Vec& u) { return dot(f.n, w) + dot(f.f, u); }
constexpr double kContradiction = 1e-6;  // what may be missing in c'' of a row that is left out, relative to that of all
constexpr double kRounding = 1e-12;      // of accelerations that cancel

}  // namespace

AbsoluteSystem::AbsoluteSystem(const Model& model)
    : m_(model), a_(*model.loops.absolute), tree_(model), ws_(*a_.closed), q_near_(at(model.nq)) {
  const Model& f = *a_.closed;
  tree_.require_world();
  make_room_for_loops(f, ws_);
  const std::size_t n = f.loops.all.size();
  for (auto* x : {&Q_, &q_}) x->resize(at(std::max(f.nq, m_.nq)));
  for (auto* x : {&U_, &v_, &zero_, &unit_vdot_, &column_, &forces_}) x->resize(at(std::max(f.nv, m_.nv)));
  int n_rates = 0;
  for (const AbsoluteModel::Joint& joint : a_.joints) {
    const UserBody& u = m_.user[at(joint.user)];
    if (u.nv == 0) continue;
    hinges_.push_back({joint.user, joint.loop, u.q, u.v, u.nq, u.nv, n_rates});
    n_rates += u.nv;
    ws_.loops->near_q[at(joint.loop)] = q_near_.data() + u.q;
  }
  columns_.resize(n), pushes_.resize(n);
  for (std::size_t l = 0; l < n; ++l) {
    const Loop& loop = f.loops.all[l];
    for (const LoopEnd* end : {&loop.to, &loop.from}) {
      const SweepBody& b = f.bodies[at(end->sweep)];
      for (int j = 0; end->sweep > 0 && j < 6; ++j) columns_[l].push_back(b.v + j);
      for (int j = 0; j < b.n_modes; ++j) columns_[l].push_back(b.etadot + j);
    }
    pushes_[l].resize(6 * columns_[l].size());
  }
  const auto add_row = [&](SparseRows& rows, std::initializer_list<int> loops) {
    for (const int l : loops) rows.column.insert(rows.column.end(), columns_[at(l)].begin(), columns_[at(l)].end());
    rows.start.push_back(static_cast<int>(rows.column.size()));
  };
  for (std::size_t l = 0; l < n; ++l)
    for (int i = 0; i < f.loops.all[l].rows; ++i) add_row(G_, {static_cast<int>(l)});
  rows_ = f.loops.rows;
  for (std::size_t l = 0; l < m_.loops.all.size(); ++l) {
    const Loop& loop = m_.loops.all[l];
    const int to = a_.loop_of[l];
    first_row_.push_back(to >= 0 ? f.loops.all[at(to)].first : rows_);
    if (to >= 0) continue;
    coupling_of_.push_back(static_cast<int>(l));
    gradient_.emplace_back(loop.coupling.terms.size());
    for (const CoupledRate& term : loop.coupling.terms)
      for (const Hinge& h : hinges_)
        if (term.v >= h.v && term.v < h.v + h.nv)
          G_.column.insert(G_.column.end(), columns_[at(h.loop)].begin(), columns_[at(h.loop)].end());
    G_.start.push_back(static_cast<int>(G_.column.size()));
    ++rows_;
  }
  first_given_ = rows_;
  for (const Hinge& h : hinges_)
    for (int i = 0; i < h.nv; ++i) {
      add_row(H_, {h.loop});
      if (!m_.has_given_motion(h.v + i)) continue;
      add_row(G_, {h.loop});
      given_.push_back({-1, h.v + i, h.first + i});
      for (const PlainRates& r : m_.plain_rates)
        if (h.v + i >= r.v && h.v + i < r.v + r.n) given_.back().q = r.q + h.v + i - r.v;
      ++rows_;
    }
  G_.value.resize(G_.column.size()), H_.value.resize(H_.column.size());
  for (auto* x : {&c_, &rate_, &bias_}) x->resize(at(rows_));
  of_hinges_.resize(at(n_rates)), unit_.resize(at(n_rates));
  block_.resize(at(f.nv)), block_size_.resize(at(f.nv));
  for (const SweepBody& b : f.bodies)
    for (int j = 0; j < b.nv + b.n_modes; ++j) block_[at(b.v + j)] = b.v, block_size_[at(b.v + j)] = b.nv + b.n_modes;
  std::size_t entries = 0;
  for (int i = 0; i < f.nv; ++i) {
    diagonal_.push_back(static_cast<int>(entries) + i - block_[at(i)]);
    entries += at(block_size_[at(i)]);
  }
  M_.resize(entries);
}

void AbsoluteSystem::enter(const double* q, const double* v, double* Q, double* U) {
  const Model& f = *a_.closed;
  const soa::Sweeps<double>& S = soa::sweeps<double>();
  const Inputs in{.q = q, .v = v, .gravity = false};
  outward(m_, S, tree_, in, {.inertia = false});
  S.world(m_, tree_, in);
  std::copy_n(q, m_.nq, q_near_.begin());
  ws_.loops->near_W.clear();
  for (const AbsoluteModel::Joint& joint : a_.joints) {
    const UserBody &u = m_.user[at(joint.user)], &to = f.user[at(joint.user)];
    const NodeMotion<double> moves = node_motion<double>(m_, tree_, in, m_.find_node(u.name), nullptr);
    const Eigen::Quaterniond turn(to_eigen(moves.R_WN));
    double *Qb = Q + to.q, *Ub = U + to.v;
    Qb[0] = turn.w(), Qb[1] = turn.x(), Qb[2] = turn.y(), Qb[3] = turn.z();
    Eigen::Vector3d::Map(Qb + 4) = to_eigen(moves.position);
    Eigen::Vector3d::Map(Ub) = to_eigen(moves.velocity.w);
    Eigen::Vector3d::Map(Ub + 3) = to_eigen(moves.R_WN * moves.velocity.v);
    std::copy_n(q + u.eta, u.n_modes, Q + to.eta);
    std::copy_n(v + u.etadot, u.n_modes, U + to.etadot);
  }
}

void AbsoluteSystem::place(const double* Q, const double* U, const LoopDrive* drives, Given given) {
  const Model& f = *a_.closed;
  LoopWork& k = *ws_.loops;
  std::copy_n(Q, f.nq, Q_.begin());
  std::copy_n(U, f.nv, U_.begin());
  at_ = Inputs{.q = Q_.data(), .v = U_.data(), .drives = drives};
  outward(f, soa::sweeps<double>(), ws_, at_, {.inertia = false});
  for (int b = 1; b < static_cast<int>(f.bodies.size()); ++b) ws_.core(b).delta = {};
  LoopPass pass(f, ws_, at_);
  pass.place();
  for (std::size_t l = 0; l < f.loops.all.size(); ++l) {
    const Loop& loop = f.loops.all[l];
    const soa::RelativePlace& s = k.relative[l];
    const LoopPlace<double> r{s.R, s.d, s.w, s.u};
    double* T = pushes_[l].data();
    push_of_unit_wrenches(loop.to, k.to[l], true, r, T);
    const SweepBody& b = f.bodies[at(loop.to.sweep)];
    push_of_unit_wrenches(loop.from, k.from[l], false, r, T + (loop.to.sweep > 0 ? 6 * (6 + b.n_modes) : 0));
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      fill(static_cast<int>(l), k.W[at(i)], G_, i);
      c_[at(i)] = k.c[at(i)], rate_[at(i)] = k.rate[at(i)];
    }
  }
  pass.accelerations(zero_.data(), bias_.data());
  for (const Hinge& hinge : hinges_) place_hinge(hinge);
  for (const AbsoluteModel::Joint& joint : a_.joints) {
    const UserBody &u = m_.user[at(joint.user)], &of = f.user[at(joint.user)];
    std::copy_n(Q + of.eta, u.n_modes, q_.begin() + u.eta);
    std::copy_n(U + of.etadot, u.n_modes, v_.begin() + u.etadot);
  }
  couple();
  for (std::size_t i = 0; i < given_.size(); ++i) {
    const GivenRate& rate = given_[i];
    const std::size_t row = at(first_given_) + i;
    std::copy(H_.value.begin() + H_.start[at(rate.rate)], H_.value.begin() + H_.start[at(rate.rate) + 1], G_.value.begin() + G_.start[row]);
    c_[row] = rate.q >= 0 ? q_[at(rate.q)] - given.q[rate.q] : 0.0;
    rate_[row] = v_[at(rate.v)] - given.v[rate.v];
  }
}

/// 6 numbers for each velocity of the body of an end: its forces where a unit wrench, axes of A, pushes B there and A the other way.
void AbsoluteSystem::push_of_unit_wrenches(const LoopEnd& end, const LoopEndMotion<double>& e, bool to, const LoopPlace<double>& r,
                                           double* T) const {
  if (end.sweep == 0) return;
  const Model& f = *a_.closed;
  const SweepBody& b = f.bodies[at(end.sweep)];
  const NodeShapes& shapes = shapes_of(f, end);
  const Mat3<double>& R_W = ws_.X(end.sweep).R;
  for (int i = 0; i < 6; ++i) {
    double one[6] = {};
    one[i] = 1.0;
    const Vec n{one[0], one[1], one[2]}, force{one[3], one[4], one[5]};
    const Force<double> in_node =
        to ? Force<double>{transpose_times(r.R, n), transpose_times(r.R, force)} : Force<double>{-(n + cross(r.d, force)), -force};
    const Force<double> here{e.at.R * in_node.n, e.at.R * in_node.f};  // axes of the body, at the node
    const Vec moment = here.n + cross(e.at.rho, here.f), in_world = R_W * here.f;
    const double rigid[6] = {moment.x, moment.y, moment.z, in_world.x, in_world.y, in_world.z};
    for (int j = 0; j < 6; ++j) T[6 * j + i] = rigid[j];
    for (int j = 0; j < b.n_modes; ++j) T[6 * (6 + j) + i] = shapes.deforms() ? dot(soa::node_column(shapes, e.at, j), here) : 0.0;
  }
}

void AbsoluteSystem::fill(int loop, const Force<double>& W, SparseRows& rows, int row) const {
  const double w[6] = {W.n.x, W.n.y, W.n.z, W.f.x, W.f.y, W.f.z};
  double* out = rows.value.data() + rows.start[at(row)];
  const double* T = pushes_[at(loop)].data();
  for (std::size_t j = 0; j < columns_[at(loop)].size(); ++j, T += 6) {
    out[j] = 0.0;
    for (int i = 0; i < 6; ++i) out[j] += w[i] * T[i];
  }
}

/// Coordinates, rates and v' without U', and the wrenches of unit forces: the pseudo-inverse of its map, so that multipliers and forces of
/// actuators push at right angles to each other.
void AbsoluteSystem::place_hinge(const Hinge& h) {
  const Model& f = *a_.closed;
  const LoopWork& k = *ws_.loops;
  const Loop& loop = f.loops.all[at(h.loop)];
  const soa::RelativePlace& s = k.relative[at(h.loop)];
  std::copy_n(k.q[at(h.loop)].begin(), h.nq, q_.begin() + h.q);
  cardan_hinge_out out{};
  const std::uint32_t zero = 0;
  loop.hinge->kinematics(loop.packed.data(), 1, &zero, &zero, k.q[at(h.loop)].data(), k.v[at(h.loop)].data(), &out);
  const Eigen::Matrix3d R = to_eigen(s.R);
  const Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>> H(out.Ht, 6, h.nv);
  HingeColumns in_A(6, h.nv);
  in_A.topRows<3>() = R * H.topRows<3>(), in_A.bottomRows<3>() = R * H.bottomRows<3>();
  const HingeColumns unit = in_A * positive_solve(in_A.transpose() * in_A, HingeSquare::Identity(h.nv, h.nv));
  const auto [wdot, udot] =
      relative_acceleration(f, ws_, at_, loop, k.from[at(h.loop)], k.to[at(h.loop)], LoopPlace<double>{s.R, s.d, s.w, s.u}, zero_.data());
  const Vec of_map_w = s.R * Vec{out.Hdot_v[0], out.Hdot_v[1], out.Hdot_v[2]};
  const Vec of_map_v = cross(s.w, s.u) + s.R * Vec{out.Hdot_v[3], out.Hdot_v[4], out.Hdot_v[5]};
  for (int i = 0; i < h.nv; ++i) {
    const Force<double> W{{unit(0, i), unit(1, i), unit(2, i)}, {unit(3, i), unit(4, i), unit(5, i)}};
    unit_[at(h.first + i)] = W;
    v_[at(h.v + i)] = power(W, s.w, s.u);
    of_hinges_[at(h.first + i)] = power(W, wdot - of_map_w, udot - of_map_v);
    fill(h.loop, W, H_, h.first + i);
  }
}

/// Rows of couplings: those of hinges times their slopes.
void AbsoluteSystem::couple() {
  for (std::size_t i = 0; i < coupling_of_.size(); ++i) {
    const Loop& loop = m_.loops.all[at(coupling_of_[i])];
    const Coupling& coupling = loop.coupling;
    const int row = a_.closed->loops.rows + static_cast<int>(i);
    double c = -coupling.offset, extra = 0.0, rate = 0.0;
    if (coupling.is_linear())
      for (std::size_t j = 0; j < coupling.terms.size(); ++j)
        gradient_[i][j] = coupling.terms[j].coefficient, c += gradient_[i][j] * q_[at(coupling.terms[j].q)];
    else
      coupling.at(q_.data(), v_.data(), gradient_[i].data(), c, extra);
    double* value = G_.value.data() + G_.start[at(row)];
    for (std::size_t j = 0; j < coupling.terms.size(); ++j) {
      const int v = coupling.terms[j].v;
      const Hinge& h = *std::ranges::find_if(hinges_, [v](const Hinge& one) { return v >= one.v && v < one.v + one.nv; });
      const int of = h.first + v - h.v;
      rate += gradient_[i][j] * v_[at(v)], extra += gradient_[i][j] * of_hinges_[at(of)];
      for (int e = H_.start[at(of)]; e < H_.start[at(of) + 1]; ++e) *value++ = gradient_[i][j] * H_.value[at(e)];
    }
    if (loop.drive >= 0 && at_.drives) {
      const LoopDrive& given = at_.drives[loop.drive];
      c -= given.more, rate -= given.rate, extra -= given.acceleration;
    }
    c_[at(row)] = c, rate_[at(row)] = rate, bias_[at(row)] = extra;
  }
}

void AbsoluteSystem::leave(double* q, double* v, bool near) {
  std::copy_n(q_.begin(), m_.nq, q);
  std::copy_n(v_.begin(), m_.nv, v);
  if (!near) return;
  std::copy_n(q_.begin(), m_.nq, q_near_.begin());
  keep_rows();
}

void AbsoluteSystem::keep_rows() { ws_.loops->near_W = ws_.loops->W; }

void AbsoluteSystem::forces(const Inputs& in, const double* Udot, const double* lambda, double* out) {
  const Model& f = *a_.closed;
  wrenches_.clear();
  for (NodeWrench w : in.wrenches) {
    w.node = a_.node_of[at(w.node)];
    wrenches_.push_back(w);
  }
  Inputs use = at_;
  use.vdot = Udot, use.wrenches = wrenches_, use.gravity = in.gravity, use.moment = in.moment;
  inverse_dynamics(*a_.bodies, ws_, use, out);
  for (int i = 0; lambda && i < rows_; ++i)
    if (lambda[i] != 0.0) G_.add_transposed(i, -lambda[i], out);
  if (!in.tau) return;
  for (const Hinge& h : hinges_)
    for (int i = 0; i < h.nv; ++i)
      if (in.tau[h.v + i] != 0.0) H_.add_transposed(h.first + i, -in.tau[h.v + i], out);
  for (const AbsoluteModel::Joint& joint : a_.joints) {
    const UserBody &u = m_.user[at(joint.user)], &of = f.user[at(joint.user)];
    for (int j = 0; j < u.n_modes; ++j) out[of.etadot + j] -= in.tau[u.etadot + j];
  }
}

/// Blocks of the bodies, column by column of all of them at once.
void AbsoluteSystem::masses() {
  const Model& f = *a_.closed;
  int most = 0;
  for (const int size : block_size_) most = std::max(most, size);
  const Inputs still{.q = Q_.data(), .v = zero_.data(), .vdot = unit_vdot_.data(), .gravity = false};
  for (int j = 0; j < most; ++j) {
    for (int i = 0; i < f.nv; ++i) unit_vdot_[at(i)] = i - block_[at(i)] == j ? 1.0 : 0.0;
    inverse_dynamics(*a_.bodies, ws_, still, column_.data(), {.velocity = false, .gravity = false, .elastic = false});
    std::size_t entry = 0;
    for (int i = 0; i < f.nv; entry += at(block_size_[at(i)]), ++i)
      if (j < block_size_[at(i)]) M_[entry + at(j)] = column_[at(i)];
  }
}

bool AbsoluteSystem::accelerate(const Inputs& in, std::span<const std::uint8_t> kept, double* Udot, double* lambda) {
  forces(in, nullptr, nullptr, forces_.data());
  masses();
  for (std::size_t i = 0; i < given_.size(); ++i)
    bias_[at(first_given_) + i] = of_hinges_[at(given_[i].rate)] - (in.vdot ? in.vdot[given_[i].v] : 0.0);
  return solve(kept, Udot, lambda);
}

/// [M -G*; G 0] [U'; lambda] = [-b; -c''], once refined.
bool AbsoluteSystem::solve(std::span<const std::uint8_t> kept, double* Udot, double* lambda) {
  const int nv = a_.closed->nv;
  std::vector<int> place(at(rows_), -1);
  int n = nv;
  for (int i = 0; i < rows_; ++i)
    if (kept[at(i)]) place[at(i)] = n++;
  std::vector<Eigen::Triplet<double>> entries;
  std::size_t entry = 0;
  for (int i = 0; i < nv; ++i)
    for (int j = 0; j < block_size_[at(i)]; ++j, ++entry) entries.emplace_back(i, block_[at(i)] + j, M_[entry]);
  for (int i = 0; i < rows_; ++i)
    for (int e = G_.start[at(i)]; place[at(i)] >= 0 && e < G_.start[at(i) + 1]; ++e) {
      entries.emplace_back(place[at(i)], G_.column[at(e)], G_.value[at(e)]);
      entries.emplace_back(G_.column[at(e)], place[at(i)], -G_.value[at(e)]);
    }
  Eigen::SparseMatrix<double> K(n, n);
  K.setFromTriplets(entries.begin(), entries.end());
  Eigen::VectorXd right(n), x, rest;
  for (int i = 0; i < nv; ++i) right[i] = -forces_[at(i)];
  for (int i = 0; i < rows_; ++i)
    if (place[at(i)] >= 0) right[place[at(i)]] = -bias_[at(i)];
  if (!lu_.factor(K)) return false;
  lu_.solve(right, x);
  lu_.solve(right - K * x, rest);
  x += rest;
  std::copy_n(x.data(), nv, Udot);
  for (int i = 0; i < rows_; ++i) lambda[i] = place[at(i)] >= 0 ? x[place[at(i)]] : 0.0;
  return all_finite(x.data(), n);
}

std::vector<double> AbsoluteSystem::accelerations_alone() const {
  std::vector<double> out(at(a_.closed->nv), 0.0);
  for (std::size_t i = 0; i < out.size(); ++i)
    if (const double m = inertia(static_cast<int>(i)); m > 0.0) out[i] = forces_[i] / m;
  return out;
}

double AbsoluteSystem::acceleration(int row, const double* Udot) const { return bias_[at(row)] + G_.times(row, Udot); }
double AbsoluteSystem::size_of_acceleration(int row, const double* Udot) const {
  double sum = std::abs(bias_[at(row)]);
  for (int i = G_.start[at(row)]; i < G_.start[at(row + 1)]; ++i) sum += std::abs(G_.value[at(i)] * Udot[G_.column[at(i)]]);
  return sum;
}

double AbsoluteSystem::size_of_centripetal(int loop) const {
  const std::size_t l = at(a_.loop_of[at(loop)]);
  const Vec3<double>&from = ws_.loops->from[l].w, &to = ws_.loops->to[l].w, &u = ws_.loops->relative[l].u;
  const double turning = std::sqrt(dot(from, from)) + std::sqrt(dot(to, to));
  return turning * (m_.loops.all[at(loop)].lever * turning + std::sqrt(dot(u, u)));
}

void AbsoluteSystem::rates_of_hinges(const double* Udot, double* vdot) const {
  for (const Hinge& h : hinges_)
    for (int i = 0; i < h.nv; ++i) vdot[h.v + i] = of_hinges_[at(h.first + i)] + H_.times(h.first + i, Udot);
  for (const AbsoluteModel::Joint& joint : a_.joints) {
    const UserBody &u = m_.user[at(joint.user)], &of = a_.closed->user[at(joint.user)];
    std::copy_n(Udot + of.etadot, u.n_modes, vdot + u.etadot);
  }
}

Force<double> AbsoluteSystem::hinge_wrench(int user_body, const double* lambda, const double* tau) const {
  const auto joint = std::ranges::find(a_.joints, user_body, &AbsoluteModel::Joint::user);
  Force<double> f{};
  if (joint == a_.joints.end()) return f;
  const Loop& loop = a_.closed->loops.all[at(joint->loop)];
  for (int i = loop.first; i < loop.first + loop.rows; ++i) f += lambda[i] * ws_.loops->W[at(i)];
  for (std::size_t i = 0; i < coupling_of_.size(); ++i) {
    const std::vector<CoupledRate>& terms = m_.loops.all[at(coupling_of_[i])].coupling.terms;
    for (std::size_t j = 0; j < terms.size(); ++j)
      for (const Hinge& h : hinges_)
        if (h.user == user_body && terms[j].v >= h.v && terms[j].v < h.v + h.nv)
          f += lambda[a_.closed->loops.rows + static_cast<int>(i)] * gradient_[i][j] * unit_[at(h.first + terms[j].v - h.v)];
  }
  for (const Hinge& h : hinges_)
    for (int i = 0; h.user == user_body && tau && i < h.nv; ++i) f += tau[h.v + i] * unit_[at(h.first + i)];
  for (std::size_t i = 0; i < given_.size(); ++i)
    for (const Hinge& h : hinges_)
      if (h.user == user_body && given_[i].v >= h.v && given_[i].v < h.v + h.nv)
        f += lambda[at(first_given_) + i] * unit_[at(given_[i].rate)];
  const Mat3<double>& R = ws_.loops->relative[at(joint->loop)].R;
  const UserBody& u = m_.user[at(user_body)];
  const Force<double> there{transpose_times(R, f.n), transpose_times(R, f.f)};
  const int onode = m_.bodies[at(u.sweep)].onode;
  const bool turned_at_P = u.nv == 0 && onode >= 0 && m_.shapes[at(onode)].deforms();
  return turned_at_P ? to_outboard(u.merged_hinge, there) : there;
}

Force<double> AbsoluteSystem::loop_wrench(int loop, const double* lambda) const {
  const Loop& l = a_.closed->loops.all[at(a_.loop_of[at(loop)])];
  Force<double> f{};
  for (int i = l.first; i < l.first + l.rows; ++i) f += lambda[i] * ws_.loops->W[at(i)];
  return f;
}

namespace {

/// Which rows count: all of hinges, of loops those that are independent as the open tree has them.
void choose_rows(const Model& model, LoopPass& pass, const LoopWork& work, const AbsoluteSystem& system, std::vector<std::uint8_t>& kept) {
  pass.matrix();
  pass.find_rank();
  kept.assign(at(system.rows()), 1);
  for (std::size_t i = at(work.rank); i < work.row_at.size(); ++i) {
    const Loop& loop = pass.loop_of(work.row_at[i]);
    kept[at(system.first_row(static_cast<int>(&loop - model.loops.all.data())) + work.row_at[i] - loop.first)] = 0;
  }
}

/// Multipliers as loops of the vehicle have them. Rows are orthonormal; with one that turns and shifts at once they are at right angles
/// with the lever as the unit of length.
void take_multipliers(const Model& model, LoopWork& k, const AbsoluteSystem& system, const double* lambda) {
  for (std::size_t l = 0; l < model.loops.all.size(); ++l) {
    const Loop& loop = model.loops.all[l];
    if (loop.closing == Closing::coupling) {
      k.lambda[at(loop.first)] = lambda[system.first_row(static_cast<int>(l))];
      continue;
    }
    const Force<double> f = system.loop_wrench(static_cast<int>(l), lambda);
    const std::span<const Force<double>> rows(k.W.data() + loop.first, at(loop.rows));
    const bool mixed = std::ranges::any_of(rows, [](const Force<double>& W) { return dot(W.n, W.n) > 0.0 && dot(W.f, W.f) > 0.0; });
    const double unit = mixed ? 1.0 / (loop.lever * loop.lever) : 1.0;
    for (int i = 0; i < loop.rows; ++i) {
      const Force<double>& W = rows[at(i)];
      k.lambda[at(loop.first + i)] = power(W, unit * f.n, f.f) / (mixed ? power(W, unit * W.n, W.f) : 1.0);
    }
  }
}

/// Rows that are left out must be fulfilled all the same.
bool keeps_rows_left_out(const Model& model, Workspace& ws, const LoopPass& pass, const AbsoluteWork& a) {
  const LoopWork& k = *ws.loops;
  const auto row_of = [&](const Loop& loop, int row) {
    return a.system.first_row(static_cast<int>(&loop - model.loops.all.data())) + row - loop.first;
  };
  double size = 0.0, alone = 0.0, open = model.loops.left_open ? model.loops.dependent : 0.0;
  const std::vector<double> pushed = a.system.accelerations_alone();
  for (const Loop& loop : model.loops.all) {
    if (loop.closing != Closing::coupling)
      alone = std::max(alone, a.system.size_of_centripetal(static_cast<int>(&loop - model.loops.all.data())));
    for (int i = loop.first; i < loop.first + loop.rows; ++i) {
      size = std::max(size, k.scale[at(i)] * a.system.size_of_acceleration(row_of(loop, i), a.Udot.data()));
      alone = std::max(alone, k.scale[at(i)] * a.system.size_of_acceleration(row_of(loop, i), pushed.data()));
      if (loop.turns()) open = std::max(open, k.scale[at(i)] * std::abs(k.c[at(i)]) / loop.lever);
    }
  }
  const double limit = (kContradiction + 1e3 * open) * size + kRounding * alone;
  for (std::size_t i = at(k.rank); i < k.row_at.size(); ++i) {
    const int row = k.row_at[i];
    const Loop& loop = pass.loop_of(row);
    const double missing = k.scale[at(row)] * std::abs(a.system.acceleration(row_of(loop, row), a.Udot.data()));
    if (missing <= limit) continue;
    const int outer = std::max(loop.from.sweep, loop.to.sweep);
    ws.breakdown = {.body = outer > 0 ? outer : 1, .component = -1, .value = missing, .limit = limit, .row = row};
    return false;
  }
  return true;
}

}  // namespace

bool run_absolute(const Model& model, Workspace& ws, const Inputs& in, double* vdot) {
  LoopWork& k = *ws.loops;
  if (!k.absolute) k.absolute = {new AbsoluteWork(model), [](AbsoluteWork* work) { delete work; }};
  AbsoluteWork& a = *k.absolute;
  LoopPass pass(model, ws, in);
  pass.place();
  choose_rows(model, pass, k, a.system, a.kept);
  a.system.enter(in.q, in.v, a.Q.data(), a.U.data());
  a.system.place(a.Q.data(), a.U.data(), in.drives, {in.q, in.v});
  if (!a.system.accelerate(in, a.kept, a.Udot.data(), a.lambda.data())) {
    ws.breakdown = {.body = 1, .component = -1, .row = 0};
    return false;
  }
  a.system.rates_of_hinges(a.Udot.data(), vdot);
  for (int i = 0; i < model.nv; ++i)
    if (in.vdot && model.has_given_motion(i)) vdot[i] = in.vdot[i];
  if (!keeps_rows_left_out(model, ws, pass, a)) return false;
  take_multipliers(model, k, a.system, a.lambda.data());
  pass.share();
  push_open_tree(model, ws, in, pass, vdot);
  return true;
}

std::vector<std::uint8_t> independent_rows(const Model& model, Workspace& ws, const Inputs& in, const AbsoluteSystem& system) {
  std::vector<std::uint8_t> kept;
  stand(model, ws, in.q, false);
  LoopPass pass(model, ws, in);
  pass.place();
  choose_rows(model, pass, *ws.loops, system, kept);
  return kept;
}

}  // namespace cardan
