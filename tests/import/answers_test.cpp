// Each tests/import/errors/NAME.urdf or NAME.xml is a robot with a fault; NAME.expected.txt is the whole text that its user sees.
// To write the expected texts anew (then read the difference): CARDAN_UPDATE_EXPECTED=1 test_import
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/io/yaml_reader.hpp"
#include "scripts/import/import.hpp"
#include "tests/support/builders.hpp"

namespace cardan::test {
namespace {

namespace fs = std::filesystem;
const fs::path kErrors = fs::path(CARDAN_SOURCE_DIR) / "tests/import/errors";

std::vector<std::string> faulty_robots() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(kErrors))
    if (entry.path().extension() != ".txt") names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

std::string bytes_of(const fs::path& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

/// As `cardan import` answers in the folder of the file.
std::string answer_to(const std::string& text, const std::string& file, const ImportOptions& options = {}) {
  fs::current_path(kErrors);
  try {
    const Imported imported = import_robot(text, file, options);
    try {
      compiled(vehicle_from_text(imported.yaml, "vehicle.yaml", registry()));
    } catch (const InputError& e) {
      std::vector<Diagnostic> all = e.diagnostics();
      for (Diagnostic& d : all) d = imported.at_its_source(std::move(d));
      return render(all);
    }
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

class ImportAnswers : public testing::TestWithParam<std::string> {};

TEST_P(ImportAnswers, AreToldWithTheirWholeText) {
  const std::string text = answer_to(bytes_of(kErrors / GetParam()), GetParam());
  const fs::path expected = kErrors / (GetParam() + ".expected.txt");
  if (std::getenv("CARDAN_UPDATE_EXPECTED")) std::ofstream(expected, std::ios::binary) << text;
  EXPECT_EQ(text, bytes_of(expected));
  EXPECT_NE(text.find("error[" + GetParam().substr(0, 5) + "]"), std::string::npos) << "the file is named after its code";
}
INSTANTIATE_TEST_SUITE_P(Robot, ImportAnswers, testing::ValuesIn(faulty_robots()), [](const auto& c) {
  std::string name = c.param;
  std::ranges::replace_if(
      name, [](char ch) { return !std::isalnum(static_cast<unsigned char>(ch)); }, '_');
  return name;
});

TEST(ImportAnswers, WhatIsTooMuchIsRefusedBeforeItIsRead) {
  const auto deep = [](int n) {
    std::string text = "<robot name='r'>";
    for (int i = 0; i < n; ++i) text += "<a>";
    for (int i = 0; i < n; ++i) text += "</a>";
    return text + "</robot>";
  };
  EXPECT_NE(answer_to(deep(94), "deep.urdf").find("C1202"), std::string::npos) << "read, and not understood";
  EXPECT_NE(answer_to(deep(95), "deep.urdf").find("at most 95 levels"), std::string::npos);
  EXPECT_NE(answer_to(deep(1'000'000), "deep.urdf").find("at most 95 levels"), std::string::npos);
  std::string wide = "<robot";
  for (int i = 0; i < 100'000; ++i) wide += " a" + std::to_string(i) + "=''";
  EXPECT_NE(answer_to(wide + "/>", "wide.urdf").find("at most 100 attributes"), std::string::npos);
  std::string many = "<robot name='r'>";
  for (int i = 0; i < 200'000; ++i) many += "<a/>";
  EXPECT_NE(answer_to(many + "</robot>", "many.urdf").find("at most 200000 elements"), std::string::npos);
  EXPECT_NE(answer_to(std::string((16u << 20) + 1, ' '), "large.urdf").find("at most 16 MiB"), std::string::npos);
  EXPECT_NE(answer_to("", "empty.urdf").find("C1201"), std::string::npos);
  EXPECT_NE(answer_to(std::string("<robot\0/>", 9), "nul.urdf").find("the byte 0x00"), std::string::npos);
}

TEST(ImportAnswers, LeaveOutDoesWithoutWhatItNamesAndNothingElse) {
  const auto with = [](const std::string& file, std::vector<std::string> names) {
    ImportOptions options;
    options.leave_out = std::move(names);
    return answer_to(bytes_of(kErrors / file), file, options);
  };
  EXPECT_EQ(with("C1202_armature.xml", {"armature"}), "no error");
  EXPECT_EQ(with("C1202_massless_end.urdf", {"b"}), "no error");
  EXPECT_EQ(with("C1202_element.urdf", {"tendon", "xacro:include"}), "no error");
  EXPECT_NE(with("C1202_element.urdf", {"tendon"}).find("xacro"), std::string::npos);
  EXPECT_EQ(with("C1202_element.urdf", {"t", "xacro:include"}), "no error") << "by its own name";
  EXPECT_EQ(with("C1202_tendon.xml", {"tendon"}), "no error");
  EXPECT_EQ(with("C1202_loop_type.urdf", {"c"}), "no error");
  EXPECT_EQ(with("C1202_sections.xml", {"include", "density"}), "no error");
  EXPECT_EQ(with("C0104_attribute.urdf", {"uper"}), "no error");
  EXPECT_EQ(with("C1202_dynamics.urdf", {"dynamics", "friction"}), "no error");
  EXPECT_EQ(with("C0206_mimics.urdf", {"mimic"}), "no error");
  EXPECT_EQ(with("C1103_open_loop.urdf", {"loop"}), "no error");
  const std::string nothing = with("C1202_armature.xml", {"armature", "armatur"});
  EXPECT_NE(nothing.find("error[C0801]"), std::string::npos) << nothing;
  EXPECT_NE(nothing.find("\"armatur\""), std::string::npos) << nothing;
}

TEST(ImportAnswers, ToOptionsThatNameNothing) {
  ImportOptions options;
  options.initial = {{"elbov", "1"}};
  const std::string file = CARDAN_SOURCE_DIR "/tests/import/robots/double_pendulum.urdf";
  EXPECT_NE(answer_to(bytes_of(file), file, options).find("did you mean \"elbow\"?"), std::string::npos);
  options.initial.clear();
  options.base = ImportOptions::Base::free;
  EXPECT_NE(answer_to(bytes_of(file), file, options).find("--base fixed holds it to the world"), std::string::npos)
      << "a root without mass";
  const std::string mjcf = CARDAN_SOURCE_DIR "/tests/import/robots/four_bar.xml";
  EXPECT_NE(answer_to(bytes_of(mjcf), mjcf, options).find("an option of URDF alone"), std::string::npos);
}

}  // namespace
}  // namespace cardan::test
