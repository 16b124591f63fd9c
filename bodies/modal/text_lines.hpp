#pragma once
// Lines of a text file that is not ours, one at a time.
#include <fstream>
#include <string>

#include "core/base/diagnostic.hpp"

namespace cardan {

/// Throws InputError: C0102 where there is no such file, C0321, with the line, where it is not one of short lines.
class TextLines {
 public:
  TextLines(const std::string& path, const Located& at, const std::string& expected);

  bool next();  ///< false: the file has ended
  const std::string& line() const { return line_; }
  Located here() const { return {at_.key_path, {path_, number_, 0}}; }

 private:
  std::string path_;
  Located at_;
  std::ifstream in_;
  std::string line_;
  int number_ = 0;
};

}  // namespace cardan
