#pragma once
#include <string>

namespace cardan {

/// Writes results with every kind of channel and text: synthetic signals in the shape of a slew with flexible wings.
void write_example_run(const std::string& path, int rows, bool finished = true);

}  // namespace cardan
