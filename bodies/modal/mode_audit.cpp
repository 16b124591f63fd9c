#include "bodies/modal/mode_audit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

namespace cardan {
namespace {

constexpr std::array kDirections = {"rotation about x",    "rotation about y",    "rotation about z",
                                    "translation along x", "translation along y", "translation along z"};

constexpr double kNegligible = 1e-6;  // of the rigid mass: a direction in which nothing that was computed moves

/// Of the modes still kept, drops those that no direction needs to reach its share.
void keep_effective(std::vector<ModeRecord>& records, double share, const Eigen::VectorXd& rigid_mass) {
  std::vector<std::string> needed(records.size());
  for (int d = 0; d < 6; ++d) {
    std::vector<std::size_t> order(records.size());
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](auto a, auto b) { return records[a].effective_mass(d) > records[b].effective_mass(d); });
    double total = 0.0, sum = 0.0;
    for (const ModeRecord& r : records) total += r.effective_mass(d);
    if (total < kNegligible * rigid_mass(d)) continue;
    for (std::size_t i : order) {
      if (sum >= share * total) break;
      if (!records[i].kept) continue;
      sum += records[i].effective_mass(d);
      if (needed[i].empty())
        needed[i] = fmt::format("{:.3g} % of the effective mass in {}", 100 * records[i].effective_mass(d) / total, kDirections[d]);
    }
  }
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (!records[i].kept) continue;
    records[i].kept = !needed[i].empty();
    records[i].reason = records[i].kept ? needed[i] : fmt::format("no direction needs it to reach {:.3g} %", 100 * share);
  }
}

}  // namespace

Eigen::MatrixXd participation(const FeModel& model, const FeModes& modes) {
  return model.rigid_shapes().transpose() * (model.M * modes.shapes);
}

std::vector<ModeRecord> audit_modes(const FeModel& model, const FeModes& modes, const ModeChoice& choice) {
  const Eigen::MatrixXd resultants = participation(model, modes), R = model.rigid_shapes();
  std::vector<ModeRecord> records;
  for (Eigen::Index j = 0; j < modes.omega2.size(); ++j) {
    ModeRecord r;
    r.frequency = std::sqrt(modes.omega2(j)) / (2 * std::numbers::pi);
    r.effective_mass = resultants.col(j).cwiseAbs2();
    r.kind = "normal";
    r.reason = "all are kept";
    if (choice.count) {
      r.kept = j < *choice.count;
      r.reason = fmt::format("{} the {} lowest", r.kept ? "among" : "not among", *choice.count);
    }
    if (choice.max_frequency > 0 && r.kept) {
      r.kept = r.frequency <= choice.max_frequency;
      r.reason = fmt::format("{} {:.6g} Hz", r.kept ? "not above" : "above", choice.max_frequency);
    }
    records.push_back(std::move(r));
  }
  if (choice.effective_mass > 0) keep_effective(records, choice.effective_mass, (R.transpose() * (model.M * R)).diagonal());
  return records;
}

}  // namespace cardan
