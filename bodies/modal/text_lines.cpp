#include "bodies/modal/text_lines.hpp"

#include <array>
#include <filesystem>

namespace cardan {

TextLines::TextLines(const std::string& path, const Located& at, const std::string& expected) : path_(path), at_(at) {
  std::error_code none;
  if (std::filesystem::is_regular_file(path, none)) in_.open(path);
  if (!in_.is_open()) refuse(Code::file_not_found, at, expected, "no file that can be read at " + path);
}

bool TextLines::next() {
  std::array<char, 1000> line;
  in_.getline(line.data(), line.size());
  if (in_.eof() && in_.gcount() == 0) return false;
  ++number_;
  if (in_.fail()) refuse(Code::bad_modal_data, here(), "a line of less than 1000 bytes", "a longer one");
  line_ = line.data();
  if (number_ == 1 && line_.starts_with("\xEF\xBB\xBF")) line_.erase(0, 3);  // the byte-order mark of some editors
  if (!line_.empty() && line_.back() == '\r') line_.pop_back();
  return true;
}

}  // namespace cardan
