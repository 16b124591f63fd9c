#include "core/base/excerpt.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "core/base/utf8.hpp"

namespace cardan {
namespace {

constexpr std::size_t kWidth = 100;  // longest excerpt of a source line

/// The line of the source file, without line ending and byte-order mark; tabs as spaces, what is not text as '?'.
std::string source_line(const SourceMark& mark) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(mark.file, none)) return {};  // a device may never end, a FIFO waits
  std::ifstream in(mark.file);
  std::string line;
  for (int i = 0; i < mark.line; ++i)
    if (!std::getline(in, line)) return {};
  if (mark.line == 1 && line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
  std::replace(line.begin(), line.end(), '\t', ' ');
  line.erase(line.find_last_not_of(" \r") + 1);
  return printable(line);
}

/// How many characters from `start` on belong to the value or key that begins there.
std::size_t token_length(std::string_view line, std::size_t start) {
  const std::string_view rest = line.substr(start);
  if (rest.empty()) return 1;
  const char first = rest[0];
  if (first == '"' || first == '\'') {
    const std::size_t end = rest.find(first, 1);
    return end == std::string_view::npos ? rest.size() : end + 1;
  }
  if (first == '[' || first == '{') {
    int depth = 0;
    for (std::size_t i = 0; i < rest.size(); ++i) {
      if (rest[i] == '[' || rest[i] == '{') ++depth;
      if ((rest[i] == ']' || rest[i] == '}') && --depth == 0) return i + 1;
    }
    return rest.size();
  }
  std::size_t end = 1;
  const auto ends = [](std::string_view tail) {
    return tail[0] == ',' || tail[0] == ']' || tail[0] == '}' || tail.starts_with(" #") || tail.starts_with(": ") || tail == ":";
  };
  while (end < rest.size() && !ends(rest.substr(end))) ++end;
  while (rest[end - 1] == ' ' && end > 1) --end;
  return end;
}

}  // namespace

std::string excerpt(const SourceMark& mark, int span) {
  std::string line = source_line(mark);
  if (line.empty()) return {};
  std::size_t start = mark.column > 0 ? static_cast<std::size_t>(mark.column - 1) : line.size();
  if (line.size() > kWidth) {
    std::size_t cut = start < line.size() && start > kWidth / 2 ? start - kWidth / 2 : 0;
    while (cut > 0 && continues_character(line[cut])) --cut;
    std::size_t end = std::min(line.size(), cut + kWidth);
    while (end < line.size() && continues_character(line[end])) ++end;
    line = (cut > 0 ? "..." : "") + line.substr(cut, end - cut) + (end < line.size() ? "..." : "");
    start = start - cut + (cut > 0 ? 3 : 0);
  }
  std::string out = fmt::format("{:>5} | {}\n", mark.line, line);
  if (mark.column <= 0 || start >= line.size()) return out;
  std::size_t length = span > 0 ? static_cast<std::size_t>(span) : token_length(line, start);
  length = std::min(length, line.size() - start);
  const auto width = [&](std::size_t from, std::size_t count) {
    return count - static_cast<std::size_t>(std::count_if(line.begin() + static_cast<std::ptrdiff_t>(from),
                                                          line.begin() + static_cast<std::ptrdiff_t>(from + count), continues_character));
  };
  return out + fmt::format("      | {}{}\n", std::string(width(0, start), ' '), std::string(width(start, length), '^'));
}

}  // namespace cardan
