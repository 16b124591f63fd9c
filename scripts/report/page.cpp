#include "scripts/report/page.hpp"

// clang-format off
// EMBED(name, file): the bytes of a file, and a function that returns them.
#define EMBED(name, file)                                                                                 \
  __asm__(".section .rodata\n"                                                                            \
          "cardan_page_" #name ": .incbin \"" file "\"\n"                                                 \
          "cardan_page_" #name "_end: .byte 0\n"                                                          \
          ".previous\n");                                                                                 \
  extern "C" const char cardan_page_##name[], cardan_page_##name##_end[];                                 \
  std::string_view cardan::page::name() {                                                                 \
    return {cardan_page_##name, static_cast<std::size_t>(cardan_page_##name##_end - cardan_page_##name)}; \
  }
// clang-format on

EMBED(html, CARDAN_TEMPLATE)
EMBED(style, CARDAN_BUNDLE ".css")
EMBED(script, CARDAN_BUNDLE ".js")
EMBED(notice, CARDAN_NOTICE)
