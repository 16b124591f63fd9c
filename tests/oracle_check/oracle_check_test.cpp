// The checker of the reference vectors checked: a file in which one number is wrong, or a field is missing, must fail.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/scratch.hpp"

namespace cardan {
namespace {

using nlohmann::json;
constexpr int kPass = 0, kFail = 1;

json vector_file(const std::string& name) {
  return json::parse(std::ifstream(CARDAN_SOURCE_DIR "/tests/reference/oracle/" + name + ".json"));
}

int verdict(const json& file) {
  const std::string path = test::scratch("vector.json"), report = test::scratch("report.txt");
  std::ofstream(path) << file.dump();
  const int status = std::system(fmt::format("'{}/tests/oracle_check' '{}' '{}' > /dev/null", CARDAN_BINARY_DIR, path, report).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// The first number below j.
json& first_number(json& j) { return j.is_structured() ? first_number(j.begin().value()) : j; }

/// The fields that must be compared, as pointers: what holds numbers, and the fields of each kind of thing that has
/// more.
std::vector<json::json_pointer> fields_of(const json& expected, const json::json_pointer& at) {
  std::vector<json::json_pointer> out;
  for (const auto& [key, value] : expected.items()) {
    if (key == "derivative_point_vdot" || key == "body" || key == "integrals" || key == "dM_fl_deta") continue;
    if (key == "residual_max" || key == "independent_rows" || key == "osi" || key == "gamma")
      continue;  // of constraints: they follow from the others
    const bool list_of_things = value.is_array() && !value.empty() && value[0].is_object();
    if (value.is_object() || list_of_things) {
      const auto more = list_of_things ? fields_of(value.back(), at / key / (value.size() - 1)) : fields_of(value, at / key);
      out.insert(out.end(), more.begin(), more.end());
    } else {
      out.push_back(at / key);
    }
  }
  return out;
}

class OracleCheck : public testing::TestWithParam<std::string> {};

TEST_P(OracleCheck, SeesEachWrongNumberAndEachMissingField) {
  const json good = vector_file(GetParam());
  ASSERT_EQ(verdict(good), kPass);
  const auto fields = fields_of(good["expected"], json::json_pointer());
  EXPECT_GE(fields.size(), 6u);
  for (const auto& field : fields) {
    const std::string name = field.to_string();
    json bad = good;
    json& value = bad["expected"][field];
    json& number = first_number(value);
    const double right = number.is_string() ? std::stod(number.get<std::string>()) : number.get<double>();
    for (const std::string& wrong : {fmt::format("{:.17g}", 1.0 + 2.0 * right), std::string("nan")}) {
      number = wrong;
      EXPECT_EQ(verdict(bad), kFail) << name << " = " << wrong;
    }
    bad = good;
    bad["expected"][field.parent_pointer()].erase(field.back());
    EXPECT_EQ(verdict(bad), kFail) << "without " << name;
  }
  json more = good;
  more["expected"]["new_quantity"] = {"1.0"};
  EXPECT_EQ(verdict(more), kFail) << "with a field that nobody compares";
}
// A chain; a loop; a body and a tree at three levels; more than nine components: no
// derivatives.
INSTANTIATE_TEST_SUITE_P(Of, OracleCheck,
                         testing::Values("14_chain_3r", "44_fourbar", "53_body_levels_translational", "58_levels_deforming_attachment",
                                         "25_flex_free_free_8"),
                         [](const auto& file) { return "File" + file.param; });

}  // namespace
}  // namespace cardan
