#include "scripts/commands/gathered_warnings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <string_view>

namespace cardan {

std::vector<Warning> gathered(std::span<const Warning> all) {
  constexpr std::size_t kNamed = 3;  // of those that are alike
  std::vector<Warning> out;
  std::vector<std::vector<std::string>> others;
  std::map<std::string, std::size_t> known;
  for (const Warning& w : all) {
    const std::string_view path = w.what.at.key_path, about = w.what.about;
    const std::size_t begin = path.find('.');  // of "bodies.wing.modal"
    const std::string_view name = begin == path.npos ? "" : path.substr(begin + 1, path.find('.', begin + 1) - begin - 1);
    const bool named = !name.empty() && about.starts_with(name);
    const std::string says =
        fmt::format("{}\n{}\n{}\n{}\n{}\n{}", number_of(w.what.code), path.substr(0, begin),
                    name.empty() ? "" : path.substr(begin + 1 + name.size()), named, about.substr(named ? name.size() : 0), w.what.hint);
    const auto [at, first] = known.try_emplace(says, out.size());
    if (first || name.empty())
      out.push_back(w), others.emplace_back();
    else
      others[at->second].emplace_back(name);
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (others[i].empty()) continue;
    const std::size_t more = others[i].size() - std::min(kNamed, others[i].size());
    others[i].resize(others[i].size() - more);
    out[i].what.hint += fmt::format("{}the same of {}{}", out[i].what.hint.empty() ? "" : "; ", fmt::join(others[i], ", "),
                                    more > 0 ? fmt::format(" and {} more", more) : "");
  }
  return out;
}

std::string told(const Warnings& all) {
  const std::string each = render(all);
  if (each.empty()) return each;
  std::string text;
  for (const Warning& w : gathered(all.all())) text += render(w) + "\n";
  return text + each.substr(each.rfind('\n', each.size() - 2) + 1);
}

}  // namespace cardan
