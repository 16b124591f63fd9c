#pragma once
#include <string>

namespace cardan {

/// A place in a text file. Lines and columns count from 1; 0 = unknown.
struct SourceMark {
  std::string file{};
  int line = 0, column = 0;
};

}  // namespace cardan
