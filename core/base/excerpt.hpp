#pragma once
#include <string>

#include "core/base/source_mark.hpp"

namespace cardan {

/// "    7 | line\n", cut around the column where it is long, and below it the `span` characters there underlined (0: to the end of
/// the word; no column: none); empty where the file cannot be read.
std::string excerpt(const SourceMark& mark, int span = 0);

}  // namespace cardan
