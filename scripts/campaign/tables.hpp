#pragma once
// What a campaign came to: for a screen, for a program, for a spreadsheet, and for its page.
#include <cmath>
#include <string>
#include <vector>

#include "core/io/json.hpp"
#include "scripts/campaign/bands.hpp"
#include "scripts/campaign/campaign.hpp"
#include "scripts/campaign/statistics.hpp"

namespace cardan {

inline constexpr double kConfidence = 0.95;  // of the bounds that are told

/// A number of runs: a parameter that chance sets, of all that began, a check or a figure, of those that came to their end. In the order in
/// which they were declared.
struct Quantity {
  enum class Kind { drawn, check, figure } kind;
  std::string name, unit, limit;                    // limit: of a check, as it tells it
  double at_least = -HUGE_VAL, at_most = HUGE_VAL;  // what a check permits
  std::vector<double> values;                       // of the runs in `runs`
  std::vector<std::size_t> runs;                    // indices among all
  std::size_t failed = 0;                           // of a check: runs that it failed in
  Distribution distribution() const { return distribution_of(values); }
  /// Its values in some of the runs, in ascending order; empty where one of them lacks it.
  std::vector<double> in(const std::vector<std::size_t>& some) const;
};
std::vector<Quantity> quantities_of(const std::vector<CampaignRun>& runs);

/// Of the parameters that chance sets those whose ranks a quantity goes with most, the first `most` of them: index among quantities,
/// correlation. Those that chance alone would bring about in one of twenty are left out: |r| below 1.96 / sqrt(n - 1).
std::vector<std::pair<std::size_t, double>> drivers_of(std::size_t of, const std::vector<Quantity>& all, std::size_t most);

/// A line of a run: its seed, what became of it, and of a run that did not pass why.
std::string line_of(const CampaignRun& run);
std::string campaign_text(const std::vector<CampaignRun>& runs, const std::vector<Quantity>& quantities, const std::vector<Band>& bands);
/// A row for each run: seed, verdict, end, times, then each quantity with its unit. Text in quotes (RFC 4180); empty where a run has it
/// not.
std::string campaign_csv(const std::vector<CampaignRun>& runs, const std::vector<Quantity>& quantities);
/// about: facts that stand at its beginning.
Json campaign_json(const Json& about, const std::vector<CampaignRun>& runs, const std::vector<Quantity>& quantities,
                   const std::vector<Band>& bands);

}  // namespace cardan
