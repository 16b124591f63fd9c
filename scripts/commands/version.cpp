#include "core/base/version.hpp"

#include <fmt/format.h>

#include "core/linalg/sparse_factor.hpp"
#include "core/soa/kernels.hpp"
#include "scripts/commands/commands.hpp"

namespace cardan {

void add_version(CLI::App& app, CommandLine& line) {
  const auto tell = [&line] {
    line.action = [] {
      fmt::print("cardan {} ({})\n{}\n{}\nsweeps: x86-64-{}\nfactors of finite-element models: {}\n", version::kNumber,
                 *version::kCommit ? version::kCommit : "no commit", version::kCompiler, version::kFlags, soa::instruction_set().name,
                 SparseFactor::origin());
      return 0;
    };
  };
  const char* what = "Tell the version, and how it was built";
  auto* command = app.add_subcommand("version", what);
  command->add_flag("--json-errors", line.json_errors, "Errors as JSON on standard error");
  command->callback(tell);
  app.add_flag_callback("--version", tell, what);
}

}  // namespace cardan
