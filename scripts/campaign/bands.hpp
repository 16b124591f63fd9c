#pragma once
// How channels of many runs spread over time.
#include <cstddef>
#include <string>
#include <vector>

#include "core/io/recorder.hpp"
#include "scripts/campaign/campaign.hpp"

namespace cardan {

/// One component of a channel at some times that the rows of the runs have in common; of each time only the runs that reach it and are
/// finite there. Quantiles as those of a Distribution.
struct Band {
  std::string name, unit;                             // "pointing/error.x"; of a channel of one component its path alone
  std::vector<double> t;                              // [s]
  std::vector<std::size_t> runs;                      // how many at each time, at least one
  std::vector<double> least, p05, median, p95, most;  // at each time
  struct Extreme {
    double value = 0.0, t = 0.0;  // t: [s]
    std::size_t run = 0;          // index among all
  };
  Extreme lowest, highest;  // over all times
};

/// What is to be drawn of the runs of a scenario, whose rows lie `period` apart [s]; at most 400 times are looked at, equally spaced from 0
/// to `duration`.
struct BandRequest {
  std::vector<std::string> channels;  // or components of them: "pointing/error", "hinges/panel/angle.x"
  double period = 0.1, duration = 0.0;
};
/// Throws InputError C0208 where the scenario has no such channel.
void expect_channels(const BandRequest& request, const std::vector<Channel>& channels);
/// Of runs that came to their end, from the run.h5 of each. A run without the channel is left out. Throws InputError where one
/// cannot be read (C0702) or is not there.
std::vector<Band> bands_of(const BandRequest& request, const std::vector<CampaignRun>& runs);

}  // namespace cardan
