#include "core/model/rotary_terms.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "core/linalg/dense.hpp"

namespace cardan {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// [rad] The sum over the modes of the largest rotation of each, up to which the tolerance holds.
constexpr double kTurn = 0.1;

/// Leaves out of dM_ee / d eta what changes no modal mass by more than the tolerance; returns how much that is at most: sum_i |eta_i|
/// turn_i |S_i| <= kTurn max |S_i|, with S_i = dM_ee / d eta_i per radian in coordinates of unit mass. What stays is made of fewer matrices
/// than there are modes, the best ones (Eckart, Young 1936).
double shorten(ModalIntegrals& I, double tolerance) {
  const Index m = I.I6.rows();
  const VectorXd turn = I.rotary_turn.unaryExpr([](double x) { return x > 0.0 ? x : 1.0; });
  const std::optional<MatrixXd> L = cholesky(I.I6);
  if (!L) return 0.0;  // which compile() refuses
  const auto lower = L->triangularView<Eigen::Lower>();
  MatrixXd rows(m, m * m);
  for (Index i = 0; i < m; ++i) {
    const MatrixXd& ee = I.rotary_ee[static_cast<std::size_t>(i)];
    const MatrixXd half = lower.solve(MatrixXd(0.5 / turn[i] * (ee + ee.transpose())));
    rows.row(i) = MatrixXd(lower.solve(half.transpose())).reshaped().transpose();
  }
  if (const double all = kTurn * rows.rowwise().norm().maxCoeff(); all <= tolerance) {
    I.rotary_ee.clear();
    return all;
  }
  const auto [values, U] = symmetric_pairs(rows * rows.transpose());
  const VectorXd squares = values.cwiseMax(values[m - 1] * static_cast<double>(m) * std::numeric_limits<double>::epsilon());
  VectorXd left_out = VectorXd::Zero(m);  // of each row, squared
  Index dropped = 0;
  double change = 0.0;
  for (; dropped < m; ++dropped) {
    left_out += squares[dropped] * U.col(dropped).cwiseAbs2();
    const double more = kTurn * std::sqrt(left_out.maxCoeff());
    if (more > tolerance) break;
    change = more;
  }
  if (dropped == 0) return 0.0;
  const auto kept = U.rightCols(m - dropped);
  const MatrixXd mix = turn.asDiagonal() * (kept * kept.transpose()) * turn.cwiseInverse().asDiagonal();
  std::vector<MatrixXd> shorter(I.rotary_ee.size(), MatrixXd::Zero(m, m));
  for (Index i = 0; i < m; ++i)
    for (Index k = 0; k < m; ++k) shorter[static_cast<std::size_t>(i)] += mix(i, k) * I.rotary_ee[static_cast<std::size_t>(k)];
  I.rotary_ee = std::move(shorter);
  return change;
}

/// Leaves out the changes of M_we that are as small beside the kinetic energies of rotation and of modes, one by one; returns how large
/// they are at most together: those of one eta_l stand in m columns.
double shorten_coupling(ModalIntegrals& I, double tolerance) {
  const Index m = I.I6.rows();
  const Eigen::Vector3d c = I.I2 / I.I1;
  const Eigen::Matrix3d J = I.I7 - I.I1 * (c.squaredNorm() * Eigen::Matrix3d::Identity() - c * c.transpose());
  const std::optional<MatrixXd> L = cholesky(J);
  if (!L || !I.I6.isDiagonal(0.0)) return 0.0;
  double left_out = 0.0;
  bool any = false;
  for (Index l = 0; l < m; ++l) {
    MatrixXd& we = I.rotary_we[static_cast<std::size_t>(l)];
    const double turn = I.rotary_turn[l] > 0.0 ? I.rotary_turn[l] : 1.0;
    double squares = 0.0;
    for (Index k = 0; k < m; ++k) {
      const double size = kTurn / turn * L->triangularView<Eigen::Lower>().solve(VectorXd(we.col(k))).norm() / std::sqrt(I.I6(k, k));
      if (size > tolerance / std::sqrt(static_cast<double>(m))) {
        any = true;
      } else {
        squares += size * size;
        we.col(k).setZero();
      }
    }
    left_out = std::max(left_out, std::sqrt(squares));
  }
  if (!any) I.rotary_we.clear();
  return left_out;
}

/// The second order of exp(theta~) J exp(-theta~) is at most 2 |theta|^2 |J|, that of Jr* J Jr less (Jr: right Jacobian of exp).
double second_order_of(const ModalIntegrals& I) { return 2.0 * kTurn * kTurn * I.rotary_share; }

bool has_turns(const ModalData& d) { return d.integrals.rotary_turn.size() == d.n_modes; }

/// Of modes whose rotary terms are all there; null: nothing is left out.
std::shared_ptr<const ModalData> shortened(const std::shared_ptr<const ModalData>& whole, int level, double tolerance) {
  const ModalData& d = *whole;
  const bool second_order = std::ranges::any_of(d.mass_nodes, [](const MassNode& n) { return !n.Q.empty(); });
  if (d.integrals.rotary_ww.empty() || level == 0 || !has_turns(d) || !(tolerance > 0.0)) return nullptr;
  const double beyond = level == 2 ? second_order_of(d.integrals) : 0.0;
  if (level == 2 && (second_order || beyond > tolerance)) return nullptr;
  auto out = std::make_shared<ModalData>(d);
  ModalIntegrals& I = out->integrals;
  const double of_modes = I.rotary_ee.empty() ? 0.0 : shorten(I, tolerance);
  const double of_coupling = I.rotary_we.empty() ? 0.0 : shorten_coupling(I, tolerance);
  out->left_out = std::max({beyond, of_modes, of_coupling});
  if (level < 2 && out->left_out == 0.0 && !I.rotary_ee.empty()) return nullptr;
  out->whole = whole;
  return out;
}

/// With all rotary terms that the source has. Whatever else was changed since stays changed.
std::shared_ptr<const ModalData> with_all_of_them(const std::shared_ptr<const ModalData>& modal) {
  if (!modal->whole) return modal;
  auto out = std::make_shared<ModalData>(*modal);
  out->integrals.rotary_we = modal->whole->integrals.rotary_we;
  out->integrals.rotary_ee = modal->whole->integrals.rotary_ee;
  out->whole = nullptr, out->left_out = 0.0;
  return out;
}

}  // namespace

std::shared_ptr<const SystemSpec> with_kept_rotary_terms(std::shared_ptr<const SystemSpec> spec) {
  std::shared_ptr<SystemSpec> out;
  std::map<std::tuple<const ModalData*, int, double>, std::shared_ptr<const ModalData>> done;  // wings share theirs
  for (std::size_t i = 0; i < spec->bodies.size(); ++i) {
    const BodySpec& body = spec->bodies[i];
    if (!body.modal || body.modal->n_modes == 0) continue;
    const auto [at, is_new] = done.try_emplace({body.modal.get(), body.level, body.rotary_tolerance});
    if (is_new) {
      const std::shared_ptr<const ModalData> whole = with_all_of_them(body.modal);
      at->second = shortened(whole, body.level, body.rotary_tolerance);
      if (!at->second) at->second = whole;
    }
    if (at->second == body.modal) continue;
    if (!out) out = std::make_shared<SystemSpec>(*spec);
    out->bodies[i].modal = at->second;
  }
  return out ? out : spec;
}

/// To one digit.
static double rounded_up(double x) {
  const double unit = std::pow(10.0, std::floor(std::log10(x)));
  return std::ceil(1.001 * x / unit) * unit;
}

void expect_rotary_terms(const BodySpec& body, DiagnosticSink& sink) {
  const ModalData& d = *body.modal;
  if (body.level < 2 || d.integrals.rotary_ww.empty() || d.whole || !d.mass_nodes.empty()) return;
  const double off = second_order_of(d.integrals);
  sink.report(
      {Code::bad_modal_data,
       {body.at.key_path + ".level", body.at.mark},
       "lumped masses for level 2 with nodal rotary inertia",
       has_turns(d) ? fmt::format("integrals alone: to first order, they are off by up to {:.2g} of a modal mass at {} rad", off, kTurn)
                    : "integrals alone, to first order",
       has_turns(d) ? fmt::format("`rotary_inertia: {:.1g}` of the body takes that, or `rotary_inertia: false` of a plate, or level 1",
                                  rounded_up(off))
                    : "level 1",
       "",
       "",
       0});
}

}  // namespace cardan
