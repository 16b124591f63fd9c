#include "core/base/diagnostic.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>

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

std::string source_line(const SourceMark& mark) {
  std::ifstream in(mark.file);
  std::string line;
  for (int i = 0; i < mark.line; ++i)
    if (!std::getline(in, line)) return {};
  return line;
}

void labelled(std::string& out, std::string_view label, std::string_view text) {
  if (text.empty()) return;
  std::string indented;
  for (char ch : text) {
    indented += ch;
    if (ch == '\n') indented += "            ";
  }
  out += fmt::format("  {:<10}{}\n", fmt::format("{}:", label), indented);
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t up = row[j];
      row[j] = std::min({up + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0u : 1u)});
      diagonal = up;
    }
  }
  return row[b.size()];
}

}  // namespace

std::string_view number_of(Code c) { return entry(c).number; }
std::string_view title_of(Code c) { return entry(c).title; }

std::string render(const Diagnostic& d) {
  std::string out = fmt::format("error[{}]: {}\n", number_of(d.code), d.about.empty() ? title_of(d.code) : d.about);
  const SourceMark& m = d.at.mark;
  if (!m.file.empty()) {
    out += "  --> " + m.file;
    if (m.line > 0) out += fmt::format(":{}", m.line);
    if (m.line > 0 && m.column > 0) out += fmt::format(":{}", m.column);
    out += '\n';
  }
  labelled(out, "at", d.at.key_path);
  if (m.line > 0) {
    const std::string line = source_line(m);
    if (!line.empty()) {
      out += fmt::format("   {:>4} | {}\n", m.line, line);
      if (m.column > 0 && static_cast<std::size_t>(m.column) <= line.size()) {
        const auto start = static_cast<std::size_t>(m.column - 1);
        std::size_t length = static_cast<std::size_t>(d.span);
        if (length == 0) {
          const std::size_t end = line.find_first_of(" ,]}#\t:", start + 1);
          length = (end == std::string::npos ? line.size() : end) - start;
        }
        out += fmt::format("        | {}{}\n", std::string(start, ' '), std::string(std::max<std::size_t>(length, 1), '^'));
      }
    }
  }
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

std::string did_you_mean(std::string_view word, const std::vector<std::string>& legal) {
  std::string best;
  std::size_t best_distance = 3;
  for (const auto& candidate : legal) {
    const std::size_t d = edit_distance(word, candidate);
    if (d < best_distance && d < candidate.size()) {
      best = candidate;
      best_distance = d;
    }
  }
  return best.empty() ? std::string{} : fmt::format("did you mean \"{}\"?", best);
}

InputError::InputError(Diagnostic one) : all_{std::move(one)}, text_(render(all_)) {}
InputError::InputError(std::vector<Diagnostic> all) : all_(std::move(all)), text_(render(all_)) {}

std::string render(const RunFailure& f) {
  std::string out = fmt::format("failure[{}]: {}\n", number_of(f.code), title_of(f.code));
  out += fmt::format("  t = {:.6g} s", f.t);
  if (!f.body.empty()) out += fmt::format("   body: {}", f.body);
  if (!f.hinge.empty()) out += fmt::format("   hinge: {}", f.hinge);
  out += '\n';
  if (!f.what.empty()) out += fmt::format("  {}\n", f.what);
  if (!f.last_good.empty()) out += fmt::format("  last accepted state: {}\n", f.last_good);
  labelled(out, "hint", f.hint);
  return out;
}

NumericsError::NumericsError(RunFailure failure) : failure_(std::move(failure)), text_(render(failure_)) {}

void DiagnosticSink::report(Diagnostic d) {
  if (all_.size() < kLimit) all_.push_back(std::move(d));
}
void DiagnosticSink::throw_if_any() const {
  if (!all_.empty()) throw InputError(all_);
}

}  // namespace cardan
