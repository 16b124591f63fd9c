#include <fmt/format.h>

#include "core/abi/laws.hpp"
#include "core/abi/registry.hpp"
#include "scripts/host/commands/commands.hpp"

namespace cardan {
namespace {

constexpr int kSamples = 64;

int check_plugin(const std::string& path) {
  Registry registry;
  load_plugin(path, registry);  // the laws at a few samples; its errors tell the first violation
  int violated = 0;
  for (const Registry::Entry& entry : registry.hinges()) {
    const auto violations = hinge_law_violations(*entry.family, kSamples);
    fmt::print("{:<6}hinge {}: {}\n", violations.empty() ? "ok" : "FAIL", entry.family->type, entry.family->summary);
    for (const std::string& v : violations) fmt::print("      {}\n", v);
    violated += violations.empty() ? 0 : 1;
  }
  return violated == 0 ? 0 : 1;
}

}  // namespace

void add_check_plugin(CLI::App& app, CommandLine& line) {
  auto* command = app.add_subcommand("check-plugin", "Check that the families of a plugin obey the laws");
  auto path = std::make_shared<std::string>();
  command->add_option("plugin", *path, "The shared library (.so)")->required()->type_name("PLUGIN");
  command->add_flag("--json-errors", line.json_errors, "Errors as JSON on standard error");
  command->callback([&line, path] { line.action = [path] { return check_plugin(*path); }; });
}

}  // namespace cardan
