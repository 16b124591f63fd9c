#include "core/base/version.hpp"

#include <fmt/format.h>

#include "core/soa/kernels.hpp"
#include "scripts/host/commands/commands.hpp"

namespace cardan {

void add_version(CLI::App& app, CommandLine& line) {
  app.add_subcommand("version", "Tell the version, and how it was built")->callback([&line] {
    line.action = [] {
      fmt::print("cardan {} ({})\n{}\n{}\nsweeps: x86-64-{}\n", version::kNumber, *version::kCommit ? version::kCommit : "no commit",
                 version::kCompiler, version::kFlags, soa::kernels().name);
      return 0;
    };
  });
}

}  // namespace cardan
