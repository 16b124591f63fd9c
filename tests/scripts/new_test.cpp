// `cardan new`: what it refuses. That its projects build and pass: Install.Project.* (tests/CMakeLists.txt).
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <filesystem>

#include "tests/scripts/run_program.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

std::string refusal(const std::vector<std::string>& arguments, const std::string& folder) {
  const Finished run = run_program(arguments, folder);
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_EQ(run.out, "");
  return run.err;
}

TEST(New, FillsTheNamesInAndLeavesNoPlaceholder) {
  const TemporaryFolder dir;
  for (const std::string kind : {"hinge", "body", "device", "field"}) {
    ASSERT_EQ(run_program({"new", kind, "acme/roll-3", "--out", "made/" + kind + "/"}, dir.path()).exit_code, 0);
    int files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(dir / ("made/" + kind))) {
      if (!entry.is_regular_file()) continue;
      ++files;
      EXPECT_EQ(file_text(entry.path()).find('@' + std::string("NAME")), std::string::npos) << entry.path();
      EXPECT_EQ(file_text(entry.path()).find('@' + std::string("TYPE")), std::string::npos) << entry.path();
    }
    EXPECT_EQ(files, 6) << "CMakeLists.txt, README.md, .gitignore, the source, scenario.lua, vehicle.yaml";
    EXPECT_NE(file_text(dir / ("made/" + kind + "/roll-3.cpp")).find("type = \"acme/roll-3\""), std::string::npos);
    EXPECT_NE(file_text(dir / ("made/" + kind + "/scenario/vehicle.yaml")).find("type: acme/roll-3"), std::string::npos);
  }
}

TEST(New, RefusesAnUnknownKindANameThatIsNoneAndAFolderThatIsThere) {
  const TemporaryFolder dir;
  EXPECT_EQ(refusal({"new", "hing", "roller"}, dir.path()),
            "error[C0801]: wrong command line\n  at: kind\n  expected: hinge, body, device, field\n  got:      \"hing\"\n"
            "  hint:     did you mean \"hinge\"?\n\n1 error. Nothing was run.\n");
  for (const std::string name : {"", "9roll", "a/b/c", "/roller", "acme/", "../x", "röller", "a b", "test"})
    EXPECT_EQ(
        refusal({"new", "hinge", name}, dir.path()),
        "error[C0210]: name cannot be used\n  at: name\n  expected: a letter, then letters, digits, `_` and `-`; no target of CMake's own\n"
        "  got:      \"" +
            name + "\"\n  hint:     roller, or with a prefix of your own acme/roller\n\n1 error. Nothing was run.\n");
  EXPECT_TRUE(fs::is_empty(dir.path()));
  fs::create_directory(dir / "roller");
  write(dir / "roller/mine.txt", "mine");
  EXPECT_EQ(refusal({"new", "hinge", "roller"}, dir.path()),
            "error[C0701]: result cannot be written\n  --> roller\n  expected: a folder that is not there yet\n  got:      one that is\n"
            "  hint:     --out OTHER_FOLDER\n\n1 error. Nothing was run.\n");
  EXPECT_EQ(std::distance(fs::directory_iterator(dir / "roller"), fs::directory_iterator()), 1);
  write(dir / "file", "");
  const Finished nowhere = run_program({"new", "hinge", "roller", "--out", "file/roller"}, dir.path());
  EXPECT_EQ(nowhere.exit_code, 4);
  EXPECT_NE(nowhere.err.find("a folder that can be made"), std::string::npos) << nowhere.err;
}

TEST(New, LeavesNoHalfOfAProjectOnAFullDisk) {
  const TemporaryFolder dir;
  const Finished full = run_program({"new", "hinge", "roller"}, dir.path(), [] {
    const rlimit most{100, 100};  // [bytes] of a file
    setrlimit(RLIMIT_FSIZE, &most);
  });
  EXPECT_EQ(full.exit_code, 4);
  EXPECT_EQ(full.err.find("Nothing was run"), std::string::npos) << full.err;
  EXPECT_TRUE(fs::is_empty(dir.path())) << full.err;
  EXPECT_EQ(run_program({"new", "hinge", "roller"}, dir.path()).exit_code, 0);
}

}  // namespace
}  // namespace cardan
