// The scenarios that teach: each runs as its page says, its checks pass, and its page and figure are there.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

const std::string kTutorials = CARDAN_SOURCE_DIR "/scenarios/tutorials";

std::vector<std::string> tutorials() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(kTutorials))
    if (entry.is_directory()) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

/// The words of the lines of a page that begin with `command`, without `cardan`.
std::vector<std::vector<std::string>> commands_of(const std::string& page, const std::string& command) {
  std::vector<std::vector<std::string>> out;
  std::istringstream lines(page);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(command + " ")) continue;
    std::istringstream words(line.substr(7));
    out.emplace_back();
    for (std::string word; words >> word;) out.back().push_back(word.starts_with("scenarios/") ? CARDAN_SOURCE_DIR "/" + word : word);
  }
  return out;
}

class Tutorial : public testing::TestWithParam<std::string> {};

TEST_P(Tutorial, RunsAsItsPageSaysAndPassesItsChecks) {
  const std::string folder = kTutorials + "/" + GetParam(), page = file_text(folder + "/README.md");
  const auto runs = commands_of(page, "cardan run"), figures = commands_of(page, "cardan report");
  ASSERT_EQ(runs.size(), 1u);
  ASSERT_EQ(figures.size(), 1u);
  EXPECT_EQ(runs[0][1], folder);
  const TemporaryFolder dir;
  const Finished run = run_program(runs[0], dir.path());
  EXPECT_EQ(run.exit_code, 0) << run.out << run.err;
  const auto summary = summary_of(dir / "out");
  EXPECT_EQ(summary["verdict"], "passed");
  EXPECT_FALSE(summary["checks"].empty());
  EXPECT_TRUE(summary["warnings"].empty()) << summary["warnings"];
  EXPECT_EQ(summary["ledger"]["verdict"], "pass");
  EXPECT_TRUE(summary["kept_outside_persist"].empty()) << summary["kept_outside_persist"];
  const Finished report = run_program(figures[0], dir.path());
  EXPECT_EQ(report.exit_code, 0) << report.err;
  for (const std::string& figure : {dir / "figure.svg", folder + "/figure.svg"}) {
    EXPECT_TRUE(file_text(figure).starts_with("<svg ")) << figure;
    EXPECT_LT(fs::file_size(figure), 100'000u) << figure;
  }
}
INSTANTIATE_TEST_SUITE_P(All, Tutorial, testing::ValuesIn(tutorials()), [](const auto& p) { return p.param; });

TEST(Tutorials, HaveALineInTheListInTheirOrder) {
  const std::string list = file_text(kTutorials + "/README.md");
  std::size_t at = 0;
  for (const std::string& name : tutorials()) {
    const auto line = list.find("| [" + name + "](" + name + "/README.md) |");
    ASSERT_NE(line, std::string::npos) << name;
    EXPECT_GT(line, at) << name;
    at = line;
    EXPECT_TRUE(fs::exists(kTutorials + "/" + name + "/golden.yaml")) << name << ", which Scenarios.Regress compares";
    const std::string page = file_text(kTutorials + "/" + name + "/README.md");
    for (const char* part :
         {"](figure.svg)", "**What it shows.**", "**The physics.**", "**Where the truth comes from.**", "**What to change.**"})
      EXPECT_NE(page.find(part), std::string::npos) << name << " has no " << part;
  }
}

}  // namespace
}  // namespace cardan
