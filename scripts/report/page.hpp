#pragma once
// The parts of the page that are the same for every run, embedded at build time.
#include <string_view>

namespace cardan::page {

std::string_view html();    ///< template.html: marks @title@ @style@ @data@ @script@ @notice@ stand for the parts
std::string_view style();   ///< style sheet of page and plots
std::string_view script();  ///< program of the page
std::string_view notice();  ///< licence of uPlot, which the script contains

}  // namespace cardan::page
