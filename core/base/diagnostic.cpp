#include "core/base/diagnostic.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/excerpt.hpp"
#include "core/base/utf8.hpp"

namespace cardan {
namespace {

struct Entry {
  std::string_view number, title;
};
constexpr std::array kEntries = {
#define CARDAN_ERROR(number, name, title) Entry{number, title},
#include "core/base/error_codes.inc"
#undef CARDAN_ERROR
};

const Entry& entry(Code c) { return kEntries[static_cast<std::size_t>(c)]; }

constexpr std::size_t kLongest = 4000;  // [B] of one text that are shown

/// Text of files, scripts and the command line as it may be shown on a terminal: lines of UTF-8 without control characters, cut
/// where it is long.
std::string shown(std::string_view text) {
  std::size_t cut = std::min(text.size(), kLongest);
  while (cut < text.size() && cut > 0 && continues_character(text[cut])) --cut;
  std::string out;
  for (std::size_t from = 0; from <= cut;) {
    const std::size_t to = std::min(text.find('\n', from), cut);
    std::string line(text.substr(from, to - from));
    std::replace(line.begin(), line.end(), '\t', ' ');
    out += (from > 0 ? "\n" : "") + printable(line);
    from = to + 1;
  }
  if (cut < text.size()) out += fmt::format(" ... ({} bytes more)", text.size() - cut);
  return out;
}

void labelled(std::string& out, std::string_view label, std::string_view text) {
  if (text.empty()) return;
  std::string indented;
  for (char ch : shown(text)) {
    indented += ch;
    if (ch == '\n') indented += "            ";
  }
  out += fmt::format("  {:<10}{}\n", fmt::format("{}:", label), indented);
}

/// "  --> scenario.lua:18:3", where there is a place.
std::string place(const SourceMark& m) {
  if (m.file.empty()) return {};
  std::string out = "  --> " + shown(m.file);
  if (m.line > 0) out += fmt::format(":{}", m.line);
  if (m.line > 0 && m.column > 0) out += fmt::format(":{}", m.column);
  return out + '\n';
}

/// Letters to put in, leave out or change; two neighbours that stand the wrong way round are one change.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), last(before), row(before);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before.swap(last), last.swap(row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] == b[j - 1] ? 0u : 1u)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) row[j] = std::min(row[j], before[j - 2] + 1);
    }
  }
  return row[b.size()];
}

}  // namespace

std::string_view number_of(Code c) { return entry(c).number; }
std::string_view title_of(Code c) { return entry(c).title; }

std::optional<Code> find_code(std::string_view number) {
  const auto found = std::ranges::find(kEntries, number, &Entry::number);
  return found == kEntries.end() ? std::nullopt : std::optional(static_cast<Code>(found - kEntries.begin()));
}

std::string render(const Diagnostic& d) {
  const char* kind = number_of(d.code).starts_with('W') ? "warning" : "error";
  std::string out = fmt::format("{}[{}]: {}\n", kind, number_of(d.code), d.about.empty() ? std::string(title_of(d.code)) : shown(d.about));
  const SourceMark& m = d.at.mark;
  out += place(m);
  if (!d.at.key_path.empty()) out += fmt::format("  at: {}\n", shown(d.at.key_path));
  if (m.line > 0) out += excerpt(m, d.span);
  labelled(out, "expected", d.expected);
  labelled(out, "got", d.got);
  labelled(out, "hint", d.hint);
  labelled(out, "stack", d.stack);
  return out;
}

std::string render(const std::vector<Diagnostic>& all) {
  std::string out;
  for (const auto& d : all) out += render(d) + "\n";
  out += fmt::format("{} error{}. Nothing was run.\n", all.size(), all.size() == 1 ? "" : "s");
  return out;
}

/// Of less than half of the letters: else it is another word.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& legal) {
  std::string best;
  std::size_t best_distance = 3;
  for (const auto& candidate : legal) {
    if (candidate.size() + 2 < word.size()) continue;
    const std::size_t d = edit_distance(word, candidate);
    if (d < best_distance && 2 * d < candidate.size()) {
      best = candidate;
      best_distance = d;
    }
  }
  return best.empty() ? std::string{} : fmt::format("did you mean \"{}\"?", best);
}

InputError::InputError(Diagnostic one) : all_{std::move(one)}, text_(render(all_)) {}
InputError::InputError(std::vector<Diagnostic> all) : all_(std::move(all)), text_(render(all_)) {}

void refuse(Code code, Located at, std::string expected, std::string got, std::string hint) {
  throw InputError(Diagnostic{code, std::move(at), std::move(expected), std::move(got), std::move(hint)});
}

std::string render(const RunFailure& f) {
  std::string out = fmt::format("failure[{}]: {}\n", number_of(f.code), title_of(f.code));
  if (!std::isnan(f.t)) {
    out += fmt::format("  t = {:.6g} s", f.t);
    if (!f.body.empty()) out += fmt::format("   body: {}", f.body);
    if (!f.hinge.empty()) out += fmt::format("   hinge: {}", f.hinge);
    out += '\n';
  }
  if (!f.what.empty()) out += fmt::format("  {}\n", shown(f.what));
  if (!f.last_good.empty()) out += fmt::format("  last accepted state: {}\n", shown(f.last_good));
  labelled(out, "hint", f.hint);
  return out;
}

NumericsError::NumericsError(RunFailure failure) : failure_(std::move(failure)), text_(render(failure_)) {}

void DiagnosticSink::report(Diagnostic d) {
  const auto concerns = [&](const Diagnostic& earlier) {  // the same value, or a part of it
    const std::string& path = earlier.at.key_path;
    return !d.at.key_path.empty() && path.starts_with(d.at.key_path) &&
           (path.size() == d.at.key_path.size() || path[d.at.key_path.size()] == '.' || path[d.at.key_path.size()] == '[');
  };
  if (!full() && std::none_of(all_.begin(), all_.end(), concerns)) all_.push_back(std::move(d));
}
void DiagnosticSink::report(Code code, Located at, std::string expected, std::string got, std::string hint) {
  report(Diagnostic{code, std::move(at), std::move(expected), std::move(got), std::move(hint)});
}
void DiagnosticSink::throw_if_any() const {
  if (!all_.empty()) throw InputError(all_);
}

}  // namespace cardan
