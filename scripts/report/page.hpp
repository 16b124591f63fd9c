#pragma once
// The parts of the page that are the same for every run, embedded at build time.
#include <string>
#include <string_view>

#include "core/io/json.hpp"

namespace cardan::page {

std::string_view html();         ///< template.html: marks @title@ @style@ @data@ @script@ @notice@ stand for the parts
std::string_view style();        ///< style sheet of page and plots
std::string_view script();       ///< program of the page
std::string_view differences();  ///< program of the page of a comparison
std::string_view precision();    ///< program of the page of `cardan precision`
std::string_view campaign();     ///< program of the page of `cardan campaign`
std::string_view notice();       ///< licence of uPlot, which the script contains

/// The template with the parts in its marks. `data`: the JSON that the script reads.
std::string filled(const std::string& title, const Json& data, std::string_view script);

}  // namespace cardan::page
