#include "scripts/regress/tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/utf8.hpp"

namespace cardan {
namespace {

Json to_json(const Difference& d) {
  return {{"difference", d.difference}, {"limit", d.limit}, {"share", d.share()}, {"t", d.t}, {"is", d.is}, {"reference", d.reference}};
}

}  // namespace

std::string found_text(const ClaimRow& row) {
  std::string text = difference_text(row);
  if (row.problem) {
    const Diagnostic& d = *row.problem;
    const std::string place = place_text(d.at.mark.file, d.at.mark.line, d.at.key_path);
    text = fmt::format("{}{}: {}", text.empty() || text == "failed" ? "" : text + "; ", number_of(d.code), title_of(d.code));
    if (!d.expected.empty()) text += ", expected " + d.expected;
    if (!d.got.empty()) text += ", got " + d.got;
    if (!d.hint.empty()) text += "; " + d.hint;
    if (!place.empty()) text += " (" + place + ")";
  }
  return text;
}

std::string place_text(const std::string& file, int line, const std::string& key_path) {
  std::string place = file;
  if (!file.empty() && line > 0) place += fmt::format(":{}", line);
  if (!key_path.empty()) place += (place.empty() ? "" : ", ") + key_path;
  return place;
}

std::string ending_text(const CaseResult& r) {
  std::string text = r.ending.text;
  for (const std::string& complaint : r.ending.complaints) text += (text.empty() ? "" : "\n") + complaint;
  return text;
}

std::string line_of(const CaseResult& r, std::size_t width) {
  const ClaimRow* worst = r.worst();
  std::string what;
  if (r.pass() && worst)
    what = fmt::format("{} of the limit: {}", share_text(*worst->worst), worst->name);
  else if (worst && worst->kind == "run" && !worst->problem)
    what = r.ending.text.substr(0, r.ending.text.find('\n'));
  else if (worst)
    what = worst->name + ": " + found_text(*worst);
  return fmt::format("{:<6}{:<{}}  {:>7.2f} s  {}", r.pass() ? "pass" : "FAIL", r.name, width, r.ending.wall_s, what);
}

std::string faults_of(const CaseResult& r) {
  std::string out;
  for (const ClaimRow& row : r.rows) {
    if (row.pass) continue;
    out += fmt::format("  {}: {}\n", row.name, row.kind == "run" && !row.problem ? ending_text(r) : found_text(row));
    if (!row.why.empty() && row.worst) out += fmt::format("    why this limit: {}\n", row.why);
  }
  return out.empty() ? out : fmt::format("\n{} (truth: {})\n{}", r.name, r.golden->truth, out);
}

std::string junit_xml(const std::vector<CaseResult>& results) {
  std::string out = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  std::size_t tests = 0, failures = 0;
  std::string suites;
  for (const CaseResult& r : results) {
    std::size_t failed = 0;
    std::string cases;
    std::map<std::string, int> times;
    for (const ClaimRow& row : r.rows) {
      std::string name = row.kind + ": " + row.name;  // what is claimed twice is two tests: of one name forges show one alone
      if (const int n = ++times[name]; n > 1) name += fmt::format(" ({})", n);
      cases += fmt::format("    <testcase classname=\"{}\" name=\"{}\" time=\"{:.3f}\"", xml_text(r.name), xml_text(name),
                           row.kind == "run" ? r.ending.wall_s : 0.0);
      if (row.pass) {
        cases += "/>\n";
        continue;
      }
      ++failed;
      const std::string text = row.kind == "run" && !row.problem ? ending_text(r) : found_text(row);
      cases += fmt::format(">\n      <failure message=\"{}\">{}</failure>\n    </testcase>\n", xml_text(text.substr(0, text.find('\n'))),
                           xml_text(text + (row.why.empty() ? "" : "\nwhy this limit: " + row.why)));
    }
    suites += fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"0\" time=\"{:.3f}\">\n{}  </testsuite>\n",
                          xml_text(r.name), r.rows.size(), failed, r.ending.wall_s, cases);
    tests += r.rows.size(), failures += failed;
  }
  return out + fmt::format("<testsuites name=\"cardan regress\" tests=\"{}\" failures=\"{}\">\n{}</testsuites>\n", tests, failures, suites);
}

Json regress_json(const std::vector<CaseResult>& results) {
  Json all = Json::array();
  bool pass = true;
  for (const CaseResult& r : results) {
    constexpr const char* kHow[] = {"ended", "crashed", "out of time", "out of memory", "not run"};
    Json rows = Json::array();
    for (const ClaimRow& row : r.rows) {
      Json one = {{"kind", row.kind}, {"name", row.name},       {"verdict", row.pass ? "pass" : "fail"},
                  {"unit", row.unit}, {"class", row.agreement}, {"why", row.why}};
      if (row.worst) one["worst"] = to_json(*row.worst);
      if (row.problem) one["problem"] = to_json(*row.problem);
      one["text"] = found_text(row);
      rows.push_back(std::move(one));
    }
    pass = pass && r.pass();
    all.push_back({{"name", r.name},
                   {"golden", r.golden->file.string()},
                   {"truth", r.golden->truth},
                   {"verdict", r.pass() ? "pass" : "fail"},
                   {"results", r.folder.string()},
                   {"ended", kHow[static_cast<int>(r.ending.how)]},
                   {"exit_code", r.ending.exit_code},
                   {"text", ending_text(r)},
                   {"wall_s", r.ending.wall_s},
                   {"cpu_s", r.ending.cpu_s},
                   {"rows", std::move(rows)}});
  }
  return {{"cardan_regress", 1}, {"verdict", pass ? "pass" : "fail"}, {"scenarios", std::move(all)}};
}

std::vector<std::string> structure_of(const RunDifference& d, const std::string& first, const std::string& second) {
  std::vector<std::string> out;
  if (d.rows == 0)
    out.push_back(fmt::format("no time that both have: {} rows of {}, {} rows of {}", d.rows_of_first, first, d.rows_of_second, second));
  else if (!d.same_times())
    out.push_back(fmt::format("the times differ: {} rows of {}, {} rows of {}; compared at the {} that both have", d.rows_of_first, first,
                              d.rows_of_second, second, d.rows));
  for (const std::string& path : d.only_in_first) out.push_back(fmt::format("{}: only in {}", path, first));
  for (const std::string& path : d.only_in_second) out.push_back(fmt::format("{}: only in {}", path, second));
  for (const std::string& misfit : d.misfits) out.push_back(misfit);
  for (const ComponentDifference& c : d.components)
    if (!c.not_finite.empty())
      out.push_back(fmt::format("{} {}: not finite, and the same in both, at {} of {} times, first at t = {:.9g} s", c.channel, c.component,
                                c.not_finite.size(), d.rows, c.not_finite.front()));
  return out;
}

std::string difference_table(const RunDifference& d, const std::string& first, const std::string& second) {
  std::string out;
  for (const std::string& line : structure_of(d, first, second)) out += line + "\n";
  std::vector<const ComponentDifference*> worst;
  for (const ComponentDifference& c : d.components)
    if (!(c.worst.difference == 0.0) || !c.worst.pass) worst.push_back(&c);
  std::stable_partition(worst.begin(), worst.end(), [](const ComponentDifference* c) { return !c->worst.pass; });
  if (d.rows == 0) return out;
  out += fmt::format("{} of {} numbers per row differ at some of {} times\n", worst.size(), d.components.size(), d.rows);
  if (worst.empty()) return out;
  out += fmt::format("\n{:<6}{:<40}{:>12} {:<8}{:>12}{:>14}{:>24}{:>24}\n", "", "channel", "worst", "", "limit", "at t [s]",
                     first.size() > 22 ? "first" : first, second.size() > 22 ? "second" : second);
  for (const ComponentDifference* c : worst)
    out += fmt::format("{:<6}{:<40}{:>12.3g} {:<8}{:>12.3g}{:>14.9g}{:>24.15g}{:>24.15g}\n", c->worst.pass ? "pass" : "FAIL",
                       c->channel + " " + c->component, c->worst.difference, c->unit == "1" ? "" : c->unit, c->worst.limit, c->worst.t,
                       c->worst.is, c->worst.reference);
  return out;
}

Json difference_json(const RunDifference& d, const std::string& first, const std::string& second, bool pass) {
  Json components = Json::array();
  for (const ComponentDifference& c : d.components) {
    Json one = {{"channel", c.channel}, {"component", c.component}, {"unit", c.unit}, {"verdict", c.worst.pass ? "pass" : "fail"}};
    one.update(to_json(c.worst));
    components.push_back(std::move(one));
  }
  return {{"cardan_diff", 1},
          {"verdict", pass ? "pass" : "fail"},
          {"first", first},
          {"second", second},
          {"rows", d.rows},
          {"rows_of_first", d.rows_of_first},
          {"rows_of_second", d.rows_of_second},
          {"structure", structure_of(d, first, second)},
          {"components", std::move(components)}};
}

}  // namespace cardan
