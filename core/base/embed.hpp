#pragma once
// Files that become part of the program at build time.
#include <string_view>

// clang-format off
/// CARDAN_EMBED(space, name, file), outside of every namespace: the function space::name() returns the bytes of `file`. The source
/// that uses it names the file in its property OBJECT_DEPENDS.
#define CARDAN_EMBED(space, name, file)                                                                           \
  __asm__(".section .rodata\n"                                                                                    \
          "cardan_embedded_" #name ": .incbin \"" file "\"\n"                                                     \
          "cardan_embedded_" #name "_end: .byte 0\n"                                                              \
          ".previous\n");                                                                                         \
  extern "C" const char cardan_embedded_##name[], cardan_embedded_##name##_end[];                                 \
  std::string_view space::name() {                                                                                \
    return {cardan_embedded_##name, static_cast<std::size_t>(cardan_embedded_##name##_end - cardan_embedded_##name)}; \
  }
// clang-format on
