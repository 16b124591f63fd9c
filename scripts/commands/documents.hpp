#pragma once
// Pages of docs/ that are part of the program.
#include <string_view>

namespace cardan::documents {

std::string_view errors();  ///< docs/errors.md

}  // namespace cardan::documents
