#pragma once
// What the processor that this runs on has (psABI levels of x86-64).

namespace cardan {

/// AVX2 and fused multiplications, of those of x86-64-v3 that code of ours needs.
inline bool has_x86_64_v3() {
#ifdef __x86_64__
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
#else
  return false;
#endif
}
/// AVX-512 in its parts of x86-64-v4.
inline bool has_x86_64_v4() {
#ifdef __x86_64__
  return has_x86_64_v3() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512vl");
#else
  return false;
#endif
}

}  // namespace cardan
