#include "core/soa/kernels.hpp"

#include <cstdlib>
#include <string>
#include <string_view>

#include "core/base/diagnostic.hpp"
#include "core/base/processor.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::soa {

template class Workspace<double>;
template class Workspace<Lanes<2>>;
template class Workspace<Lanes<4>>;
template class Workspace<Lanes<8>>;

namespace {

bool runs_here(std::string_view name) { return name == "v2" || (name == "v3" ? has_x86_64_v3() : has_x86_64_v4()); }

// Those that are built are called (CARDAN_KERNELS).
[[maybe_unused]] InstructionSet v2() { return {"v2", sweeps_v2(), lanes_v2(), {}, {}, embedded_v2(), tangents_v2()}; }
[[maybe_unused]] InstructionSet v3() { return {"v3", sweeps_v3(), {}, lanes_v3(), {}, embedded_v3(), tangents_v3()}; }
[[maybe_unused]] InstructionSet v4() { return {"v4", sweeps_v4(), {}, {}, lanes_v4(), embedded_v4(), tangents_v4()}; }

InstructionSet pick() {
  struct Built {
    const char* name;
    InstructionSet (*set)();
  };
#define SET(name) \
  Built { #name, name }
  constexpr Built built[] = {CARDAN_KERNELS};  // core/CMakeLists.txt; the best comes last
#undef SET
  const char* wish = std::getenv("CARDAN_KERNELS");
  const std::string name = wish ? wish : "";
  const Built* picked = nullptr;
  std::string all, offered;
  for (const Built& one : built) {
    all += all.empty() ? one.name : std::string(", ") + one.name;
    if (!runs_here(one.name)) continue;
    offered += offered.empty() ? one.name : std::string(", ") + one.name;
    if (name.empty() || name == one.name) picked = &one;
  }
  if (picked) return picked->set();
  if (offered.empty())
    refuse(Code::out_of_range, {"processor"}, "one that runs the sweeps of this program: x86-64-" + all,
           runs_here("v3") ? "x86-64-v3" : "x86-64-v2",
           "./dev build, or cmake -D \"CARDAN_KERNELS=v2;v3;v4\", builds a program for every processor");
  refuse(Code::out_of_range, {"environment variable CARDAN_KERNELS"},
         "one of those that are built and that this processor runs: " + offered, "\"" + name + "\"",
         "leave it out: the best of them is taken");
}

}  // namespace

const InstructionSet& instruction_set() {
  static const InstructionSet picked = pick();
  return picked;
}

}  // namespace cardan::soa
