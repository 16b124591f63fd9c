#pragma once
// CARDAN_CLONES("default", "avx2") before a function: compiled for each of these instruction sets, the best that the processor has is taken
// at load. Under sanitizers for the first alone: what chooses runs before they are there.

#if !defined(__x86_64__) || !defined(__linux__) || defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define CARDAN_CLONES(...)
#elif defined(__clang__)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define CARDAN_CLONES(...)
#endif
#endif
#ifndef CARDAN_CLONES
#define CARDAN_CLONES(...) __attribute__((target_clones(__VA_ARGS__)))
#endif
