#pragma once
// Counts every malloc of the program (operator new and Eigen end there). Include in exactly one .cpp of a test program.
// Sanitizers bring their own malloc: there `counting` is false and nothing is counted.
#include <atomic>
#include <cstddef>

#include "tests/support/sanitized.hpp"

namespace cardan::test {
inline std::atomic<long> malloc_calls = 0;
inline constexpr bool counting = !sanitized;
}  // namespace cardan::test

#ifndef CARDAN_SANITIZED
extern "C" void* __libc_malloc(std::size_t size);
extern "C" __attribute__((visibility("default"))) void* malloc(std::size_t size) {
  ++cardan::test::malloc_calls;
  return __libc_malloc(size);
}
#endif
