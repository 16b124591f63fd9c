#include "core/operators/spatial_operators.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/diagnostic.hpp"
#include "core/base/units.hpp"
#include "core/linalg/dense.hpp"
#include "core/soa/kernels.hpp"

namespace cardan::operators {

std::string_view name_of(Stage stage) {
  constexpr std::string_view names[] = {"none", "Position", "Inertia", "OperationalSpace", "Direction"};
  return names[static_cast<std::size_t>(stage)];
}

SpatialOperators::~SpatialOperators() = default;
SpatialOperators::SpatialOperators(SpatialOperators&&) noexcept = default;

bool SpatialOperators::has(Stage stage) const {
  switch (stage) {
    case Stage::none:
      return true;
    case Stage::position:
      return has_position_;
    case Stage::inertia:
      return has_inertia_;
    case Stage::operational_space:
      return has_operational_space_;
    case Stage::direction:
      return has_direction_;
  }
  return false;
}

void SpatialOperators::require(Kind kind) const {
  const Stage need = facts(kind).stage;
  if (has(need)) return;
  constexpr std::string_view call[] = {"", "at(q)", "articulate()", "operational_space()", "along(u)"};
  refuse(Code::operator_stage, {std::string("operator ") + std::string(facts(kind).name)}, fmt::format("stage {}", name_of(need)),
         "not computed at this q", fmt::format("call {} first", call[static_cast<std::size_t>(need)]));
}

int SpatialOperators::size(Space space) const {
  switch (space) {
    case Space::hinge:
      return n_hinge_;
    case Space::body:
      return n_body_;
    case Space::node:
      return 6 * static_cast<int>(nodes_.size());
    case Space::rate:
      return n_rate_;
  }
  return 0;
}

std::string SpatialOperators::unit_of(std::string_view rate, Sort sort) {
  if (sort == Sort::unknown) return "";
  if (sort == Sort::motion) return fmt::format("{}^2", rate);
  return force_unit(rate);
}
std::string SpatialOperators::axis_of(const std::string& place, int row, Sort sort) {
  constexpr std::string_view of_motion[] = {"wx", "wy", "wz", "vx", "vy", "vz"}, of_force[] = {"nx", "ny", "nz", "fx", "fy", "fz"};
  return fmt::format("{}:{}", place, (sort == Sort::force ? of_force : of_motion)[row]);
}

SpaceLabels SpatialOperators::node_labels(std::span<const int> nodes, Sort sort) const {
  SpaceLabels out;
  for (const int j : nodes)
    for (int r = 0; r < 6; ++r) {
      out.names.push_back(axis_of(model_->nodes[static_cast<std::size_t>(j)].name, r, sort));
      out.units.push_back(unit_of(r < 3 ? "rad/s" : "m/s", sort));
    }
  return out;
}

double* SpatialOperators::scratch(std::size_t count) const {
  if (scratch_.size() < count) scratch_.resize(count);
  return scratch_.data();
}

void SpatialOperators::take(const Articulate& options) {
  require(Kind::H);
  if (const auto n = static_cast<int>(options.free.size()); n != 0 && n != size(Space::hinge))
    refuse(Code::operator_shape, {"free of articulate"}, fmt::format("{} numbers (hinge space)", size(Space::hinge)), fmt::format("{}", n));
  free_.assign(options.free.begin(), options.free.end());
  masked_ = std::any_of(free_.begin(), free_.end(), [](std::uint8_t f) { return f == 0; });
  weighted_ = options.W != nullptr;
  has_inertia_ = has_operational_space_ = false;
}

void SpatialOperators::factor(Eigen::MatrixXd& D, Eigen::VectorXd made_of, int v, Eigen::MatrixXd& S,
                              const std::function<soa::Breakdown(int component)>& where) const {
  const int n = static_cast<int>(D.rows());
  Eigen::MatrixXd factored = D;
  for (int j = 0; j < n; ++j)
    if (!is_free(v + j)) {
      D.row(j).setZero(), D.col(j).setZero();
      factored.row(j).setZero(), factored.col(j).setZero();
      factored(j, j) = made_of[j] = 1.0;
    }
  S.setZero(n, n);
  for (int j = 0; j < n; ++j) {
    const double pivot = factored(j, j) - S.row(j).head(j).squaredNorm();
    const Eigen::VectorXd w = S.topLeftCorner(j, j).triangularView<Eigen::Lower>().transpose().solve(S.row(j).head(j).transpose());
    const double root = std::sqrt(made_of[j]) + w.cwiseAbs().dot(made_of.head(j).cwiseSqrt());
    if (const double limit = soa::kPivotLimit * root * root; !(pivot > limit)) {  // soa::rounding_of_pivot
      soa::Breakdown at = where(j);
      at.value = pivot, at.limit = limit;
      throw NumericsError(describe_breakdown(*model_, at, 0.0));
    }
    S(j, j) = std::sqrt(pivot);
    for (int r = j + 1; r < n; ++r) S(r, j) = (factored(r, j) - S.row(r).head(j).dot(S.row(j).head(j))) / S(j, j);
  }
}

Eigen::MatrixXd SpatialOperators::factor_square_root(const Eigen::MatrixXd& root, const Eigen::MatrixXd& H_star,
                                                     const Eigen::VectorXd& made_of, int v, Eigen::MatrixXd& D, Eigen::MatrixXd& S,
                                                     const std::function<soa::Breakdown(int component)>& where) const {
  const Eigen::Index n = H_star.cols();
  std::vector<Eigen::Index> taken;
  for (Eigen::Index j = 0; j < n; ++j)
    if (is_free(v + static_cast<int>(j))) taken.push_back(j);
  S.setIdentity(n, n);
  Eigen::MatrixXd U = Eigen::MatrixXd::Zero(n, root.rows());
  if (!taken.empty()) {
    const ThinQr qr = thin_qr(root.transpose() * H_star(Eigen::all, taken));
    for (std::size_t a = 0; a < taken.size(); ++a) {
      const auto row = static_cast<Eigen::Index>(a);
      const double length = std::abs(qr.R(row, row)), limit = soa::kRootPivotLimit * std::sqrt(made_of[taken[a]]);
      if (!(length > limit)) {
        soa::Breakdown at = where(static_cast<int>(taken[a]));
        at.value = length * length, at.limit = limit * limit;
        throw NumericsError(describe_breakdown(*model_, at, 0.0));
      }
      const double sign = std::copysign(1.0, qr.R(row, row));
      for (std::size_t b = a; b < taken.size(); ++b) S(taken[b], taken[a]) = sign * qr.R(row, static_cast<Eigen::Index>(b));
      U.row(taken[a]) = sign * (root * qr.Q.col(row)).transpose();
    }
  }
  D = S * S.transpose();
  for (Eigen::Index j = 0; j < n; ++j)
    if (!is_free(v + static_cast<int>(j))) D(j, j) = 0.0;
  return U;
}

}  // namespace cardan::operators
