#pragma once
// Whether this is a build with a sanitizer: those bring their own malloc, and are optimised less.
namespace cardan::test {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define CARDAN_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define CARDAN_SANITIZED 1
#endif
#endif
#ifdef CARDAN_SANITIZED
inline constexpr bool sanitized = true;
#else
inline constexpr bool sanitized = false;
#endif
}  // namespace cardan::test
