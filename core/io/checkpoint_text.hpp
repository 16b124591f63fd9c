#pragma once
// A checkpoint as one text, as run.h5 keeps it: docs/results.md.
#include <string>
#include <string_view>

#include "core/base/checkpoint.hpp"

namespace cardan {

/// JSON, {"format": 1, "blocks": {name: {"numbers": [...], "texts": [...]}}}; numbers come back bit by bit, those that are not finite as
/// "nan", "inf", "-inf".
std::string checkpoint_text(const Checkpoint& checkpoint);
/// Throws CheckpointFault for any other text.
Checkpoint checkpoint_of(std::string_view text);

}  // namespace cardan
