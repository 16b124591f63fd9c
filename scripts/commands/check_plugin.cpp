#include <fmt/format.h>

#include <algorithm>

#include "core/abi/kinds.hpp"
#include "core/abi/plugin_host.hpp"
#include "scripts/commands/commands.hpp"

namespace cardan {
namespace {

constexpr int kSamples = 1000;

int check_plugin(const std::string& path) {
  bool good = true;
  for (const PluginFamily& f : examine_plugin(path, kSamples)) {
    fmt::print("{:<6}{} {}: {}\n", f.violations.empty() ? "ok" : "FAIL", f.kind->word, f.type,
               f.family && f.kind->faults(f.family).empty() ? f.summary : "its table is refused");
    constexpr std::size_t kMost = 20;
    for (std::size_t i = 0; i < std::min(f.violations.size(), kMost); ++i) fmt::print("      {}\n", f.violations[i]);
    if (f.violations.size() > kMost) fmt::print("      and {} more\n", f.violations.size() - kMost);
    good = good && f.violations.empty();
  }
  return good ? 0 : 1;
}

}  // namespace

void show_plugin_messages() {
  on_plugin_message([](const std::string& file, std::uint32_t severity, const std::string& text) {
    const char* word = severity >= CARDAN_LOG_ERROR ? "error: " : severity == CARDAN_LOG_WARNING ? "warning: " : "";
    fmt::print(stderr, "{}: {}{}\n", file, word, text);
  });
}

void add_check_plugin(CLI::App& app, CommandLine& line) {
  auto* command = app.add_subcommand("check-plugin", "Check that the families of a plugin obey the laws");
  auto path = std::make_shared<std::string>();
  command->add_option("plugin", *path, "The shared library (.so)")->required()->type_name("PLUGIN");
  command->add_flag("--json-errors", line.json_errors, "Errors as JSON on standard error");
  command->callback([&line, path] { line.action = [path] { return check_plugin(*path); }; });
}

}  // namespace cardan
