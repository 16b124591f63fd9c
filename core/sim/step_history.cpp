#include "core/sim/step_history.hpp"

#include <algorithm>

namespace cardan {

const StepInterval* StepHistory::close(double t, const IntegratorStatistics& statistics, bool named) {
  now_.evaluations = statistics.rhs_calls - whole_.evaluations;
  now_.rejected = statistics.rejected;
  now_.rejected.subtract(whole_.rejected);
  if (now_.empty()) return nullptr;
  now_.end = t;
  int worst = -1;
  for (std::size_t i = 0; i < by_state_.size(); ++i) {
    totals_[i] += by_state_[i];
    if (by_state_[i] > now_.of_worst) now_.of_worst = by_state_[i], worst = static_cast<int>(i);
  }
  if (named && worst >= 0) now_.worst = name_(worst);
  std::ranges::fill(by_state_, 0);
  whole_.add(now_);
  last_ = std::exchange(now_, {});
  now_.begin = now_.end = t;
  return &last_;
}

std::map<std::string, long> StepHistory::by_name() const {
  std::map<std::string, long> all = by_name_;
  for (std::size_t i = 0; i < totals_.size(); ++i)
    if (totals_[i] > 0) all[name_(static_cast<int>(i))] += totals_[i];
  return all;
}

void StepHistory::leave_model() {
  by_name_ = by_name();
  std::ranges::fill(totals_, 0);
}

std::vector<std::pair<std::string, long>> StepHistory::worst() const {
  const std::map<std::string, long> named = by_name();
  std::vector<std::pair<std::string, long>> all(named.begin(), named.end());
  std::ranges::stable_sort(all, std::ranges::greater{}, &std::pair<std::string, long>::second);
  return all;
}

void StepHistory::remember(Archive& archive) {
  const std::size_t states = by_state_.size();
  std::vector<std::pair<std::string, long>> by_name(by_name_.begin(), by_name_.end());
  archive(now_, whole_, by_state_, totals_, by_name);
  if (by_state_.size() != states || totals_.size() != states) archive.wrong("a history of other states");
  by_name_ = {by_name.begin(), by_name.end()};
}

}  // namespace cardan
