#include "scripts/import/source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/base/units.hpp"
#include "core/spatial/rotation.hpp"

namespace cardan {
namespace {

/// As files of robots write them: "1.", ".5", "+2", "1e-3".
std::optional<double> decimal(std::string_view word) {
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

constexpr std::string_view kSpaces = " \t\r\n";

std::string counted(const std::map<std::string, int>& counts) {
  std::string out;
  for (const auto& [what, n] : counts) out += fmt::format("{}{} {}", out.empty() ? "" : ", ", n, what);
  return out;
}

}  // namespace

const XmlAttribute* XmlView::find(std::string_view names) const {
  const auto of = [&](const XmlElement& e) -> const XmlAttribute* {
    const auto found = std::ranges::find_if(e.attributes, [&](const XmlAttribute& a) { return is_word_of(names, a.name); });
    return found == e.attributes.end() ? nullptr : &*found;
  };
  if (const XmlAttribute* own = of(element)) return own;
  for (const XmlDefaults* d = defaults; d; d = d->parent) {
    const auto found = d->elements.find(tag.empty() ? std::string_view(element.name) : tag);
    if (found == d->elements.end()) continue;
    if (const XmlAttribute* a = of(*found->second)) return a;
  }
  return nullptr;
}

void RobotSource::report(Code code, const XmlElement& e, std::string_view attribute, std::string expected, std::string got,
                         std::string hint) {
  const XmlAttribute* a = attribute.empty() ? nullptr : e.attribute(attribute);
  sink.report(Diagnostic{code,
                         {path_of(e, attribute), a ? a->mark : e.mark},
                         std::move(expected),
                         std::move(got),
                         std::move(hint),
                         {},
                         {},
                         static_cast<int>(a ? attribute.size() : e.name.size())});
}

std::vector<double> RobotSource::numbers(const XmlView& v, std::string_view attribute, std::size_t n, const std::vector<double>* otherwise,
                                         std::size_t at_most) {
  const XmlAttribute* a = v.find(attribute);
  const std::vector<double> fallback = otherwise ? *otherwise : std::vector<double>(n, 0.0);
  const std::string several = std::max(n, at_most) == 1 ? "a number"
                              : at_most > n             ? fmt::format("{} to {} numbers", n, at_most)
                                                        : fmt::format("{} numbers", n);
  if (!a) {
    if (!otherwise) report(Code::missing_key, v.element, attribute, fmt::format("{}: {}", attribute, several), "no such attribute");
    return fallback;
  }
  const auto fault = [&](Code code, std::string got) {
    sink.report(Diagnostic{
        code, {path_of(v.element, attribute), a->mark}, several, std::move(got), {}, {}, {}, static_cast<int>(attribute.size())});
    return fallback;
  };
  std::vector<double> out;
  const std::string_view text = a->value;
  for (std::size_t at = text.find_first_not_of(kSpaces); at != text.npos; at = text.find_first_not_of(kSpaces, at)) {
    const std::size_t end = std::min(text.find_first_of(kSpaces, at), text.size());
    const auto number = decimal(text.substr(at, end - at));
    if (!number) return fault(Code::bad_number, in_quotes(text.substr(at, end - at)));
    if (out.size() >= std::max(n, at_most)) return fault(Code::wrong_type, in_quotes(text));
    out.push_back(*number);
    at = end;
  }
  if (out.size() < n) return fault(Code::wrong_type, in_quotes(text));
  return out;
}

double RobotSource::number(const XmlView& v, std::string_view attribute, std::optional<double> otherwise) {
  const std::vector<double> fallback{otherwise.value_or(0.0)};
  return numbers(v, attribute, 1, otherwise ? &fallback : nullptr)[0];
}

Vec3<double> RobotSource::vector(const XmlView& v, std::string_view attribute, std::optional<Vec3<double>> otherwise) {
  const Vec3<double> o = otherwise.value_or(Vec3<double>{});
  const std::vector<double> fallback{o.x, o.y, o.z};
  const std::vector<double> x = numbers(v, attribute, 3, otherwise ? &fallback : nullptr);
  return {x[0], x[1], x[2]};
}

std::string RobotSource::text(const XmlView& v, std::string_view attribute) {
  const XmlAttribute* a = v.find(attribute);
  if (!a || a->value.empty()) {
    report(Code::missing_key, v.element, attribute, fmt::format("{}: a text", attribute), a ? "an empty one" : "no such attribute");
    return {};
  }
  return a->value;
}

bool RobotSource::asked_to_leave_out(const std::string& feature, std::string_view name) {
  for (const std::string& asked : options.leave_out) {
    if (asked != feature && (name.empty() || asked != name)) continue;
    used_.insert(asked);
    ++asked_[feature];
    return true;
  }
  return false;
}

bool RobotSource::cannot(const XmlElement& e, const std::string& feature, std::string why, std::string hint) {
  if (asked_to_leave_out(feature, e.called())) return true;
  const std::string option =
      fmt::format("--leave-out {} does without it", feature.find(' ') == feature.npos ? feature : in_quotes(feature));
  const bool of_attribute = e.attribute(feature) != nullptr;
  report(Code::not_imported, e, of_attribute ? std::string_view(feature) : std::string_view(), std::move(why), in_quotes(feature),
         hint.empty() ? option : hint + "; " + option);
  return false;
}

void RobotSource::expect_attributes(const XmlElement& e, std::string_view known, std::string_view ignored) {
  for (const XmlAttribute& a : e.attributes) {
    if (is_word_of(known, a.name) || is_word_of(ignored, a.name)) continue;
    if (asked_to_leave_out(a.name, {})) continue;
    std::vector<std::string> words;
    for (std::size_t at = 0; at < known.size();) {
      const std::size_t end = std::min(known.find(' ', at), known.size());
      words.emplace_back(known.substr(at, end - at));
      at = end + 1;
    }
    const std::string meant = did_you_mean(a.name, words);
    report(Code::unknown_key, e, a.name, fmt::format("an attribute of {}: {}", e.name, known), in_quotes(a.name),
           meant.empty() ? fmt::format("--leave-out {} does without it", in_quotes(a.name)) : meant);
  }
}

std::vector<std::string> RobotSource::notes() {
  for (const std::string& asked : options.leave_out)
    if (!used_.contains(asked))
      refuse(Code::command_line, {"--leave-out"}, "the name of something in the file that cannot be honoured", in_quotes(asked));
  std::vector<std::string> out;
  if (!left_.empty()) out.push_back("left out, without meaning here: " + counted(left_));
  if (!forces_.empty()) out.push_back("left to devices of the vehicle and to the mission, no force here: " + counted(forces_));
  if (!asked_.empty()) out.push_back("left out, as asked for: " + counted(asked_));
  out.insert(out.end(), notes_.begin(), notes_.end());
  return out;
}

bool is_word_of(std::string_view words, std::string_view word) {
  for (std::size_t at = 0; !word.empty() && (at = words.find(word, at)) != words.npos; ++at) {
    const std::size_t end = at + word.size();
    if ((at == 0 || words[at - 1] == ' ') && (end == words.size() || words[end] == ' ')) return true;
  }
  return false;
}

Mat3<double> rotation_of_rpy(const Vec3<double>& rpy) {
  const auto about = [](const Vec3<double>& u, double q) { return rotation_about(u, std::sin(q), std::cos(q)); };
  return about({0, 0, 1}, rpy.z) * about({0, 1, 0}, rpy.y) * about({1, 0, 0}, rpy.x);
}

Mat3<double> rotation_of_z_to(const Vec3<double>& d) {
  const double size = length(d), c = d.z / size, s = std::hypot(d.x, d.y) / size;
  if (s == 0.0) return c > 0 ? Mat3<double>::identity() : rotation_about(Vec3<double>{1, 0, 0}, 0.0, -1.0);
  return rotation_about(Vec3<double>{-d.y / (s * size), d.x / (s * size), 0.0}, s, c);
}

double length(const Vec3<double>& v) { return std::sqrt(dot(v, v)); }
std::string list_of(const Vec3<double>& v) { return fmt::format("[{}, {}, {}]", v.x + 0.0, v.y + 0.0, v.z + 0.0); }

}  // namespace cardan
