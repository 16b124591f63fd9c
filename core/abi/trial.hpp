#pragma once
// Work that is not ours, tried in a child process first: what crashes, never returns or ends the process does so there.
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/child_process.hpp"

namespace cardan {

/// Told before each call of foreign code: what a child was doing when it ended stays known.
using TellPhase = std::function<void(std::string_view)>;

/// The laws take some milliseconds.
inline constexpr ChildLimits kTrialLimits{.cpu_s = 5.0, .wall_s = 20.0};

/// Runs `work` in a copy of this process, silently. Empty if it returned or threw a std::exception; else how it ended,
/// and in which phase: "Segmentation fault, in pack of hinge \"acme/arc\"". Empty also where no copy can be made.
std::optional<std::string> end_in_child(const std::function<void(const TellPhase&)>& work, const ChildLimits& limits = kTrialLimits);

}  // namespace cardan
