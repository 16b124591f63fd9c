#include "scripts/report/differences.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/io/json.hpp"
#include "scripts/report/page.hpp"

namespace cardan {
namespace {

constexpr std::size_t kRowsOfWhatDiffers = 2000, kRowsOfTheRest = 300, kMostNumbers = 600'000;  // of 13 bytes each

/// With 12 digits: differences of two nearly equal numbers are drawn from them.
Json drawn(double value) {
  if (!std::isfinite(value)) return nullptr;
  const std::string text = fmt::format("{:.12g}", value);
  double near = value;
  std::from_chars(text.data(), text.data() + text.size(), near);
  return near;
}

/// Every n-th row, the last, and the worst.
std::vector<std::size_t> chosen_rows(const DifferencePart& part, std::size_t most) {
  const std::size_t n = part.t.size(), stride = (n + most - 1) / most;
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < n; ++i)
    if (i % stride == 0 || i + 1 == n || (part.worst && part.t[i] == part.worst->t)) rows.push_back(i);
  return rows;
}

Json series_of(const DifferencePart& part, const std::vector<std::size_t>& rows) {
  Json t = Json::array(), is = Json::array(), reference = Json::array();
  for (const std::size_t i : rows) {
    t.push_back(drawn(part.t[i]));
    is.push_back(drawn(part.is[i]));
    reference.push_back(drawn(part.reference[i]));
  }
  Json out = {{"t", std::move(t)}, {"is", std::move(is)}, {"reference", std::move(reference)}};
  if (rows.size() < part.t.size()) out["thinned"] = part.t.size();
  return out;
}

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(); }

}  // namespace

std::string differences_page(const std::string& title, const std::vector<std::string>& facts, const std::string& is,
                             const std::string& reference, const std::vector<DifferenceCase>& cases) {
  std::size_t numbers = 0;
  Json all = Json::array();
  for (const DifferenceCase& c : cases) {
    Json rows = Json::array();
    for (const DifferencePart& part : c.parts) {
      Json row = {{"kind", part.kind},
                  {"name", part.name},
                  {"unit", part.unit},
                  {"class", part.agreement},
                  {"text", part.text},
                  {"why", part.why},
                  {"verdict", part.pass ? "pass" : "fail"}};
      if (part.worst) row["share"] = finite(part.worst->share()), row["limit"] = finite(part.worst->limit);
      if (part.t.size() > 1) {
        const auto chosen = chosen_rows(part, part.pass ? kRowsOfTheRest : kRowsOfWhatDiffers);
        if (!part.pass || numbers + 3 * chosen.size() < kMostNumbers) {
          numbers += 3 * chosen.size();
          row["series"] = series_of(part, chosen);
        }
      }
      rows.push_back(std::move(row));
    }
    all.push_back(
        {{"name", c.name}, {"truth", c.truth}, {"text", c.text}, {"verdict", c.pass ? "pass" : "fail"}, {"rows", std::move(rows)}});
    if (c.wall_s > 0.0) all.back()["wall_s"] = c.wall_s;
  }
  return page::filled(title,
                      {{"title", title}, {"facts", facts}, {"is_name", is}, {"reference_name", reference}, {"cases", std::move(all)}},
                      page::differences());
}

}  // namespace cardan
