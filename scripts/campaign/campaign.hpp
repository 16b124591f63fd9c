#pragma once
// Many runs of one scenario that differ by their seed: parameters that chance sets, noise. Each is a process of its own, with its results
// in a folder of its own, so that a campaign goes on from where it was stopped and each of its runs can be repeated alone.
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/io/summary.hpp"
#include "scripts/regress/judge.hpp"

namespace cardan {

/// What one run came to, as its summary.json tells.
struct CampaignRun {
  std::uint64_t seed = 0;
  std::filesystem::path folder;
  bool done = false;       // else it is still to be run
  bool was_there = false;  // from a campaign of before
  RunEnding ending;        // of the process
  std::string verdict;     // "passed", "failed", "aborted"; empty where it left no summary
  std::string ended_by;
  double simulated_s = 0.0, cpu_s = 0.0;  // [s]
  std::vector<Figure> drawn, figures;     // in SI, and in the units of the script
  std::vector<Check> checks;
  /// To its end, so that its checks and figures are worth something.
  bool measured() const { return verdict == "passed" || verdict == "failed"; }
};

struct Campaign {
  std::string program;             // this program, by its path
  std::vector<std::string> words;  // of `cardan run`, but for its seed and folder: the scenario, --set and so on
  std::string input;               // SHA-256 of all that a run depends on but its seed; runs of another one are made anew
  std::filesystem::path out;       // a folder for each run is in it: "seed_7"
  std::uint64_t first = 1, runs = 1;
  std::uint64_t shard = 1, shards = 1;           // of the runs every `shards`-th is made, from the `shard`-th on
  int jobs = 1;                                  // side by side
  bool lean = false;                             // no run.h5 of runs that passed
  bool read_later = false;                       // run.h5 of all is wanted: one whose is gone is made anew
  std::function<void(const CampaignRun&)> told;  // called when one has been run, in any order
  std::function<bool()> stop;                    // true: start no more, end those that run
};

/// Runs what is not there yet; all runs of the campaign in the order of their seeds, those of other shards as they are found. A run that
/// was ended from outside is not done.
std::vector<CampaignRun> run_campaign(const Campaign& campaign);

}  // namespace cardan
