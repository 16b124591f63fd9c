#pragma once
// JSON as we write and read it. The only place that names nlohmann-json.
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/warnings.hpp"

namespace cardan {

using Json = nlohmann::ordered_json;  // keys stay in the order of insertion

/// Indented text; numbers come back bit by bit. Throws NumericsError N0108 with the place of a number that is not
/// finite (JSON has no NaN, and a silent null would pass for "not measured").
std::string json_text(const Json& value);
/// The same, but null for such a number.
std::string json_text_with_nulls(const Json& value);
/// The same without line breaks.
std::string json_line(const Json& value);

/// What `--json-errors` prints, one object per error.
Json to_json(const Diagnostic& diagnostic);
Json to_json(const RunFailure& failure);
/// `about` is what is wrong, `path` the key path; `t` is null for what was seen before the run.
Json to_json(const Warning& warning);

}  // namespace cardan
