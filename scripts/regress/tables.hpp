#pragma once
// What came out, for a screen, for a program and for continuous integration.
#include <string>
#include <vector>

#include "core/io/compare_runs.hpp"
#include "scripts/regress/judge.hpp"

namespace cardan {

/// A line: the name, what became of it, the claim that used most of its limit.
std::string line_of(const CaseResult& result, std::size_t width);
/// All that failed in it, with the reason of each limit.
std::string faults_of(const CaseResult& result);
/// JUnit XML: a suite for each scenario, a case for each claim.
std::string junit_xml(const std::vector<CaseResult>& results);
/// What was found in a row, with the place of what is wrong.
std::string found_text(const ClaimRow& row);
/// "scenario.lua:3, bodies.bus"; what is empty, or line 0, is left out.
std::string place_text(const std::string& file, int line, const std::string& key_path);
/// What the run said that ended badly; empty otherwise.
std::string ending_text(const CaseResult& result);
Json regress_json(const std::vector<CaseResult>& results);

/// What keeps two runs from being compared number by number: a line for each.
std::vector<std::string> structure_of(const RunDifference& difference, const std::string& first, const std::string& second);
std::string difference_table(const RunDifference& difference, const std::string& first, const std::string& second);
Json difference_json(const RunDifference& difference, const std::string& first, const std::string& second, bool pass);

}  // namespace cardan
