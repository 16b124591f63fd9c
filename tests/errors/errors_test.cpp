// Each tests/errors/NAME.yaml is a vehicle with a fault; NAME.expected.txt is the whole text that its user sees.
// To write the expected texts anew (then read the difference): CARDAN_UPDATE_EXPECTED=1 test_errors
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include "bodies/register.hpp"
#include "bodies/vehicle/load_vehicle.hpp"
#include "core/base/diagnostic.hpp"
#include "core/io/yaml_reader.hpp"
#include "core/model/model.hpp"
#include "hinges/register.hpp"
#include "plugins/devices/register.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;
const fs::path kFolder = fs::path(CARDAN_SOURCE_DIR) / "tests/errors";

std::vector<std::string> cases() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(kFolder))
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// What a user sees who runs in the folder of the file.
std::string answer_to(const std::string& file) {
  fs::current_path(kFolder);
  Registry registry;
  register_hinges(registry), register_bodies(registry), register_devices(registry);
  try {
    SystemSpec spec = read_vehicle(file, registry);
    make_modes(spec);
    compile(spec, registry);
  } catch (const InputError& e) {
    return e.what();
  }
  return "no error";
}

class Errors : public testing::TestWithParam<std::string> {};

TEST_P(Errors, AreToldWithTheirWholeText) {
  const std::string text = answer_to(GetParam() + ".yaml");
  const fs::path expected = kFolder / (GetParam() + ".expected.txt");
  if (std::getenv("CARDAN_UPDATE_EXPECTED")) std::ofstream(expected, std::ios::binary) << text;
  EXPECT_EQ(text, text_of(expected));
  EXPECT_NE(text.find("error[" + GetParam().substr(0, 5) + "]"), std::string::npos) << "the file is named after its code";
}
INSTANTIATE_TEST_SUITE_P(Vehicle, Errors, testing::ValuesIn(cases()), [](const auto& c) {
  std::string name = c.param;
  std::replace_if(
      name.begin(), name.end(), [](char ch) { return !std::isalnum(static_cast<unsigned char>(ch)); }, '_');
  return name;
});

// Codes that a vehicle file cannot cause, and where they are tested instead.
const std::set<std::string> kElsewhere = {
    "C0102",  // file not found: tests/core/io/yaml_reader_test.cpp
    "C0207",  // a name twice (in YAML that is a duplicate key): tests/core/model/validate_test.cpp
    "C0403",  // a changed vehicle: tests/core/sim/adopt_test.cpp
    "C0404",  // a hinge in the run: tests/properties/rejoin_test.cpp, tests/scripts/topology_test.cpp
};

TEST(ErrorCodes, OfVehicleFilesHaveACase) {
  std::set<std::string> covered = kElsewhere;
  for (const std::string& name : cases()) covered.insert(name.substr(0, 5));
#define CARDAN_ERROR(number, name, title) \
  EXPECT_TRUE(std::string(number) > "C0500" || covered.count(number)) << number << " has no file in tests/errors";
#include "core/base/error_codes.inc"
#undef CARDAN_ERROR
}

TEST(ErrorCodes, AreDocumented) {
  const std::string text = text_of(fs::path(CARDAN_SOURCE_DIR) / "docs/errors.md");
#define CARDAN_ERROR(number, name, title)                                                   \
  EXPECT_NE(text.find(std::string("## ") + number + " " + title + "\n"), std::string::npos) \
      << number << " has no paragraph in docs/errors.md";
#include "core/base/error_codes.inc"
#undef CARDAN_ERROR
}

TEST(ErrorCodes, AreUsedOnce) {
  std::set<std::string> seen;
#define CARDAN_ERROR(number, name, title) EXPECT_TRUE(seen.insert(number).second) << number;
#include "core/base/error_codes.inc"
#undef CARDAN_ERROR
}

}  // namespace
}  // namespace cardan
