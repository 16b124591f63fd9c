#include "scripts/report/page.hpp"

#include <utility>
#include <vector>

#include "core/base/embed.hpp"
#include "core/base/utf8.hpp"

CARDAN_EMBED(cardan::page, html, CARDAN_TEMPLATE)
CARDAN_EMBED(cardan::page, style, CARDAN_BUNDLE ".css")
CARDAN_EMBED(cardan::page, script, CARDAN_BUNDLE ".js")
CARDAN_EMBED(cardan::page, differences, CARDAN_DIFFERENCES ".js")
CARDAN_EMBED(cardan::page, precision, CARDAN_PRECISION ".js")
CARDAN_EMBED(cardan::page, campaign, CARDAN_CAMPAIGN ".js")
CARDAN_EMBED(cardan::page, notice, CARDAN_NOTICE)

namespace cardan::page {
namespace {

std::string replaced(std::string_view text, std::string_view what, std::string_view with) {
  std::string out;
  for (std::size_t from = 0;;) {
    const auto at = text.find(what, from);
    out += text.substr(from, at - from);
    if (at == std::string_view::npos) return out;
    out += with;
    from = at + what.size();
  }
}

/// The template with its marks (@title@) filled in, in one pass: what is put in is not searched.
std::string with_parts(std::string_view html, const std::vector<std::pair<std::string_view, std::string>>& parts) {
  std::string out;
  for (const auto& [mark, text] : parts) {
    const auto at = html.find(mark);
    out.append(html.substr(0, at)).append(text);
    html.remove_prefix(at + mark.size());
  }
  return out.append(html);
}

}  // namespace

std::string filled(const std::string& title, const Json& data, std::string_view script) {
  return with_parts(html(), {{"@title@", xml_text(title)},
                             {"@style@", std::string(style())},
                             {"@data@", replaced(json_line(data), "<", "\\u003c")},
                             {"@notice@", std::string(notice())},
                             {"@script@", replaced(script, "</script", "<\\/script")}});
}

}  // namespace cardan::page
