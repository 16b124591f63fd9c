#include "core/soa/kernels.hpp"

#include <cstdlib>
#include <string_view>

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
    const char* wish = std::getenv("CARDAN_KERNELS");
    const std::string_view name = wish ? wish : "";
    if (name == "v2" || !v3) return kernels_v2();
    if (name == "v3" || !v4) return kernels_v3();
    return kernels_v4();
  }();
  return picked;
}

}  // namespace cardan::soa
