#pragma once
// A figure of some channels of a run: one SVG file, for documents.
#include <string>
#include <vector>

namespace cardan {

class Hdf5File;

/// Draws channels over time, a panel for each of `plots`, below each other. A plot is one or more channels with commas between them: paths
/// below /channels ("bodies/bus/rate", "wheels/speed"), all components, or one of them ("bodies/bus/rate.y"). Lines are drawn to a tenth of
/// a point. Throws InputError C0208 (no such channel or component), C0702.
std::string figure_svg(const Hdf5File& file, const std::vector<std::string>& plots);

/// The same from the results `h5_path` to the file `svg_path`; read in a child process, as by `write_report`. Throws also C0701.
void write_figure(const std::string& h5_path, const std::string& svg_path, const std::vector<std::string>& plots);

}  // namespace cardan
