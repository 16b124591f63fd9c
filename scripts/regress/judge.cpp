#include "scripts/regress/judge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>

#include "core/base/units.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/schema.hpp"

namespace cardan {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Value [to] = factor * value [from]. Empty where they do not measure the same.
std::optional<double> conversion(const std::string& from, const std::string& to) {
  if (from == to) return 1.0;
  const auto a = parse_unit(from), b = parse_unit(to);
  if (!a || !b || a->dimension != b->dimension) return {};
  return a->factor / b->factor;
}

class Judge {
 public:
  Judge(const Golden& golden, const std::filesystem::path& folder) : golden_(golden), folder_(folder) {}

  std::vector<ClaimRow> rows() {
    if (golden_.prints) attempt(kPrinted, [&] { of_prints(*golden_.prints); });
    if (golden_.script.empty())
      attempt("summary.json", [&] {
        summary_ = Json::parse(read_text_file((folder_ / "summary.json").string()));
        for (const char* part : {"checks", "figures", "ledger"}) summary_.at(part);
        of_checks();
        of_figures();
        of_ledger();
      });
    if (!golden_.channels.empty()) attempt("run.h5", [&] { of_channels(); });
    return std::move(rows_);
  }

 private:
  ClaimRow& add(std::string kind, std::string name) {
    rows_.push_back({});
    rows_.back().kind = std::move(kind);
    rows_.back().name = std::move(name);
    return rows_.back();
  }
  void add_problem(std::string kind, std::string name, Diagnostic what) {
    rows_.push_back(failed_row(std::move(kind), std::move(name), std::move(what)));
  }

  /// What cannot be read is a failed row.
  void attempt(const char* file, const std::function<void()>& work) {
    try {
      work();
    } catch (const InputError& e) {
      add_problem("run", file, e.diagnostics().front());
    } catch (const std::exception& e) {
      add_problem("run", file, {Code::bad_result_file, {"", {(folder_ / file).string()}}, "what a run writes", e.what()});
    }
  }

  static double number(const Json& value) { return value.is_number() ? value.get<double>() : kNaN; }

  void of_checks() {
    for (const Json& check : summary_["checks"]) {
      ClaimRow& row = add("check", check.value("name", ""));
      row.unit = check.value("unit", "");
      const double value = number(check["value"]);
      row.note = fmt::format("{:.9g}{}, {}", value, row.unit == "1" ? "" : " " + row.unit, check.value("detail", ""));
      row.pass = check.value("verdict", "") == "pass" && std::isfinite(value);
    }
    for (const auto& [at, name] : golden_.checks)
      if (std::ranges::none_of(rows_, [&, name = name](const ClaimRow& row) { return row.kind == "check" && row.name == name; })) {
        std::vector<std::string> legal;
        for (const ClaimRow& row : rows_) legal.push_back(row.name);
        add_problem("check", name,
                    {Code::unknown_name, at, "a check of the scenario" + (legal.empty() ? "" : ": " + one_of(legal)), in_quotes(name),
                     did_you_mean(name, legal)});
      }
  }

  /// A number of a text, or what stands between two of them: blanks and tabs count as one blank, those at the start of a line as none.
  struct Piece {
    std::size_t at;  // in the text
    std::string_view words;
    std::optional<double> number;
  };
  /// The piece that begins at i, and i behind it; nothing at the end of the text.
  static std::optional<Piece> next_piece(std::string_view text, std::size_t& i) {
    std::size_t at = i;
    i = std::min(text.find_first_not_of(" \t", at), text.size());
    if (i > at && at > 0 && text[at - 1] != '\n') return Piece{at, " ", {}};
    if (i == text.size()) return {};
    const auto is_number = [&](std::size_t k) {
      k += text[k] == '-' || text[k] == '+';
      return k < text.size() && text[k] >= '0' && text[k] <= '9';
    };
    at = i;
    if (is_number(at)) {
      double number = 0.0;
      const auto [after, error] = std::from_chars(text.data() + at + (text[at] == '+'), text.data() + text.size(), number);
      i = static_cast<std::size_t>(after - text.data());
      if (error == std::errc{}) return Piece{at, {}, number};  // 1e999 is a word
    } else {
      ++i;
      while (text[at] != '\n' && i < text.size() && std::string_view(" \t\n").find(text[i]) == std::string_view::npos && !is_number(i)) ++i;
    }
    return Piece{at, text.substr(at, i - at), {}};
  }

  void of_prints(const GoldenPrint& wanted) {
    const std::string printed = read_text_file((folder_ / kPrinted).string());
    Difference worst{.t = kNaN};
    int numbers = 0;
    for (std::size_t i = 0, j = 0;;) {
      const auto is = next_piece(printed, i), should_be = next_piece(wanted.text, j);
      if (!is && !should_be) break;
      if (!is || !should_be || is->words != should_be->words || is->number.has_value() != should_be->number.has_value()) {
        const auto line_of = [](const std::string& text, const std::optional<Piece>& piece) {
          if (!piece) return std::string("the end of the text");
          const std::size_t begin = piece->at == 0 ? 0 : text.rfind('\n', piece->at - 1) + 1;  // npos + 1 = 0
          return in_quotes(text.substr(begin, text.find('\n', begin) - begin));
        };
        return add_problem("prints", "what it prints",
                           {Code::wrong_type, wanted.at, line_of(wanted.text, should_be), line_of(printed, is),
                            "numbers may differ within the tolerance, words may not"});
      }
      if (!is->number) continue;
      const double a = *is->number + 0.0, b = *should_be->number + 0.0;  // + 0: a zero may be -0
      const Difference one = worst_difference({&kNaN, 1}, {&a, 1}, {&b, 1}, std::abs(b), wanted.tolerance, wanted.agreement);
      const bool pass = worst.pass && one.pass;
      if (++numbers == 1 || one.share() > worst.share()) worst = one;
      worst.pass = pass;
    }
    claimed(add("prints", fmt::format("{} numbers that it prints", numbers)), wanted, "1", worst);
  }

  void of_figures() {
    for (const GoldenFigure& f : golden_.figures) {
      const Json* found = nullptr;
      std::vector<std::string> legal;
      for (const char* list : {"figures", "checks"})
        for (const Json& one : summary_[list]) {
          legal.push_back(one.value("name", ""));
          if (!found && legal.back() == f.name) found = &one;
        }
      if (!found) {
        add_problem("figure", f.name,
                    {Code::unknown_name, f.at, "a figure or a check of the scenario" + (legal.empty() ? "" : ": " + one_of(legal)),
                     in_quotes(f.name), did_you_mean(f.name, legal)});
        continue;
      }
      const std::string unit = found->value("unit", "1");
      const auto factor = conversion(unit, f.unit);
      if (!factor) {
        add_problem("figure", f.name,
                    {Code::wrong_unit, f.at, fmt::format("a unit of what the scenario gives in {}", unit), in_quotes(f.unit)});
        continue;
      }
      const std::vector<double> t{kNaN}, is{number((*found)["value"]) * *factor}, reference{f.value};
      claimed(add("figure", f.name), f, f.unit, worst_difference(t, is, reference, std::abs(f.value), f.tolerance, f.agreement));
    }
  }

  void of_ledger() {
    const Json& ledger = summary_["ledger"];
    if (ledger.is_null()) {
      if (golden_.ledger)
        add_problem("ledger", "balances", {Code::out_of_range, golden_.ledger->at, "balances of the run", "none: mission.ledger is false"});
      return;
    }
    if (!golden_.ledger) {
      ClaimRow& row = add("ledger", "balances");
      row.why = "what the errors of the steps explain";
      row.pass = ledger.value("verdict", "") == "pass";
      if (!row.pass) row.problem = Diagnostic{.code = Code::ledger_residual};
      row.note = fmt::format("linear momentum {}, angular momentum {}, energy {}", ledger["linear_momentum"].dump(),
                             ledger["angular_momentum"].dump(), ledger["energy"].dump());
      if (const Json& undecided = ledger.value("undecided", Json::array()); !undecided.empty())
        row.note += fmt::format("; no verdict on {}", fmt::join(undecided.get<std::vector<std::string>>(), ", "));
      return;
    }
    for (const auto& [name, bound] : {std::pair{"linear_momentum", golden_.ledger->linear_momentum},
                                      {"angular_momentum", golden_.ledger->angular_momentum},
                                      {"energy", golden_.ledger->energy}}) {
      if (!bound) continue;
      ClaimRow& row = add("ledger", name);
      row.why = golden_.ledger->why;
      row.unit = "1";
      const double is = number(ledger[name]);
      row.worst = Difference{std::abs(is), *bound, kNaN, is, 0.0, std::abs(is) <= *bound};
      row.pass = row.worst->pass;
    }
  }

  static void claimed(ClaimRow& row, const Claim& claim, const std::string& unit, const Difference& worst) {
    row.unit = unit;
    row.agreement = name_of(claim.agreement);
    row.why = claim.why;
    row.worst = worst;
    row.pass = worst.pass;
  }

  void of_channels() {
    const std::string file = (folder_ / "run.h5").string();
    std::vector<std::string> all;
    run_ = read_run_columns(file, [&](const std::string&) { return true; });
    for (const Column& c : run_.columns) all.push_back(c.path);
    for (const GoldenChannel& g : golden_.channels) {
      const Column* column = run_.find(g.channel);
      if (column)
        of_channel(g, *column);
      else
        add_problem("channel", g.channel,
                    {Code::unknown_name, g.at, "a channel of the run: " + one_of(all), in_quotes(g.channel), did_you_mean(g.channel, all)});
    }
  }

  void of_channel(const GoldenChannel& g, const Column& column) {
    const std::vector<std::string>& names = g.components.empty() ? column.components : g.components;
    if (g.width != names.size())
      return add_problem(
          "channel", g.channel,
          {Code::wrong_type, g.at, fmt::format("a reference of {} numbers, as the channel has components: {}", names.size(), one_of(names)),
           fmt::format("{}", g.width)});
    if (!g.named.empty() && g.named != column.components)
      return add_problem(
          "channel", g.channel,
          {Code::wrong_type, g.at, fmt::format("a reference of {}, as the channel has them", fmt::join(column.components, ", ")),
           fmt::format("{}", fmt::join(g.named, ", ")), "`components` chooses them by name"});
    std::vector<std::size_t> rows;  // of the run
    std::vector<double> times;
    for (std::size_t i = 0; i < run_.times.size(); ++i)
      if (run_.times[i] >= g.from - 1e-9 && run_.times[i] <= g.to + 1e-9) rows.push_back(i), times.push_back(run_.times[i]);
    if (rows.empty())
      return add_problem("channel", g.channel, {Code::out_of_range, g.at, "rows of the run between `from` and `to`", "none"});
    if (g.kind == GoldenChannel::Kind::final) rows = {rows.back()}, times = {times.back()};
    std::vector<std::size_t> of_reference(rows.size(), 0);
    if (g.kind == GoldenChannel::Kind::rows) {
      const CommonRows common = common_rows(times, g.times);
      for (std::size_t j = 0, k = 0; j < g.times.size(); ++j) {
        if (k < common.second.size() && common.second[k] == j) {
          ++k;
          continue;
        }
        if (g.times[j] < g.from || g.times[j] > g.to) continue;
        const auto next = std::ranges::lower_bound(times, g.times[j]);
        return add_problem(
            "channel", g.channel,
            {Code::out_of_range, g.at, "a row of the run at each time of the reference", fmt::format("none at t = {:.12g} s", g.times[j]),
             next == times.end() ? fmt::format("the run ends at t = {:.12g} s", times.back())
                                 : fmt::format("the next is at t = {:.12g} s: `output` of the mission", *next)});
      }
      std::vector<std::size_t> kept;
      for (const std::size_t i : common.first) kept.push_back(rows[i]);
      rows = kept;
      of_reference = common.second;
      if (rows.empty())
        return add_problem("channel", g.channel, {Code::out_of_range, g.at, "a time of the reference between `from` and `to`", "none"});
    }
    times.clear();
    for (const std::size_t i : rows) times.push_back(run_.times[i]);

    const auto unit_of = [&](std::size_t k) { return g.units.empty() ? g.unit : g.units[k]; };
    std::vector<double> scales(names.size(), 0.0);  // Tolerance: largest magnitude over all components of the same unit
    for (std::size_t k = 0; k < names.size(); ++k)
      for (std::size_t other = 0; other < names.size(); ++other)
        if (unit_of(other) == unit_of(k))
          for (const std::size_t j : of_reference) scales[k] = std::max(scales[k], std::abs(g.values[j * g.width + other]));

    for (std::size_t k = 0; k < names.size(); ++k) {
      const bool one = column.components == std::vector{names[k]};
      const std::string title = !one ? g.channel + " " + names[k] : g.channel;
      const auto found = std::ranges::find(column.components, names[k]);
      if (found == column.components.end()) {
        add_problem("channel", title,
                    {Code::unknown_name, g.at, "a component of " + g.channel + ": " + one_of(column.components), in_quotes(names[k]),
                     did_you_mean(names[k], column.components)});
        continue;
      }
      const auto index = static_cast<std::size_t>(found - column.components.begin());
      const auto factor = conversion(column.units[index], unit_of(k));
      if (!factor) {
        add_problem("channel", title,
                    {Code::wrong_unit, g.at, fmt::format("a reference in a unit of the channel's, which is in {}", column.units[index]),
                     in_quotes(unit_of(k))});
        continue;
      }
      std::vector<double> is, reference;
      for (std::size_t i = 0; i < rows.size(); ++i) {
        is.push_back(column.values[rows[i] * column.components.size() + index] * *factor);
        reference.push_back(g.values[of_reference[i] * g.width + k]);
      }
      if (g.kind == GoldenChannel::Kind::statistics) {
        if (static_cast<double>(is.size()) < g.independent) {
          add_problem(
              "channel", title,
              {Code::out_of_range, g.at, fmt::format("at least {:g} rows, of which as many are said to be independent", g.independent),
               fmt::format("{}", is.size())});
          continue;
        }
        const auto deviation = g.deviations.empty() ? std::optional<double>{} : g.deviations[k];
        const double tests = static_cast<double>(names.size());  // all of them pass with the confidence stated
        const Statistics both = compare_statistics(is, g.values[k], deviation, g.independent, 1.0 - (1.0 - g.confidence) / tests);
        claimed(add("channel", title + " (mean)"), g, unit_of(k), both.mean);
        if (both.deviation) claimed(add("channel", title + " (deviation)"), g, unit_of(k), *both.deviation);
        continue;
      }
      ClaimRow& row = add("channel", title);
      claimed(row, g, unit_of(k), worst_difference(times, is, reference, scales[k], g.tolerance, g.agreement));
      row.t = times, row.is = std::move(is), row.reference = std::move(reference);
      if (!row.pass && g.agreement == Agreement::same_bits && g.compared_sweeps != run_.sweeps && !g.compared_sweeps.empty())
        row.problem = Diagnostic{Code::other_program, g.at, "the instruction set of the reference: " + g.compared_sweeps, run_.sweeps,
                                 "`kernels: " + g.compared_sweeps + "` in the golden file, where the processor has it"};
    }
  }

  const Golden& golden_;
  std::filesystem::path folder_;
  std::vector<ClaimRow> rows_;
  Json summary_;
  RunColumns run_;
};

}  // namespace

bool CaseResult::pass() const {
  return std::ranges::all_of(rows, [](const ClaimRow& row) { return row.pass; }) && !rows.empty();
}

const ClaimRow* CaseResult::worst() const {
  const ClaimRow* out = nullptr;
  for (const ClaimRow& row : rows) {
    if (!row.pass) return &row;
    if (row.worst && (!out || row.worst->share() > out->worst->share())) out = &row;
  }
  return out;
}

ClaimRow failed_row(std::string kind, std::string name, Diagnostic problem) {
  ClaimRow row;
  row.kind = std::move(kind);
  row.name = std::move(name);
  row.problem = std::move(problem);
  row.pass = false;
  return row;
}

std::vector<ClaimRow> rows_of(const std::vector<Diagnostic>& faults) {
  std::vector<ClaimRow> rows;
  for (const Diagnostic& d : faults) rows.push_back(failed_row("golden", "golden file", d));
  return rows;
}

std::vector<ClaimRow> judge(const Golden& golden, const std::filesystem::path& folder, const RunEnding& ending) {
  ClaimRow run;
  run.kind = "run";
  run.name = "ends as planned";
  run.pass = ending.as_planned() && (golden.script.empty() || ending.exit_code == 0);  // 1 of a script: an assertion that failed
  std::vector<ClaimRow> rows;
  if (run.pass) rows = Judge(golden, folder).rows();
  rows.insert(rows.begin(), std::move(run));
  return rows;
}

std::string share_text(const Difference& d) {
  const double share = d.share();
  if (std::isnan(d.difference)) return "not a number";
  if (std::isinf(share)) return "differs";
  return share < 1e-3 && share > 0.0 ? fmt::format("{:.1e} %", 100.0 * share) : fmt::format("{:.3g} %", 100.0 * share);
}

std::string difference_text(const ClaimRow& row) {
  if (!row.worst) return row.note.empty() && !row.pass ? "failed" : row.note;
  const Difference& d = *row.worst;
  const std::string unit = row.unit.empty() || row.unit == "1" ? "" : " " + row.unit;
  const std::string when = std::isnan(d.t) ? "" : fmt::format(" at t = {:.9g} s", d.t);
  if (row.kind == "ledger") return fmt::format("{:.3g}, limit {:.3g}", d.is, d.limit);
  if (std::isnan(d.difference)) return fmt::format("{} in place of {}{}{}: NaN equals nothing", d.is, d.reference, unit, when);
  return fmt::format("off by {:.3g}{}, limit {:.3g}{}{} ({:.12g} in place of {:.12g})", d.difference, unit, d.limit, unit, when, d.is,
                     d.reference);
}

}  // namespace cardan
