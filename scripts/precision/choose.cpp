#include "scripts/precision/choose.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cardan {

std::string_view name_of(RunCost cost) {
  constexpr std::string_view kNames[] = {"cpu_s", "rhs_calls", "steps"};
  return kNames[static_cast<int>(cost)];
}

double cost_of(const PrecisionRow& row, RunCost cost) {
  return cost == RunCost::cpu ? row.cpu_s : static_cast<double>(cost == RunCost::rhs_calls ? row.rhs_calls : row.steps);
}

std::optional<double> error_of(const PrecisionRow& row, std::size_t kind, ErrorMeasure measure) {
  if (!row.failure.empty() || kind >= row.errors.size() || !row.errors[kind]) return std::nullopt;
  return value_of(*row.errors[kind], measure);
}

std::vector<std::size_t> pareto_front(const std::vector<PrecisionRow>& rows, std::size_t kind, ErrorMeasure measure, RunCost cost,
                                      double floor) {
  std::vector<std::size_t> front;
  const auto error = [&](std::size_t i) { return std::max(*error_of(rows[i], kind, measure), floor); };
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (const auto e = error_of(rows[i], kind, measure); e && std::isfinite(*e)) front.push_back(i);
  std::ranges::stable_sort(front, [&](std::size_t a, std::size_t b) {
    const double x = cost_of(rows[a], cost), y = cost_of(rows[b], cost);
    return x != y ? x < y : error(a) < error(b);
  });
  double best = std::numeric_limits<double>::infinity();
  std::erase_if(front, [&](std::size_t i) {
    if (!(error(i) < best)) return true;
    best = error(i);
    return false;
  });
  return front;
}

PrecisionChoice cheapest_within(const std::vector<PrecisionRow>& rows, const std::vector<ErrorBudget>& budgets,
                                const std::vector<double>& floors, ErrorMeasure measure, RunCost cost) {
  // The largest error over budget; infinite where a kind was not measured.
  const auto ratio = [&](const PrecisionRow& row) {
    double worst = 0.0;
    for (const ErrorBudget& b : budgets) {
      const auto e = error_of(row, b.kind, measure);
      const double off = e ? std::max(*e, floors[b.kind]) : std::numeric_limits<double>::infinity();
      worst = std::max(worst, b.most > 0.0 ? off / b.most : off > 0.0 ? std::numeric_limits<double>::infinity() : 0.0);
    }
    return worst;
  };
  const auto tighter = [](const PrecisionSetting& a, const PrecisionSetting& b) {
    return a.name() == b.name() && (a.adaptive ? a.relative < b.relative : a.step < b.step);
  };
  PrecisionChoice out;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!rows[i].failure.empty()) continue;
    double of_curve = ratio(rows[i]);
    for (const PrecisionRow& other : rows)
      if (other.failure.empty() && tighter(other.setting, rows[i].setting)) of_curve = std::max(of_curve, ratio(other));
    if (of_curve <= 1.0 && (!out.row || cost_of(rows[i], cost) < cost_of(rows[*out.row], cost))) out.row = i, out.ratio = of_curve;
    if (!out.nearest || ratio(rows[i]) < ratio(rows[*out.nearest])) out.nearest = i;
  }
  if (out.row) out.nearest = out.row;
  if (!out.row && out.nearest) out.ratio = ratio(rows[*out.nearest]);
  return out;
}

}  // namespace cardan
