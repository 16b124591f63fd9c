#include "core/dynamics/loop_tangent.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "core/base/diagnostic.hpp"
#include "core/dynamics/forward.hpp"
#include "core/dynamics/hinge_fit.hpp"
#include "core/linalg/dense.hpp"
#include "core/soa/tangent_leaves.hpp"

namespace cardan {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using soa::Tangent;
using Vector6 = Eigen::Matrix<double, 6, 1>;

Vector6 slope(const Vec3<Tangent>& a, const Vec3<Tangent>& b) {
  Vector6 out;
  out << a.x.d, a.y.d, a.z.d, b.x.d, b.y.d, b.z.d;
  return out;
}
Vector6 value(const Vec3<Tangent>& a, const Vec3<Tangent>& b) {
  Vector6 out;
  out << a.x.x, a.y.x, a.z.x, b.x.x, b.y.x, b.z.x;
  return out;
}
Vector6 as_vector(const Force<double>& W) {
  Vector6 out;
  out << W.n.x, W.n.y, W.n.z, W.f.x, W.f.y, W.f.z;
  return out;
}
Vec3<Tangent> with_slope(const Eigen::Vector3d& a, const Eigen::Vector3d& d) { return {{a.x(), d.x()}, {a.y(), d.y()}, {a.z(), d.z()}}; }
Eigen::Matrix3d slope(const Mat3<Tangent>& R) {
  Eigen::Matrix3d out;
  out << R.xx.d, R.xy.d, R.xz.d, R.yx.d, R.yy.d, R.yz.d, R.zx.d, R.zy.d, R.zz.d;
  return out;
}
Eigen::Matrix3d value(const Mat3<Tangent>& R) {
  Eigen::Matrix3d out;
  out << R.xx.x, R.xy.x, R.xz.x, R.yx.x, R.yy.x, R.yz.x, R.zx.x, R.zy.x, R.zz.x;
  return out;
}
/// Both halves of a column turned by R.
Vector6 turned(const Eigen::Matrix3d& R, const Vector6& x) {
  Vector6 out;
  out << R * x.head<3>(), R * x.tail<3>();
  return out;
}

}  // namespace

LoopTangents::LoopTangents(const Model& closed, const Inputs& in, double t)
    : m_(closed),
      ws_(closed),
      q_(Eigen::Map<const VectorXd>(in.q, closed.nq)),
      v_(Eigen::Map<const VectorXd>(in.v, closed.nv)),
      vdot_(closed.nv),
      from_(closed.loops.all.size()),
      to_(from_.size()),
      place_(from_.size()),
      hinges_(from_.size()),
      couplings_(from_.size()) {
  if (!forward_dynamics(m_, ws_, in, vdot_.data())) throw NumericsError(describe_breakdown(m_, ws_.breakdown, t));
  settle_loops(m_, ws_, in);
  const LoopForces forces = loop_forces(ws_);
  lambda_ = Eigen::Map<const VectorXd>(forces.multipliers.data(), m_.loops.rows);
  dlambda_ = VectorXd::Zero(m_.loops.rows);
  // Accelerations of hinges that close, from those of the ends.
  LoopPass moving(m_, ws_, in);
  moving.place();
  for (std::size_t l = 0; l < hinges_.size(); ++l) {
    const Loop& loop = m_.loops.all[l];
    if (!loop.hinge || loop.hinge->nv == 0) continue;
    HingeTangent& h = hinges_[l];
    const soa::RelativePlace& r = ws_.loops->relative[l];
    const int nv = static_cast<int>(loop.hinge->nv);
    h.v = Eigen::Map<const VectorXd>(ws_.loops->v[l].data(), nv);
    cardan_hinge_out out{};
    const std::uint32_t zero = 0;
    loop.hinge->kinematics(loop.packed.data(), 1, &zero, &zero, ws_.loops->q[l].data(), h.v.data(), &out);
    const Eigen::Matrix3d R = to_eigen(r.R);
    h.H.resize(6, nv), h.dH.setZero(6, nv);
    for (int j = 0; j < nv; ++j) h.H.col(j) = turned(R, Eigen::Map<const Vector6>(out.Ht + 6 * j));
    h.bias = turned(R, Eigen::Map<const Vector6>(out.Hdot_v));
    h.bias.tail<3>() += to_eigen(r.w).cross(to_eigen(r.u));
    const auto [wdot, udot] =
        relative_acceleration(m_, ws_, in, loop, ws_.loops->from[l], ws_.loops->to[l], LoopPlace<double>{r.R, r.d, r.w, r.u}, vdot_.data());
    Vector6 a;
    a << to_eigen(wdot), to_eigen(udot);
    h.vdot = least_squares(HingeColumns(h.H), Vector6(a - h.bias), loop.lever);
  }
  freedom_ = loop_freedom(m_, ws_, in.q, in.drives);
  // M^-1 G* and G M^-1 G* of the independent rows.
  stand(m_, ws_, in.q, true);
  LoopPass pass(m_, ws_, in);
  pass.place();
  pass.matrix();
  pass.find_rank();
  if (!pass.compliance(m_.runs)) throw NumericsError(describe_breakdown(m_, ws_.breakdown, t));
}

void LoopTangents::place(const soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in) {
  for (std::size_t l = 0; l < place_.size(); ++l) {
    const Loop& loop = m_.loops.all[l];
    if (loop.closing == Closing::coupling) {
      if (loop.turns()) move_coupling(l, in);
      continue;
    }
    from_[l] = seen_from_home(m_, ws, in, loop.from, loop.from_path);
    to_[l] = seen_from_home(m_, ws, in, loop.to, loop.to_path);
    place_[l] = seen_from(from_[l], to_[l]);
    if (hinges_[l].v.size() > 0) move_hinge(l);
  }
}

void LoopTangents::move_coupling(std::size_t l, const soa::Inputs<Tangent>& in) {
  const Coupling& coupling = m_.loops.all[l].coupling;
  CouplingTangent& c = couplings_[l];
  const std::size_t n = coupling.terms.size();
  c.dq.resize(n), c.dv.resize(n), c.slope.resize(n);
  for (std::size_t i = 0; i < n; ++i) c.dq[i] = in.q[coupling.terms[i].q].d, c.dv[i] = in.v[coupling.terms[i].v].d;
  coupling.along(q_.data(), v_.data(), c.dq.data(), c.dv.data(), c.slope.data(), c.extra);
}

// The coordinates and rates of the hinge follow its ends; H* and Hdot* v by its family.
void LoopTangents::move_hinge(std::size_t l) {
  const Loop& loop = m_.loops.all[l];
  const cardan_hinge_family& f = *loop.hinge;
  HingeTangent& h = hinges_[l];
  const LoopPlace<Tangent>& r = place_[l];
  const Eigen::Matrix3d R = value(r.R), dR = slope(r.R), turn = dR * R.transpose();
  Vector6 way;
  way << turn(2, 1), turn(0, 2), turn(1, 0), r.d.x.d, r.d.y.d, r.d.z.d;
  const HingeColumns H(h.H);
  const int nv = static_cast<int>(f.nv), nq = static_cast<int>(f.nq);
  const VectorXd along = least_squares(H, way, loop.lever);
  std::vector<Tangent> q(static_cast<std::size_t>(nq)), v(static_cast<std::size_t>(nv));
  std::vector<double> rate(static_cast<std::size_t>(nq)), at_q(ws_.loops->q[l].data(), ws_.loops->q[l].data() + nq),
      at_v(h.v.data(), h.v.data() + nv);
  if (f.qdot)
    f.qdot(loop.packed.data(), ws_.loops->q[l].data(), along.data(), rate.data());
  else
    std::copy_n(along.data(), nq, rate.begin());
  for (int i = 0; i < nq; ++i)
    q[static_cast<std::size_t>(i)] = {ws_.loops->q[l][static_cast<std::size_t>(i)], rate[static_cast<std::size_t>(i)]};
  cardan_hinge_out at{}, change{};
  const std::uint32_t zero = 0;
  f.kinematics(loop.packed.data(), 1, &zero, &zero, ws_.loops->q[l].data(), h.v.data(), &at);
  const auto change_with = [&](const VectorXd& dv) {
    change = {};
    if (f.shape == CARDAN_SHAPE_BALL) return;  // its map is constant
    for (int i = 0; i < nv; ++i) v[static_cast<std::size_t>(i)] = {h.v[i], dv[i]};
    soa::add_record_slope(f, nullptr, loop.packed.data(), q.data(), v.data(), at_q.data(), at_v.data(), change.R_OP);
  };
  change_with(VectorXd::Zero(nv));
  for (int j = 0; j < nv; ++j)
    h.dH.col(j) = turned(dR, Eigen::Map<const Vector6>(at.Ht + 6 * j)) + turned(R, Eigen::Map<const Vector6>(change.Ht + 6 * j));
  const VectorXd dv = least_squares(H, Vector6(slope(r.w, r.u) - h.dH * h.v), loop.lever);
  change_with(dv);
  h.dbias = turned(dR, Eigen::Map<const Vector6>(at.Hdot_v)) + turned(R, Eigen::Map<const Vector6>(change.Hdot_v));
  const Vector6 x = value(r.w, r.u), dx = slope(r.w, r.u);
  h.dbias.tail<3>() += dx.head<3>().cross(x.tail<3>()) + x.head<3>().cross(dx.tail<3>());
}

VectorXd LoopTangents::row_rates() const {
  VectorXd changes = VectorXd::Zero(m_.loops.rows);
  for (std::size_t l = 0; l < place_.size(); ++l) {
    const Loop& loop = m_.loops.all[l];
    if (loop.closing == Closing::coupling) {
      for (std::size_t i = 0; i < loop.coupling.terms.size(); ++i) changes[loop.first] += slope_of(l, i) * v_[loop.coupling.terms[i].v];
      continue;
    }
    const LoopPlace<Tangent>& r = place_[l];
    if (loop.closing == Closing::distance) {
      changes[loop.first] = (dot((Tangent(1.0) / sqrt(dot(r.d, r.d))) * r.d, r.u)).d;
      continue;
    }
    Vector6 x = slope(r.w, r.u);
    if (hinges_[l].v.size() > 0) x -= hinges_[l].dH * hinges_[l].v;
    for (int i = loop.first; i < loop.first + loop.rows; ++i) changes[i] = as_vector(ws_.loops->W[static_cast<std::size_t>(i)]).dot(x);
  }
  return changes;
}

VectorXd LoopTangents::rates() const {
  VectorXd out = VectorXd::Zero(m_.nv);
  const VectorXd of_dependent = -freedom_.G_D_inverse * row_rates()(freedom_.rows);
  for (std::size_t i = 0; i < freedom_.dependent.size(); ++i) out[freedom_.dependent[i]] = of_dependent[static_cast<Eigen::Index>(i)];
  return out;
}

void LoopTangents::push(std::vector<soa::NodeWrench<Tangent>>& wrenches, Tangent* tau) const {
  for (std::size_t l = 0; l < place_.size(); ++l) {
    const Loop& loop = m_.loops.all[l];
    if (loop.closing == Closing::coupling) {
      for (std::size_t i = 0; i < loop.coupling.terms.size(); ++i) {
        const int v = loop.coupling.terms[i].v;
        tau[v] = tau[v] + Tangent(ws_.loops->gradient[l][i], slope_of(l, i)) * Tangent(lambda_[loop.first], dlambda_[loop.first]);
      }
      continue;
    }
    const LoopPlace<Tangent>& r = place_[l];
    Force<Tangent> f{{0, 0, 0}, {0, 0, 0}};
    if (loop.closing == Closing::distance) {
      f.f = (Tangent(lambda_[loop.first], dlambda_[loop.first]) / sqrt(dot(r.d, r.d))) * r.d;
    } else {
      Vector6 F = Vector6::Zero(), dF = Vector6::Zero();
      for (int i = loop.first; i < loop.first + loop.rows; ++i) {
        const Vector6 W = as_vector(ws_.loops->W[static_cast<std::size_t>(i)]);
        F += lambda_[i] * W, dF += dlambda_[i] * W;
      }
      // W* H* = 0 stays: what turns with H* is turned with it.
      if (const HingeTangent& h = hinges_[l]; h.v.size() > 0)
        dF -= h.H * symmetric_solve(MatrixXd(h.H.transpose() * h.H), VectorXd(h.dH.transpose() * F));
      f = {with_slope(F.head<3>(), dF.head<3>()), with_slope(F.tail<3>(), dF.tail<3>())};
    }
    if (loop.to.node >= 0) wrenches.push_back({loop.to.node, false, {transpose_times(r.R, f.n), transpose_times(r.R, f.f)}});
    if (loop.from.node >= 0) wrenches.push_back({loop.from.node, false, {-(f.n + cross(r.d, f.f)), -f.f}});
  }
}

void LoopTangents::solve(const soa::Workspace<Tangent>& ws, const soa::Inputs<Tangent>& in, const Tangent* vdot) {
  VectorXd changes = VectorXd::Zero(m_.loops.rows);
  for (std::size_t l = 0; l < place_.size(); ++l) {
    const Loop& loop = m_.loops.all[l];
    if (loop.closing == Closing::coupling) {
      for (std::size_t i = 0; i < loop.coupling.terms.size(); ++i) {
        const int v = loop.coupling.terms[i].v;
        changes[loop.first] += ws_.loops->gradient[l][i] * vdot[v].d + slope_of(l, i) * vdot_[v];
      }
      changes[loop.first] += couplings_[l].extra;
      continue;
    }
    const LoopPlace<Tangent>& r = place_[l];
    const auto [wdot, udot] = relative_acceleration(m_, ws, in, loop, from_[l], to_[l], r, vdot);
    if (loop.closing == Closing::distance) {
      const Tangent length = sqrt(dot(r.d, r.d)), along = dot(r.d, r.u) / length;
      changes[loop.first] = (dot(r.d, udot) / length + (dot(r.u, r.u) - along * along) / length).d;
      continue;
    }
    Vector6 x = slope(wdot, udot);
    if (const HingeTangent& h = hinges_[l]; h.v.size() > 0) x -= h.dH * h.vdot + h.dbias;
    for (int i = loop.first; i < loop.first + loop.rows; ++i) changes[i] = as_vector(ws_.loops->W[static_cast<std::size_t>(i)]).dot(x);
  }
  dlambda_.setZero();
  changes = -changes;
  const Inputs still{.q = nullptr};
  LoopPass(m_, ws_, still).solve(changes.data(), dlambda_.data());
}

}  // namespace cardan
