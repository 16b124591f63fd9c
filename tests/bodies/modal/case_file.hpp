#pragma once
// The numbers of a published case: the list that follows `value:` of the quantity with the given beginning.
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace cardan {

inline std::vector<double> case_values(const std::string& id, const std::string& quantity) {
  std::ifstream in(CARDAN_SOURCE_DIR "/tests/reference/cases/" + id + ".yaml");
  std::stringstream text;
  text << in.rdbuf();
  const std::string all = text.str();
  const auto at = all.find("- quantity: " + quantity);
  if (at == std::string::npos) throw std::runtime_error(id + ": no quantity " + quantity);
  const auto open = all.find('[', all.find("value:", at)), close = all.find(']', open);
  std::istringstream list(all.substr(open + 1, close - open - 1));
  std::vector<double> values;
  for (std::string item; std::getline(list, item, ',');) values.push_back(std::stod(item));
  return values;
}

}  // namespace cardan
