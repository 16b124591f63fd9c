// `cardan new`: a project of a plugin, outside of our tree, that builds and passes its tests as it is written.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>
#include <utility>

#include "core/base/units.hpp"
#include "core/io/result_folder.hpp"
#include "scripts/commands/commands.hpp"
#include "scripts/commands/templates.hpp"

namespace cardan {
namespace {

namespace fs = std::filesystem;

bool is_name(const std::string& s) {
  const auto plain = [](unsigned char c) { return c < 128 && (std::isalnum(c) || c == '_' || c == '-'); };
  return !s.empty() && std::isalpha(static_cast<unsigned char>(s[0])) && std::ranges::all_of(s, plain);
}

std::string filled(std::string text, const std::map<std::string, std::string>& values) {
  for (const auto& [what, with] : values)
    for (std::size_t at = 0; (at = text.find(what, at)) != text.npos; at += with.size()) text.replace(at, what.size(), with);
  return text;
}

int new_project(const std::string& kind, const std::string& type, std::string folder) {
  const std::vector<std::string> kinds{"hinge", "body", "device", "field"};
  if (std::ranges::find(kinds, kind) == kinds.end())
    refuse(Code::command_line, {"kind"}, fmt::format("{}", fmt::join(kinds, ", ")), in_quotes(kind), did_you_mean(kind, kinds));
  const auto slash = type.find('/');
  const std::string prefix = slash == type.npos ? "my" : type.substr(0, slash), name = slash == type.npos ? type : type.substr(slash + 1);
  const std::set<std::string> targets{"all", "clean", "edit_cache", "help", "install", "package", "rebuild_cache", "test"};
  if (!is_name(prefix) || !is_name(name) || targets.contains(name))
    refuse(Code::bad_name, {"name"}, "a letter, then letters, digits, `_` and `-`; no target of CMake's own", in_quotes(type),
           "roller, or with a prefix of your own acme/roller");
  if (folder.empty()) folder = name;
  std::error_code error;
  fs::path top = fs::absolute(folder).lexically_normal();
  if (!top.has_filename()) top = top.parent_path();  // "here/"
  if (fs::create_directories(top.parent_path(), error); !error && !fs::create_directory(top, error) && !error)
    refuse(Code::cannot_write, {{}, {folder}}, "a folder that is not there yet", "one that is", "--out OTHER_FOLDER");
  if (error) throw WriteError(Diagnostic{Code::cannot_write, {{}, {folder}}, "a folder that can be made", error.message()});
  const std::map<std::string, std::string> values{{"@KIND@", kind}, {"@NAME@", name}, {"@TYPE@", prefix + "/" + name}};
  for (const auto& [path, text] : project_templates()) {
    const auto end = path.find('/');
    if (const std::string of = path.substr(0, end); of != kind && of != "every") continue;
    const fs::path file = top / filled(path.substr(end + 1), {{"NAME", name}});
    fs::create_directories(file.parent_path(), error);
    if (std::ofstream out(file); !(out << filled(text, values) << std::flush)) {
      const std::string why = std::strerror(errno);
      fs::remove_all(top, error);  // no half of a project
      throw WriteError(Diagnostic{Code::cannot_write, {{}, {file.string()}}, "a file that can be written", why});
    }
  }
  fmt::print("{}: a plugin with the {} {}. Next:\n\n  cd {}\n  cmake -B build && cmake --build build && ctest --test-dir build\n", folder,
             kind, values.at("@TYPE@"), folder.find(' ') == std::string::npos ? folder : '"' + folder + '"');
  return 0;
}

}  // namespace

void add_new(CommandLine& line) {
  Command& command = line.command("new", "Write a project for a plugin with a type of your own: hinge, body, device or field");
  auto kind = std::make_shared<std::string>(), name = std::make_shared<std::string>(), out = std::make_shared<std::string>();
  command.option("kind", *kind, "hinge, body, device or field").required().type_name("KIND");
  command.option("name", *name, "What the type is called, also with a prefix: acme/roller").required().type_name("NAME");
  command.option("--out", *out, "The folder of the project (default: the name)").type_name("DIR");
  command.action([kind, name, out] { return new_project(*kind, *name, *out); });
}

}  // namespace cardan
