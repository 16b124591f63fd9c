#include "core/io/checkpoint_text.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "core/base/units.hpp"
#include "core/io/json.hpp"

namespace cardan {
namespace {

constexpr int kFormat = 1;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Json number(double x) {
  if (std::isfinite(x)) return x;
  return std::isnan(x) ? "nan" : x > 0 ? "inf" : "-inf";
}

double number_of(const Json& value) {
  if (value.is_number()) return value.get<double>();
  const auto text = value.get<std::string>();
  if (text == "nan") return std::numeric_limits<double>::quiet_NaN();
  if (text == "inf" || text == "-inf") return text == "inf" ? kInfinity : -kInfinity;
  throw CheckpointFault(in_quotes(text) + " is no number");
}

}  // namespace

std::string checkpoint_text(const Checkpoint& checkpoint) {
  Json blocks = Json::object();
  for (const auto& [name, block] : checkpoint) {
    Json numbers = Json::array();
    for (const double x : block.numbers) numbers.push_back(number(x));
    blocks[name] = {{"numbers", std::move(numbers)}, {"texts", block.texts}};
  }
  return json_line({{"format", kFormat}, {"blocks", std::move(blocks)}});
}

Checkpoint checkpoint_of(std::string_view text) {
  Checkpoint all;
  try {
    const Json json = Json::parse(text);
    const auto format = json.at("format").get<double>();
    if (format != kFormat) throw CheckpointFault(fmt::format("format {}: this program reads {}", format, kFormat));
    for (const auto& [name, block] : json.at("blocks").items()) {
      CheckpointBlock& b = all[name];
      for (const Json& x : block.at("numbers")) b.numbers.push_back(number_of(x));
      b.texts = block.at("texts").get<std::vector<std::string>>();
    }
  } catch (const Json::exception& e) {
    throw CheckpointFault(e.what());
  }
  return all;
}

}  // namespace cardan
