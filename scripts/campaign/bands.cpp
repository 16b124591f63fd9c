#include "scripts/campaign/bands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/io/compare_runs.hpp"
#include "core/io/run_columns.hpp"
#include "scripts/campaign/statistics.hpp"

namespace cardan {
namespace {

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

/// What the runs have of each component at some times.
class Collection {
 public:
  explicit Collection(std::vector<double> times) : times_(std::move(times)) {}

  void take(std::size_t run, const std::string& file, const std::vector<std::string>& names) {
    const RunColumns of = read_run_columns(file, [&](const std::string& channel) {
      return std::ranges::any_of(names, [&](const std::string& name) { return may_mean(name, channel); });
    });
    const CommonRows rows = common_rows(times_, of.times);
    std::vector<std::string> paths;
    for (const Column& c : of.columns) paths.push_back(c.path);
    const auto components_of = [&](const std::string& path) { return of.find(path)->components; };
    std::set<std::string> taken;
    for (const std::string& name : names) {
      if (std::ranges::none_of(paths, [&](const std::string& path) { return may_mean(name, path); })) continue;
      const ChannelPart part = part_of_channel(name, paths, components_of, of.file);
      const Column& column = *of.find(part.channel);
      const std::size_t width = column.components.size();
      for (const std::size_t k : part.components) {
        const std::string whole = width == 1 ? column.path : fmt::format("{}.{}", column.path, column.components[k]);
        if (!taken.insert(whole).second) continue;
        Component& to = component(whole, column.units[k]);
        for (std::size_t i = 0; i < rows.first.size(); ++i)
          if (const double value = column.values[rows.second[i] * width + k]; std::isfinite(value))
            to.values[rows.first[i]].push_back(value), to.runs[rows.first[i]].push_back(run);
      }
    }
  }

  std::vector<Band> bands() const {
    std::vector<Band> out;
    for (const Component& one : all_)
      if (Band band = band_of(one); !band.t.empty()) out.push_back(std::move(band));
    return out;
  }

 private:
  struct Component {
    std::string name, unit;
    std::vector<std::vector<double>> values;     // at each time,
    std::vector<std::vector<std::size_t>> runs;  // and the runs they are of
  };

  Component& component(const std::string& name, const std::string& unit) {
    const auto there = std::ranges::find(all_, name, &Component::name);
    if (there != all_.end()) return *there;
    const std::size_t n = times_.size();
    return all_.emplace_back(Component{name, unit, std::vector<std::vector<double>>(n), std::vector<std::vector<std::size_t>>(n)});
  }

  Band band_of(const Component& all) const {
    Band band;
    band.name = all.name, band.unit = all.unit;
    for (std::size_t i = 0; i < times_.size(); ++i) {
      if (all.values[i].empty()) continue;
      const Distribution d = distribution_of(all.values[i]);
      const bool first = band.t.empty();
      if (first || d.least < band.lowest.value) band.lowest = {d.least, times_[i], all.runs[i][d.at_least]};
      if (first || d.most > band.highest.value) band.highest = {d.most, times_[i], all.runs[i][d.at_most]};
      band.t.push_back(times_[i]), band.runs.push_back(d.n);
      band.least.push_back(d.least), band.p05.push_back(d.p05), band.median.push_back(d.median), band.p95.push_back(d.p95);
      band.most.push_back(d.most);
    }
    return band;
  }

  std::vector<double> times_;  // [s]
  std::vector<Component> all_;
};

}  // namespace

void expect_channels(const BandRequest& request, const std::vector<Channel>& channels) {
  std::vector<std::string> paths;
  for (const Channel& c : channels) paths.push_back(c.path);
  const auto components_of = [&](const std::string& path) { return std::ranges::find(channels, path, &Channel::path)->components; };
  for (const std::string& name : request.channels) part_of_channel(name, paths, components_of, "");
}

std::vector<Band> bands_of(const BandRequest& request, const std::vector<CampaignRun>& runs) {
  if (request.channels.empty()) return {};
  Collection all(times_of(request));
  for (std::size_t run = 0; run < runs.size(); ++run)
    if (runs[run].done && runs[run].measured()) all.take(run, (runs[run].folder / "run.h5").string(), request.channels);
  return all.bands();
}

}  // namespace cardan
