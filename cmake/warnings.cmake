# cardan_flags: what every target of ours is compiled with. No -ffast-math and no -march=native anywhere:
# the same source gives the same bits on every x86-64 machine.
add_library(cardan_flags INTERFACE)
target_compile_options(cardan_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wconversion -Wno-sign-conversion -Wshadow -Wnon-virtual-dtor -Werror
  $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict -Wno-array-bounds -Wno-stringop-overflow>   # gcc 12: false on temporaries with strings
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1000000>   # kB before gcc collects its garbage: a fifth of the time to compile
  $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>   # for ccache: it preprocesses what includes precompiled headers
  -ffp-contract=off -fvisibility=hidden -fvisibility-inlines-hidden)
target_compile_definitions(cardan_flags INTERFACE EIGEN_MAX_ALIGN_BYTES=32)   # part of the plugin stamp
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")
if(CARDAN_SANITIZE)
  target_compile_options(cardan_flags INTERFACE -fsanitize=${CARDAN_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    target_compile_options(cardan_flags INTERFACE -fsanitize-ignorelist=${PROJECT_SOURCE_DIR}/cmake/sanitizer_ignore.txt)
  endif()
  target_compile_definitions(cardan_flags INTERFACE _GLIBCXX_ASSERTIONS)
  target_link_options(cardan_flags INTERFACE -fsanitize=${CARDAN_SANITIZE})
endif()
