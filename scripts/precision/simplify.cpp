#include "scripts/precision/simplify.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

namespace cardan {
namespace {

constexpr std::size_t kAllTried = 3;  // of a group, one by one
constexpr double kTold = 0.02;        // [s] of processor time: below, times do not tell which of two is shorter

class Search {
 public:
  Search(const PrecisionOrder& order, PrecisionStudy& study, SimplifiedModel& model, const std::vector<ErrorBudget>& budgets,
         ErrorMeasure measure, const PrecisionRow& whole, const std::function<double(const Sets&)>& operations)
      : order_(order), study_(study), model_(model), budgets_(budgets), measure_(measure), whole_(whole), count_(operations) {
    truth_ = yardstick(order, study, study.reference.runs.front());
    same_ = yardstick(order, study, whole);
  }

  bool ready() const { return truth_ && same_; }
  bool stopped() const { return order_.stop && order_.stop(); }
  SimplifiedRun& run(std::size_t i) { return model_.runs[i]; }
  bool keeps(std::size_t i) const {
    const PrecisionRow& row = model_.runs[i].row;
    if (!row.failure.empty() || (whole_.checks_passed && !row.checks_passed)) return false;
    return std::ranges::all_of(budgets_, [&](const ErrorBudget& b) {
      const auto e = error_of(row, b.kind, measure_);
      return e && std::max(*e, study_.floor(b.kind, measure_)) <= b.most;
    });
  }

  /// The model without these, with this setting; index into the runs.
  std::size_t without(const std::vector<std::size_t>& of, const PrecisionSetting& setting) {
    SimplifiedRun next;
    next.of = of;
    next.row.setting = setting;
    for (const std::size_t i : of) {
      const Sets& sets = model_.all[i].sets;
      next.row.setting.model.insert(next.row.setting.model.end(), sets.begin(), sets.end());
    }
    for (std::size_t i = 0; i < model_.runs.size(); ++i)
      if (model_.runs[i].row.setting == next.row.setting) return i;
    run_rows(order_, study_, {&next.row}, {&*truth_, &*same_});
    if (next.row.failure.empty()) {
      next.row.errors = next.row.against[truth_->folder];
      if (setting == whole_.setting) next.added = next.row.against[same_->folder];
    }
    next.operations = static_cast<double>(next.row.rhs_calls) * count_(next.row.setting.model);
    model_.runs.push_back(std::move(next));
    if (order_.told_model) order_.told_model(words(of), model_.runs.back().row);
    return model_.runs.size() - 1;
  }

  /// Of a group, what keeps the budget by itself: indices of simplifications, the mildest first.
  std::vector<std::size_t> kept_alone(const std::vector<std::size_t>& group) {
    std::vector<std::size_t> kept;
    const auto keeps_alone = [&](std::size_t s) { return keeps(without({s}, whole_.setting)); };
    if (group.size() <= kAllTried) {
      for (const std::size_t s : group)
        if (!stopped() && keeps_alone(s)) kept.push_back(s);
      return kept;
    }
    std::size_t good = 0, bad = group.size();  // how many from the mildest on; the first that is not
    while (good < bad && !stopped()) {
      const std::size_t middle = (good + bad) / 2;
      if (keeps_alone(group[middle]))
        kept.push_back(group[middle]), good = middle + 1;
      else
        bad = middle;
    }
    return kept;
  }

  std::string words(const std::vector<std::size_t>& of) const {
    std::string text;
    for (const std::size_t i : of) text += (text.empty() ? "" : ", ") + model_.all[i].what;
    return text;
  }

 private:
  const PrecisionOrder& order_;
  PrecisionStudy& study_;
  SimplifiedModel& model_;
  const std::vector<ErrorBudget>& budgets_;
  ErrorMeasure measure_;
  const PrecisionRow& whole_;
  const std::function<double(const Sets&)>& count_;
  std::optional<Yardstick> truth_, same_;  // the reference, and the whole model with the same setting
};

/// Of each curve of the study in this formulation its cheapest row that keeps the budgets.
std::vector<PrecisionSetting> settings_within(const PrecisionStudy& study, const Formulation& formulation,
                                              const std::vector<ErrorBudget>& budgets, const std::vector<double>& floors,
                                              ErrorMeasure measure) {
  std::map<std::string, std::vector<PrecisionRow>> curves;
  for (const PrecisionRow& row : study.rows)
    if (row.setting.formulation == formulation) curves[row.setting.name()].push_back(row);
  std::vector<PrecisionSetting> out;
  for (const auto& [name, rows] : curves)
    if (const auto choice = cheapest_within(rows, budgets, floors, measure, RunCost::cpu); choice.row)
      out.push_back(rows[*choice.row].setting);
  return out;
}

}  // namespace

SimplifiedModel simplify(const PrecisionOrder& order, PrecisionStudy& study, std::vector<Simplification> all,
                         const std::vector<ErrorBudget>& budgets, ErrorMeasure measure, std::size_t row,
                         const std::function<double(const Sets&)>& operations) {
  SimplifiedModel model;
  model.all = std::move(all);
  const PrecisionRow whole = study.rows[row];
  SimplifiedRun& first = model.runs.emplace_back();
  first.row = whole;
  first.operations = static_cast<double>(whole.rhs_calls) * operations({});
  Search search(order, study, model, budgets, measure, whole, operations);
  if (!search.ready()) return model;

  std::vector<std::vector<std::size_t>> groups;  // of what the scene takes
  for (std::size_t i = 0; i < model.all.size(); ++i) {
    if (!model.all[i].refusal.empty()) continue;
    if (groups.empty() || model.all[groups.back().front()].group != model.all[i].group) groups.emplace_back();
    groups.back().push_back(i);
  }
  struct Offer {
    std::size_t simplification;
    double worth;  // operations that it saves, over the part of the budget that it takes
  };
  std::vector<Offer> offers;
  for (const auto& group : groups)
    for (const std::size_t s : search.kept_alone(group)) {
      const SimplifiedRun& run = search.run(search.without({s}, whole.setting));
      const double saved = model.runs.front().operations - run.operations;
      double part = 1e-6;
      for (const ErrorBudget& b : budgets)
        if (b.kind < run.added.size() && run.added[b.kind]) part = std::max(part, value_of(*run.added[b.kind], measure) / b.most);
      if (saved > 0.0) offers.push_back({s, saved / part});
    }
  std::ranges::stable_sort(offers, std::greater<>(), &Offer::worth);

  // What is worth most first; of a group the stronger takes the place of the milder where the budget still allows it.
  std::vector<std::size_t> taken;
  std::size_t best = 0;
  for (const Offer& offer : offers) {
    if (search.stopped()) break;
    std::vector<std::size_t> more = taken;
    std::erase_if(more, [&](std::size_t s) { return model.all[s].group == model.all[offer.simplification].group; });
    more.push_back(offer.simplification);
    const std::size_t i = search.without(more, whole.setting);
    if (search.keeps(i) && search.run(i).operations < search.run(best).operations) taken = std::move(more), best = i;
  }
  model.chosen = best;
  if (taken.empty()) return model;

  // A model without its fastest motion may be best served by another method.
  for (const PrecisionSetting& setting : settings_within(study, whole.setting.formulation, budgets, floors_of(study, measure), measure)) {
    if (search.stopped()) break;
    const std::size_t i = search.without(taken, setting);
    const double is = search.run(model.chosen).row.cpu_s;
    if (search.keeps(i) && is >= kTold && search.run(i).row.cpu_s < is) model.chosen = i;
  }
  return model;
}

}  // namespace cardan
