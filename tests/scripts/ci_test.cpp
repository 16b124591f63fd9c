// The pipelines that docs/ci.md prints: their commands are run here as they stand there.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "core/io/yaml_reader.hpp"
#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

/// The n-th block of YAML of the page.
DocNode block(int n) {
  std::string page = file_text(CARDAN_SOURCE_DIR "/docs/ci.md");
  for (; n >= 0; --n) page = page.substr(page.find("```yaml\n") + 8);
  return parse_yaml(page.substr(0, page.find("```")), "docs/ci.md");
}

const DocNode& at(const DocNode& node, const std::string& path) {
  const DocNode* here = &node;
  for (std::size_t from = 0; from <= path.size();) {
    const std::size_t to = std::min(path.find('.', from), path.size());
    const DocNode* next = here->find(path.substr(from, to - from));
    if (!next) throw std::runtime_error("docs/ci.md: no " + path);
    here = next;
    from = to + 1;
  }
  return *here;
}

struct Pipeline {
  std::string commands;                // as a shell of the forge runs them
  std::vector<std::string> artifacts;  // files
};

Pipeline github() {
  const DocNode file = block(0);
  EXPECT_EQ(at(file, "jobs.regress.container").text, "debian:12");
  Pipeline out;
  for (const DocNode& step : at(file, "jobs.regress.steps").items) {
    if (const DocNode* run = step.find("run")) out.commands += run->text + "\n";
    if (const DocNode* uses = step.find("uses"); uses && uses->text.starts_with("actions/upload-artifact")) {
      EXPECT_EQ(at(step, "if").text, "always()");
      std::istringstream lines(at(step, "with.path").text);
      for (std::string line; std::getline(lines, line);) out.artifacts.push_back(line);
    }
  }
  return out;
}

Pipeline gitlab() {
  const DocNode file = block(1);
  EXPECT_EQ(at(file, "regress.image").text, "debian:12");
  EXPECT_EQ(at(file, "regress.artifacts.when").text, "always");
  Pipeline out;
  for (const char* key : {"regress.before_script", "regress.script"})
    for (const DocNode& line : at(file, key).items) out.commands += line.text + "\n";
  for (const DocNode& path : at(file, "regress.artifacts.paths").items) out.artifacts.push_back(path.text);
  out.artifacts.push_back(at(file, "regress.artifacts.reports.junit").text);
  return out;
}

/// A checked-out repository with a scenario, and a machine: this program, and stand-ins that note what they are called with.
struct Machine : TemporaryFolder {
  Machine() {
    fs::create_directories(*this / "bin");
    fs::create_symlink(CARDAN_BINARY_DIR "/cardan", *this / "bin/cardan");
    write(*this / "bin/apt-get", "#!/bin/sh\necho apt-get \"$@\" >> called\ncase \"$*\" in *./cardan.deb*) test -s cardan.deb ;; esac\n");
    write(*this / "bin/curl", "#!/bin/sh\necho curl \"$@\" >> called\necho package > \"$3\"\n");
    for (const char* program : {"bin/apt-get", "bin/curl"}) chmod((*this / program).c_str(), 0755);
    const std::string page = file_text(CARDAN_SOURCE_DIR "/docs/golden.md");
    const auto from = page.find("```yaml\n") + 8;
    golden = page.substr(from, page.find("```", from) - from);
    for (const char* name : {"a", "b"}) {
      fs::create_directories(*this / "scenarios");
      fs::copy(CARDAN_SOURCE_DIR "/tests/scripts/missions/pendulum", *this / ("scenarios/" + std::string(name)),
               fs::copy_options::recursive);
      write(*this / ("scenarios/" + std::string(name) + "/golden.yaml"), golden);
    }
  }
  int run(const std::string& commands) const {
    write(*this / "commands", "set -e\n" + commands);
    const std::string line = "cd '" + path() + "' && PATH='" + path() + "/bin':$PATH CARDAN_DEB=https://example.org/cardan.deb SHARD=1 " +
                             "CI_NODE_INDEX=1 CI_NODE_TOTAL=2 sh -e commands > said 2>&1";
    const int status = std::system(line.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  std::string golden;
};

class Pipelines : public testing::TestWithParam<Pipeline (*)()> {};

TEST_P(Pipelines, InstallRunAndKeepWhatCameOut) {
  const Pipeline pipeline = GetParam()();
  const Machine machine;
  EXPECT_EQ(machine.run(pipeline.commands), 0) << file_text(machine / "said");
  EXPECT_NE(file_text(machine / "called").find("apt-get install -y -q --no-install-recommends ./cardan.deb"), std::string::npos);
  EXPECT_NE(file_text(machine / "said").find("1 of 1 scenarios pass"), std::string::npos) << "one shard: " << file_text(machine / "said");
  EXPECT_GE(pipeline.artifacts.size(), 3u);
  for (const std::string& artifact : pipeline.artifacts) EXPECT_GT(fs::file_size(machine / artifact), 100u) << artifact;
}

TEST_P(Pipelines, FailWithAScenarioAndKeepTheirArtifacts) {
  const Pipeline pipeline = GetParam()();
  const Machine machine;
  write(machine / "scenarios/a/golden.yaml", replaced(machine.golden, "0.2498", "0.2499"));
  EXPECT_EQ(machine.run(pipeline.commands), 1) << file_text(machine / "said");
  for (const std::string& artifact : pipeline.artifacts) EXPECT_TRUE(fs::exists(machine / artifact)) << artifact;
}

INSTANTIATE_TEST_SUITE_P(Of, Pipelines, testing::Values(github, gitlab), [](const auto& p) { return p.index == 0 ? "GitHub" : "GitLab"; });

}  // namespace
}  // namespace cardan
