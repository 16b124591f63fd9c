#include "scripts/campaign/tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

namespace cardan {
namespace {

constexpr std::size_t kBins = 24, kDrivers = 3;

const char* name_of(Quantity::Kind kind) {
  constexpr const char* kNames[] = {"drawn", "check", "figure"};
  return kNames[static_cast<int>(kind)];
}

std::string with_unit(const std::string& name, const std::string& unit) { return unit == "1" ? name : fmt::format("{} [{}]", name, unit); }

/// What became of it, in one or two words.
std::string verdict_of(const CampaignRun& run) {
  if (!run.done) return run.ending.how == RunEnding::How::not_run ? "not run" : "not done";
  return run.verdict.empty() ? "no result" : run.verdict;
}

/// Why it did not pass; empty where it did.
std::string reason_of(const CampaignRun& run) {
  if (run.done && run.measured()) {
    std::string text;
    for (const Check& c : run.checks)
      if (!c.pass)
        text += fmt::format("{}{}: {:.6g}{}, {}", text.empty() ? "" : "; ", c.name, c.value, c.unit == "1" ? "" : " " + c.unit, c.detail);
    return text;
  }
  if (!run.ending.complaints.empty()) return run.ending.complaints.front();
  return run.ended_by.empty() ? run.ending.text : run.ended_by;
}

/// Null: none.
Json bound(double x) { return std::isfinite(x) ? Json(x) : Json(); }

std::string in_csv(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

struct Counts {
  std::size_t run = 0, passed = 0, failed = 0, others = 0;
};
Counts counts_of(const std::vector<CampaignRun>& runs) {
  Counts out;
  for (const CampaignRun& run : runs) {
    if (run.ending.how == RunEnding::How::not_run) continue;
    ++out.run;
    ++(run.verdict == "passed" ? out.passed : run.verdict == "failed" ? out.failed : out.others);
  }
  return out;
}

}  // namespace

std::vector<double> Quantity::in(const std::vector<std::size_t>& some) const {
  std::vector<double> out;
  for (std::size_t k = 0; k < runs.size() && out.size() < some.size(); ++k)
    if (runs[k] == some[out.size()]) out.push_back(values[k]);
  return out.size() == some.size() ? out : std::vector<double>();
}

std::vector<Quantity> quantities_of(const std::vector<CampaignRun>& runs) {
  std::vector<Quantity> out;
  std::map<std::pair<Quantity::Kind, std::string>, std::size_t> places;
  const auto take = [&](Quantity::Kind kind, std::size_t run, const std::string& name, const std::string& unit, double value) -> Quantity& {
    const auto [place, is_new] = places.try_emplace({kind, name}, out.size());
    if (is_new) out.push_back({.kind = kind, .name = name, .unit = unit, .limit = {}, .values = {}, .runs = {}});
    Quantity& q = out[place->second];
    q.values.push_back(value), q.runs.push_back(run);
    return q;
  };
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (!runs[i].done) continue;
    for (const Figure& f : runs[i].drawn) take(Quantity::Kind::drawn, i, f.name, f.unit, f.value);
    if (!runs[i].measured()) continue;
    for (const Check& c : runs[i].checks) {
      Quantity& q = take(Quantity::Kind::check, i, c.name, c.unit, c.value);
      q.limit = c.detail, q.at_least = c.least, q.at_most = c.most, q.failed += !c.pass;
    }
    for (const Figure& f : runs[i].figures) take(Quantity::Kind::figure, i, f.name, f.unit, f.value);
  }
  std::ranges::stable_sort(out, {}, &Quantity::kind);
  return out;
}

std::vector<std::pair<std::size_t, double>> drivers_of(std::size_t of, const std::vector<Quantity>& all, std::size_t most) {
  std::vector<std::pair<std::size_t, double>> out;
  const auto n = static_cast<double>(all[of].values.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i == of || all[i].kind != Quantity::Kind::drawn || n < 3.0) continue;
    const std::vector<double> x = all[i].in(all[of].runs);
    if (x.empty()) continue;
    const double r = rank_correlation(x, all[of].values);
    if (std::abs(r) > 1.96 / std::sqrt(n - 1.0)) out.emplace_back(i, r);
  }
  std::ranges::stable_sort(out, std::ranges::greater{}, [](const auto& d) { return std::abs(d.second); });
  out.resize(std::min(out.size(), most));
  return out;
}

std::string line_of(const CampaignRun& run) {
  const std::string reason = reason_of(run);
  return fmt::format("{:<10}seed {:<8}{:>8.2f} s{}{}", verdict_of(run), run.seed, run.ending.wall_s, reason.empty() ? "" : "  ",
                     reason.substr(0, reason.find('\n')));
}

std::string campaign_text(const std::vector<CampaignRun>& runs, const std::vector<Quantity>& quantities, const std::vector<Band>& bands) {
  const Counts n = counts_of(runs);
  std::string out;
  const auto section = [&](const char* title, Quantity::Kind kind) {
    bool first = true;
    for (std::size_t i = 0; i < quantities.size(); ++i) {
      const Quantity& q = quantities[i];
      if (q.kind != kind) continue;
      if (first) {
        out += fmt::format("\n{:<44}{:>11}{:>11}{:>11}{:>11}{:>11}{:>11}{:>11}\n", title, "mean", "deviation", "least", "5 %", "median",
                           "95 %", "most");
        first = false;
      }
      const Distribution d = q.distribution();
      out += fmt::format("  {:<42}{:>11.4g}{:>11.3g}{:>11.4g}{:>11.4g}{:>11.4g}{:>11.4g}{:>11.4g}\n", with_unit(q.name, q.unit), d.mean,
                         d.deviation, d.least, d.p05, d.median, d.p95, d.most);
      if (kind == Quantity::Kind::drawn) continue;
      std::string more = fmt::format("least with seed {}, most with seed {}", runs[q.runs[d.at_least]].seed, runs[q.runs[d.at_most]].seed);
      if (kind == Quantity::Kind::check) more = fmt::format("{}: {} of {} failed; {}", q.limit, q.failed, d.n, more);
      for (const auto& [driver, r] : drivers_of(i, quantities, kDrivers)) more += fmt::format("; {} {:+.2f}", quantities[driver].name, r);
      out += "      " + more + "\n";
    }
  };
  section("drawn", Quantity::Kind::drawn);
  section("checks", Quantity::Kind::check);
  section("figures", Quantity::Kind::figure);
  if (!bands.empty()) out += fmt::format("\n{:<44}{:>11}{:>11}{:>11}\n", "over time: at the end", "5 %", "median", "95 %");
  for (const Band& b : bands)
    out += fmt::format(
        "  {:<42}{:>11.4g}{:>11.4g}{:>11.4g}\n      least {:.4g} at {:.4g} s with seed {}, most {:.4g} at {:.4g} s with seed {}\n",
        with_unit(b.name, b.unit), b.p05.back(), b.median.back(), b.p95.back(), b.lowest.value, b.lowest.t, runs[b.lowest.run].seed,
        b.highest.value, b.highest.t, runs[b.highest.run].seed);
  const bool differ = std::ranges::any_of(
      quantities, [](const Quantity& q) { return std::ranges::adjacent_find(q.values, std::not_equal_to()) != q.values.end(); });
  if (n.passed + n.failed > 1 && !quantities.empty() && !differ)
    out +=
        "\nAll runs have the same numbers: nothing in the scenario seems to follow the seed. Parameters with a spread do: "
        "docs/campaigns.md.\n";
  if (n.run > 0) {
    out += fmt::format("\n{} of {} runs passed, {} failed", n.passed, n.run, n.failed);
    if (n.others > 0) out += fmt::format(", {} did not come to their end", n.others);
    out += fmt::format(".\nWith {:g} % confidence {:.4g} % of all runs pass at least, and {:.4g} % {} below the largest number of a row.\n",
                       100.0 * kConfidence, 100.0 * share_at_least(n.passed, n.run, kConfidence),
                       100.0 * share_below_largest(n.passed + n.failed, kConfidence),
                       n.others > 0 ? "of those that come to their end stay" : "stay");
  }
  return out;
}

std::string campaign_csv(const std::vector<CampaignRun>& runs, const std::vector<Quantity>& quantities) {
  std::string out = "seed,verdict,ended_by,simulated [s],wall [s],cpu [s]";
  for (const Quantity& q : quantities) out += "," + in_csv(fmt::format("{} {}", name_of(q.kind), with_unit(q.name, q.unit)));
  out += "\r\n";
  std::vector<std::size_t> next(quantities.size(), 0);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const CampaignRun& run = runs[i];
    out += fmt::format("{},{},{},{},{},{}", run.seed, verdict_of(run), in_csv(run.measured() ? run.ended_by : reason_of(run)),
                       run.simulated_s, run.ending.wall_s, run.cpu_s);
    for (std::size_t k = 0; k < quantities.size(); ++k) {
      const Quantity& q = quantities[k];
      const bool has = next[k] < q.runs.size() && q.runs[next[k]] == i;
      out += has ? fmt::format(",{}", q.values[next[k]++]) : ",";
    }
    out += "\r\n";
  }
  return out;
}

Json campaign_json(const Json& about, const std::vector<CampaignRun>& runs, const std::vector<Quantity>& quantities,
                   const std::vector<Band>& bands) {
  const Counts n = counts_of(runs);
  Json rows = Json::array(), numbers = Json::array();
  for (const CampaignRun& run : runs)
    rows.push_back({{"seed", run.seed},
                    {"verdict", verdict_of(run)},
                    {"why", reason_of(run)},
                    {"ended_by", run.ended_by},
                    {"exit_code", run.ending.exit_code},
                    {"simulated_s", run.simulated_s},
                    {"wall_s", run.ending.wall_s},
                    {"cpu_s", run.cpu_s},
                    {"results", run.folder.string()}});
  for (std::size_t i = 0; i < quantities.size(); ++i) {
    const Quantity& q = quantities[i];
    const Distribution d = q.distribution();
    Json drivers = Json::array();
    if (q.kind != Quantity::Kind::drawn)
      for (const auto& [driver, r] : drivers_of(i, quantities, kDrivers))
        drivers.push_back({{"drawn", quantities[driver].name}, {"rank_correlation", r}});
    Json seeds = Json::array();
    for (const std::size_t run : q.runs) seeds.push_back(runs[run].seed);
    numbers.push_back({{"kind", name_of(q.kind)},
                       {"name", q.name},
                       {"unit", q.unit},
                       {"limit", q.limit},
                       {"bounds", {bound(q.at_least), bound(q.at_most)}},
                       {"failed", q.failed},
                       {"n", d.n},
                       {"mean", d.mean},
                       {"deviation", d.deviation},
                       {"least", {{"value", d.least}, {"seed", runs[q.runs[d.at_least]].seed}}},
                       {"p05", d.p05},
                       {"median", d.median},
                       {"p95", d.p95},
                       {"most", {{"value", d.most}, {"seed", runs[q.runs[d.at_most]].seed}}},
                       {"drivers", std::move(drivers)},
                       {"histogram", histogram(q.values, kBins)},
                       {"seeds", std::move(seeds)},
                       {"values", q.values}});
  }
  Json over_time = Json::array();
  for (const Band& b : bands) {
    const auto extreme = [&](const Band::Extreme& x) { return Json{{"value", x.value}, {"t_s", x.t}, {"seed", runs[x.run].seed}}; };
    over_time.push_back({{"name", b.name},
                         {"unit", b.unit},
                         {"lowest", extreme(b.lowest)},
                         {"highest", extreme(b.highest)},
                         {"t_s", b.t},
                         {"runs", b.runs},
                         {"least", b.least},
                         {"p05", b.p05},
                         {"median", b.median},
                         {"p95", b.p95},
                         {"most", b.most}});
  }
  Json out = {{"cardan_campaign", 1}};
  out.update(about);
  out.update({{"confidence", kConfidence},
              {"runs_done", n.run},
              {"passed", n.passed},
              {"failed", n.failed},
              {"without_end", n.others},
              {"share_that_passes_at_least", n.run > 0 ? share_at_least(n.passed, n.run, kConfidence) : 0.0},
              {"share_below_largest_at_least", share_below_largest(n.passed + n.failed, kConfidence)},
              {"quantities", std::move(numbers)},
              {"bands", std::move(over_time)},
              {"runs", std::move(rows)}});
  return out;
}

}  // namespace cardan
