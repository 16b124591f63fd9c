#pragma once
// The report of a run: one HTML file that needs nothing else, neither a network nor the results it was made from.
#include <string>

namespace cardan {

/// Reads the results `h5_path` (also those of a run that was killed) and writes the page `html_path`. Long series are
/// thinned to the smallest and largest value of each stretch, so that the page stays below 3 MB.
/// Throws InputError C0702 (results cannot be read), C0701 (page cannot be written).
void write_report(const std::string& h5_path, const std::string& html_path);

}  // namespace cardan
