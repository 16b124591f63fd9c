#include "core/io/json.hpp"

#include <charconv>
#include <cmath>
#include <string_view>

namespace cardan {
namespace {

void expect_finite(const Json& value, const std::string& place) {
  if (value.is_number_float() && !std::isfinite(value.get<double>()))
    throw NumericsError(
        {Code::not_finite, 0.0, "", "", "result " + place,
         "products of numbers of the run are beyond 1.8e308: masses, lengths, rates or loads of more than some 1e100, often a unit or "
         "an exponent",
         ""});
  if (value.is_structured())
    for (const auto& [key, item] : value.items()) expect_finite(item, place + "/" + key);
}

std::string checked(const Json& value, int indent) {
  expect_finite(value, "");
  return value.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::string json_text(const Json& value) { return checked(value, 2) + "\n"; }
std::string json_text_with_nulls(const Json& value) { return value.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"; }
std::string json_line(const Json& value) { return checked(value, -1); }

Json to_json(const Diagnostic& d) {
  return {{"code", number_of(d.code)},
          {"title", d.about.empty() ? title_of(d.code) : d.about},
          {"file", d.at.mark.file},
          {"line", d.at.mark.line},
          {"column", d.at.mark.column},
          {"at", d.at.key_path},
          {"expected", d.expected},
          {"got", d.got},
          {"hint", d.hint},
          {"stack", d.stack}};
}

Json to_json(const RunFailure& f) {
  // Where a script failed its place is a line of `what`: "  --> scenario.lua:4".
  constexpr std::string_view kArrow = "\n  --> ";
  std::string file;
  int line = 0;
  if (const std::size_t at = f.what.find(kArrow); at != std::string::npos) {
    const std::size_t first = at + kArrow.size();
    file = f.what.substr(first, f.what.find('\n', first) - first);
    if (const std::size_t colon = file.rfind(':'); colon != std::string::npos) {
      std::from_chars(file.data() + colon + 1, file.data() + file.size(), line);
      file.resize(colon);
    }
  }
  return {{"code", number_of(f.code)},
          {"title", title_of(f.code)},
          {"t", std::isnan(f.t) ? Json() : Json(f.t)},
          {"body", f.body},
          {"hinge", f.hinge},
          {"what", f.what},
          {"file", file},
          {"line", line},
          {"hint", f.hint},
          {"last_good", f.last_good}};
}

Json to_json(const Warning& w) {
  const Diagnostic& d = w.what;
  return {{"code", number_of(d.code)},
          {"about", d.about.empty() ? title_of(d.code) : d.about},
          {"path", d.at.key_path},
          {"file", d.at.mark.file},
          {"line", d.at.mark.line},
          {"count", w.count},
          {"t", std::isfinite(w.t) ? Json(w.t) : Json()},
          {"hint", d.hint}};
}

}  // namespace cardan
