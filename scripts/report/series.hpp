#pragma once
// The channels of a run as points of plots.
#include <cstddef>
#include <string>
#include <vector>

#include "core/io/json.hpp"

namespace cardan {

class Hdf5File;

/// rows, stretch, t, channels [{path, unit, frame, meaning, components, values}], left_out {group: {shown, channels}}, still {group:
/// [{path, unit, components, values}]}, still_left_out. Channels that do not move are in `still` with one value for each component. After
/// each attitude that moves comes a channel of its angles. Throws InputError C0702.
Json series(const Hdf5File& file);

/// `value` with so many significant digits that a plot over a range `range` is drawn to 1e-5 of its height; null if it is not finite.
Json rounded(double value, double largest, double range);

[[noreturn]] void bad_content(const Hdf5File& file, const std::string& path, const std::string& expected, const std::string& got);

}  // namespace cardan
