#pragma once
// The numbers of a published case: what follows `value:` of the quantity with the given beginning, a list or one number.
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/support/accuracy.hpp"

namespace cardan {

inline std::vector<double> case_values(const std::string& id, const std::string& quantity) {
  test::case_at_hand() = id;
  std::ifstream in(CARDAN_SOURCE_DIR "/tests/reference/cases/" + id + ".yaml");
  std::stringstream text;
  text << in.rdbuf();
  const std::string all = text.str();
  const auto at = all.find("- quantity: " + quantity);
  if (at == std::string::npos) throw std::runtime_error(id + ": no quantity " + quantity);
  const auto begin = all.find_first_not_of(' ', all.find("value:", at) + 6);
  if (all[begin] != '[') return {std::stod(all.substr(begin, all.find('\n', begin) - begin))};
  std::istringstream list(all.substr(begin + 1, all.find(']', begin) - begin - 1));
  std::vector<double> values;
  for (std::string item; std::getline(list, item, ',');) values.push_back(std::stod(item));
  return values;
}

}  // namespace cardan
