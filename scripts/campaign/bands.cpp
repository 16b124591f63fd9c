#include "scripts/campaign/bands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/io/compare_runs.hpp"
#include "core/io/run_columns.hpp"
#include "scripts/campaign/statistics.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostTimes = 400;

std::vector<double> times_of(const BandRequest& request) {
  const auto rows = static_cast<std::size_t>(std::floor(request.duration / request.period + 1e-9)) + 1;
  const std::size_t stride = (rows + kMostTimes - 1) / kMostTimes;
  std::vector<double> out;
  for (std::size_t i = 0; i < rows; i += stride) out.push_back(static_cast<double>(i) * request.period);
  return out;
}

/// The channel itself, or what stands before the last dot of the name.
bool may_mean(const std::string& name, const std::string& channel) { return name == channel || name.substr(0, name.rfind('.')) == channel; }

/// What the runs have of one component: a list for each time, of values and of the runs they are of.
struct Collected {
  std::string name, unit;
  std::vector<std::vector<double>> values;
  std::vector<std::vector<std::size_t>> runs;
};

Band band_of(const Collected& all, const std::vector<double>& times) {
  Band band;
  band.name = all.name, band.unit = all.unit;
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (all.values[i].empty()) continue;
    const Distribution d = distribution_of(all.values[i]);
    const bool first = band.t.empty();
    if (first || d.least < band.lowest.value) band.lowest = {d.least, times[i], all.runs[i][d.at_least]};
    if (first || d.most > band.highest.value) band.highest = {d.most, times[i], all.runs[i][d.at_most]};
    band.t.push_back(times[i]), band.runs.push_back(d.n);
    band.least.push_back(d.least), band.p05.push_back(d.p05), band.median.push_back(d.median), band.p95.push_back(d.p95);
    band.most.push_back(d.most);
  }
  return band;
}

}  // namespace

void expect_channels(const BandRequest& request, const std::vector<Channel>& channels) {
  std::vector<std::string> paths;
  for (const Channel& c : channels) paths.push_back(c.path);
  const auto components_of = [&](const std::string& path) { return std::ranges::find(channels, path, &Channel::path)->components; };
  for (const std::string& name : request.channels) part_of_channel(name, paths, components_of, "");
}

std::vector<Band> bands_of(const BandRequest& request, const std::vector<CampaignRun>& runs) {
  if (request.channels.empty()) return {};
  const std::vector<double> times = times_of(request);
  std::vector<Collected> all;
  std::map<std::string, std::size_t> places;
  for (std::size_t run = 0; run < runs.size(); ++run) {
    const fs::path file = runs[run].folder / "run.h5";
    std::error_code ignored;
    if (!runs[run].done || !runs[run].measured() || !fs::exists(file, ignored)) continue;
    const RunColumns of = read_run_columns(file.string(), [&](const std::string& channel) {
      return std::ranges::any_of(request.channels, [&](const std::string& name) { return may_mean(name, channel); });
    });
    const CommonRows rows = common_rows(times, of.times);
    std::vector<std::string> paths;
    for (const Column& c : of.columns) paths.push_back(c.path);
    std::set<std::string> seen;
    for (const std::string& name : request.channels) {
      if (std::ranges::none_of(paths, [&](const std::string& path) { return may_mean(name, path); })) continue;
      const ChannelPart part = part_of_channel(
          name, paths, [&](const std::string& path) { return of.find(path)->components; }, of.file);
      const Column& column = *of.find(part.channel);
      for (const std::size_t k : part.components) {
        const std::size_t width = column.components.size();
        const std::string whole = width == 1 ? column.path : fmt::format("{}.{}", column.path, column.components[k]);
        if (!seen.insert(whole).second) continue;
        const auto [place, is_new] = places.try_emplace(whole, all.size());
        if (is_new) {
          all.push_back({whole, column.units[k], {}, {}});
          all.back().values.resize(times.size()), all.back().runs.resize(times.size());
        }
        Collected& to = all[place->second];
        for (std::size_t i = 0; i < rows.first.size(); ++i)
          if (const double value = column.values[rows.second[i] * width + k]; std::isfinite(value)) {
            to.values[rows.first[i]].push_back(value);
            to.runs[rows.first[i]].push_back(run);
          }
      }
    }
  }
  std::vector<Band> out;
  for (const Collected& one : all) out.push_back(band_of(one, times));
  std::erase_if(out, [](const Band& band) { return band.t.empty(); });
  return out;
}

}  // namespace cardan
