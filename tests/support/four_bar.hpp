#pragma once
// A four-bar linkage of unequal links, as vehicles with closed loops are tested on.
#include "tests/support/builders.hpp"

namespace cardan::test {

/// A crank, a coupler and a rocker; the loop closes the rocker's tip. `branch`: the pin between coupler and
/// rocker lies above (1) or below (-1) the line from the crank to the fixed pivot.
SystemSpec four_bar(const std::string& closing = "point", double rate = 2.0, double branch = 1.0);

}  // namespace cardan::test
