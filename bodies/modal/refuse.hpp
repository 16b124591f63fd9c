#pragma once
// How this folder answers bad input.
#include <string>
#include <utility>

#include "core/base/diagnostic.hpp"

namespace cardan {

/// Throws InputError with the key path at.key_path + "." + field.
[[noreturn]] inline void refuse(const Located& at, const std::string& field, Code code, std::string expected, std::string got,
                                std::string hint = {}) {
  Located where = at;
  if (!field.empty()) where.key_path += (where.key_path.empty() ? "" : ".") + field;
  refuse(code, where, std::move(expected), std::move(got), std::move(hint));
}

}  // namespace cardan
