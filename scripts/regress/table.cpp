// References as text: comma-separated numbers under a line of names with units.
#include <fmt/format.h>

#include <sstream>

#include "core/base/units.hpp"
#include "scripts/regress/golden.hpp"

namespace cardan {
namespace {

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r"), last = text.find_last_not_of(" \t\r");
  return first == std::string::npos ? "" : text.substr(first, last - first + 1);
}

std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> out;
  for (std::size_t from = 0;;) {
    const auto comma = line.find(',', from);
    out.push_back(trimmed(line.substr(from, comma - from)));
    if (comma == std::string::npos) return out;
    from = comma + 1;
  }
}

}  // namespace

Table read_table(const std::filesystem::path& file) {
  std::istringstream text(text_of(file));
  DiagnosticSink sink;
  Table out;
  int n = 0;
  for (std::string line; std::getline(text, line) && !sink.full();) {
    ++n;
    const SourceMark mark{file.string(), n, 0};
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    const std::vector<std::string> all = cells(line);
    if (out.names.empty()) {
      for (const std::string& cell : all) {
        const auto open = cell.find('[');
        const bool has_unit = open != std::string::npos && cell.ends_with(']');
        if (!has_unit) sink.report(Code::wrong_type, {cell, mark}, "a name and its unit: \"x [rad/s]\", \"w [1]\"", in_quotes(cell));
        out.names.push_back(trimmed(cell.substr(0, open)));
        out.units.push_back(has_unit ? trimmed(cell.substr(open + 1, cell.size() - open - 2)) : "");
      }
      continue;
    }
    if (all.size() != out.names.size()) {
      sink.report(Code::wrong_type, {"", mark}, fmt::format("{} numbers, as the first line has names", out.names.size()),
                  fmt::format("{}", all.size()), "is the file cut short?");
      continue;
    }
    for (std::size_t i = 0; i < all.size(); ++i) {
      const auto number = parse_number(all[i]);
      if (!number) sink.report(Code::bad_number, {out.names[i], mark}, "a finite number", in_quotes(all[i]));
      out.values.push_back(number.value_or(0.0));
    }
  }
  if (out.names.empty())
    sink.report(Code::wrong_type, {"", {file.string()}}, "a line of names with units, then rows of numbers", "nothing");
  sink.throw_if_any();
  return out;
}

}  // namespace cardan
