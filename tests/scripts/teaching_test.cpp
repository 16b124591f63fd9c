// The course in docs/operators: every page runs at the workbench and prints what stands beside it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <regex>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

const std::string kCourse = CARDAN_SOURCE_DIR "/docs/operators";

/// Names without this ending of the files of the course that have it, sorted.
std::vector<std::string> files_with(const std::string& ending) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(kCourse)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(ending)) names.push_back(name.substr(0, name.size() - ending.size()));
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// "vehicles/chain.yaml" of the first line "-- Vehicle: vehicles/chain.yaml".
std::string vehicle_of(const std::string& page) {
  const std::string text = file_text(kCourse + "/" + page + ".lua"), start = "-- Vehicle: ";
  return text.starts_with(start) ? text.substr(start.size(), text.find('\n') - start.size()) : "";
}

const std::regex kNumber("[-+]?[0-9]+([.][0-9]+)?(e[-+]?[0-9]+)?");

/// The text with # for each number and without the widths of columns.
std::string words_of(const std::string& text) { return std::regex_replace(std::regex_replace(text, kNumber, "#"), std::regex(" +"), " "); }
std::vector<double> numbers_of(const std::string& text) {
  std::vector<double> numbers;
  for (std::sregex_iterator i(text.begin(), text.end(), kNumber), end; i != end; ++i) numbers.push_back(std::stod(i->str()));
  return numbers;
}

class Lesson : public testing::TestWithParam<std::string> {};

TEST_P(Lesson, RunsAndPrintsWhatStandsBesideIt) {
  const Finished run = run_program({"workbench", vehicle_of(GetParam()), "--script", GetParam() + ".lua"}, kCourse);
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.err, "");
  const std::string expected = file_text(kCourse + "/" + GetParam() + ".expected.txt");
  ASSERT_EQ(words_of(run.out), words_of(expected));
  const std::vector<double> is = numbers_of(run.out), should_be = numbers_of(expected);
  ASSERT_EQ(is.size(), should_be.size());
  for (std::size_t i = 0; i < is.size(); ++i)  // a zero may be -0
    EXPECT_LE(std::abs(is[i] - should_be[i]), 1e-6 * std::abs(should_be[i])) << is[i] << " in place of " << should_be[i] << "\n" << run.out;
}
INSTANTIATE_TEST_SUITE_P(All, Lesson, testing::ValuesIn(files_with(".lua")), [](const auto& p) { return p.param; });

TEST(Course, EveryPageHasItsOutputAndALineInTheList) {
  const std::vector<std::string> pages = files_with(".lua");
  EXPECT_FALSE(pages.empty());
  EXPECT_EQ(pages, files_with(".expected.txt"));
  const std::string list = file_text(kCourse + "/README.md");
  for (const std::string& page : pages) {
    const std::string line = "[" + page + "](" + page + ".lua) | " + fs::path(vehicle_of(page)).stem().string() + " |";
    EXPECT_NE(list.find(line), std::string::npos) << line;
  }
}

}  // namespace
}  // namespace cardan
