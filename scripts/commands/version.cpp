#include "core/base/version.hpp"

#include <fmt/format.h>

#include "core/linalg/sparse_factor.hpp"
#include "core/soa/kernels.hpp"
#include "scripts/commands/commands.hpp"

namespace cardan {

void add_version(CommandLine& line) {
  const auto tell = [] {
    fmt::print("cardan {} ({})\n{}\n{}\nsweeps: x86-64-{}\nfactors of finite-element models: {}\n", version::kNumber,
               *version::kCommit ? version::kCommit : "no commit", version::kCompiler, version::kFlags, soa::instruction_set().name,
               SparseFactor::origin());
    return 0;
  };
  const char* what = "Tell the version, and how it was built";
  line.command("version", what).action(tell);
  line.option_alone("--version", tell, what);
}

}  // namespace cardan
