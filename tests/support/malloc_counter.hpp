#pragma once
// Counts every malloc of the program (operator new and Eigen end there). Include in exactly one .cpp of a test program.
// Sanitizers bring their own malloc: there `counting` is false and nothing is counted.
#include <atomic>
#include <cstddef>

namespace cardan::test {
inline std::atomic<long> malloc_calls = 0;
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool counting = false;
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
inline constexpr bool counting = false;
#define CARDAN_NO_MALLOC_COUNTER
#else
inline constexpr bool counting = true;
#endif
#else
inline constexpr bool counting = true;
#endif
}  // namespace cardan::test

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !defined(CARDAN_NO_MALLOC_COUNTER)
extern "C" void* __libc_malloc(std::size_t size);
extern "C" __attribute__((visibility("default"))) void* malloc(std::size_t size) {
  ++cardan::test::malloc_calls;
  return __libc_malloc(size);
}
#endif
