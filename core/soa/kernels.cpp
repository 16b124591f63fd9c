#include "core/soa/kernels.hpp"

#include <cstdlib>
#include <string>

#include "core/base/diagnostic.hpp"
#include "core/soa/workspace_layout.hpp"

namespace cardan::soa {

template class Workspace<double>;
template class Workspace<Lanes<4>>;
template class Workspace<Lanes<8>>;

const Kernels& kernels() {
  static const Kernels& picked = []() -> const Kernels& {
    __builtin_cpu_init();
    const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
    const bool v4 = v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
                    __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512vl");
    const std::string best = v4 ? "v4" : v3 ? "v3" : "v2";
    const char* wish = std::getenv("CARDAN_KERNELS");
    const std::string name = wish && *wish ? wish : best;
    if (name == "v4" && v4) return kernels_v4();
    if (name == "v3" && v3) return kernels_v3();
    if (name == "v2") return kernels_v2();
    throw InputError(Diagnostic{Code::out_of_range, {"environment variable CARDAN_KERNELS", {}}, "v2, v3 or v4, up to " + best + " on this processor",
                                "\"" + name + "\"", "leave it out: the best that the processor can run is taken", "", "", 0});
  }();
  return picked;
}

}  // namespace cardan::soa
