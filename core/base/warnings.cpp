#include "core/base/warnings.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/units.hpp"

namespace cardan {

void Warnings::add(Diagnostic warning, double t) {
  const auto same = [&](const Warning& w) {
    return w.what.code == warning.code && w.what.at.key_path == warning.at.key_path && w.what.at.mark.file == warning.at.mark.file &&
           w.what.at.mark.line == warning.at.mark.line;
  };
  if (const auto earlier = std::find_if(all_.begin(), all_.end(), same); earlier != all_.end())
    ++earlier->count;
  else if (all_.size() < kLimit)
    all_.push_back({std::move(warning), 1, t});
  else
    ++left_out_;
}

void Warnings::add(Code code, Located at, std::string about, std::string hint, double t) {
  add(Diagnostic{code, std::move(at), {}, {}, std::move(hint), {}, std::move(about)}, t);
}

void Warnings::add(const Warnings& others) {
  for (const Warning& w : others.all_) {
    const std::size_t before = all_.size();
    add(w.what, w.t);
    if (all_.size() > before) all_.back().count = w.count;  // else counted once more, as a kind
  }
  left_out_ += others.left_out_;
}

namespace {
/// "./scenario.lua" of a file in the folder; others, and "[modules]" of the program, as they are.
std::string name_in(const std::filesystem::path& folder, const std::string& file) {
  const std::string prefix = folder.empty() ? "" : (folder / "").string();
  const bool outside = file.empty() || !file.starts_with(prefix) || (prefix.empty() && (file[0] == '/' || file[0] == '['));
  return outside ? file : "./" + file.substr(prefix.size());
}
}  // namespace

void Warnings::remember(Archive& archive) {
  std::size_t n = all_.size();
  archive(n, left_out_);
  if (n > kLimit) archive.wrong("more warnings than are kept");
  all_.resize(n);
  for (Warning& w : all_) {
    std::string code(number_of(w.what.code)), file = name_in(folder_, w.what.at.mark.file);
    archive(code, w.what.at.key_path, file, w.what.at.mark.line, w.what.at.mark.column, w.what.about, w.what.hint, w.count, w.t);
    const auto known = find_code(code);
    if (!known || code[0] != 'W') archive.wrong("no warning has this code: " + in_quotes(code));
    w.what.code = *known;
    w.what.at.mark.file = file.starts_with("./") ? (folder_ / file.substr(2)).string() : file;
  }
}

std::string render(const Warning& w) {
  std::string text = render(w.what);
  if (w.count > 1)
    text += std::isnan(w.t) ? fmt::format("  {} times\n", w.count) : fmt::format("  {} times, first at t = {:.6g} s\n", w.count, w.t);
  else if (!std::isnan(w.t))
    text += fmt::format("  at t = {:.6g} s\n", w.t);
  return text;
}

std::string render(const Warnings& all) {
  if (all.empty()) return {};
  std::string text;
  for (const Warning& w : all.all()) text += render(w) + "\n";
  const long n = static_cast<long>(all.all().size()) + all.left_out();
  return text + fmt::format("{} warning{}{}.\n", n, n == 1 ? "" : "s",
                            all.left_out() > 0 ? fmt::format(", {} of them not shown", all.left_out()) : "");
}

}  // namespace cardan
