#pragma once
// The report of a run: one HTML file that needs nothing else, neither a network nor the results it was made from.
#include <string>

#include "core/io/bounded_child.hpp"

namespace cardan {

class Hdf5File;

/// Reads the results `h5_path` (also those of a run that was killed) and writes the page `html_path`. Long series are
/// thinned to the smallest and largest value of each stretch, so that the page stays below 3 MB. The results are read in a
/// child process, so that a damaged file harms nobody.
/// Throws InputError C0702 (results cannot be read), C0701 (page cannot be written).
void write_report(const std::string& h5_path, const std::string& html_path);
void write_report(const std::string& h5_path, const std::string& html_path, const ChildLimits& limits);

/// The page as text, from an open file, in this process: for a file whose bytes are sound.
std::string report_page(const Hdf5File& file);

}  // namespace cardan
