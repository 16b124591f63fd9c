# Headers of others that most of our files read, parsed once for all of them by GCC (a third of the work of building the program).
# None of ours is among them, but one that only names loops of Eigen: to edit one must not rebuild everything. Clang reads every header
# where it is included, so ./dev clang shows that each file includes what it uses.
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(CMAKE_DISABLE_PRECOMPILE_HEADERS ON)
endif()
set(CARDAN_HEADERS <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <limits> <map> <memory> <mutex> <numbers> <numeric>
    <optional> <random> <ranges> <set> <span> <sstream> <string> <string_view> <utility> <variant> <vector>
    <fmt/format.h> <Eigen/Dense> <Eigen/SparseCore>
    ${PROJECT_SOURCE_DIR}/core/linalg/eigen_kernels.hpp)

# Owners of the compiled headers. A target that uses them must have their flags and definitions, else GCC says so, but for -O: there it
# silently takes that of the headers. So there are two sets.
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/generated/headers.cpp CONTENT "")
foreach(owner cardan_headers cardan_headers_cold)
  add_library(${owner} STATIC ${PROJECT_BINARY_DIR}/generated/headers.cpp)
  target_link_libraries(${owner} PRIVATE cardan_flags fmt::fmt Eigen3::Eigen)
  target_precompile_headers(${owner} PRIVATE ${CARDAN_HEADERS})
endforeach()
target_compile_options(cardan_headers_cold PRIVATE -O1)

# cardan_precompiled(TARGET HEADERS...)  TARGET uses the compiled headers; with HEADERS it compiles its own, of these too.
# cardan_precompiled_cold(TARGET)  those of -O1, with which TARGET is compiled.
function(cardan_precompiled target)
  target_link_libraries(${target} PRIVATE cardan_eigen_kernels)
  if(ARGN)
    target_precompile_headers(${target} PRIVATE ${CARDAN_HEADERS} ${ARGN})
  else()
    target_precompile_headers(${target} REUSE_FROM cardan_headers)
  endif()
endfunction()
function(cardan_precompiled_cold target)
  target_link_libraries(${target} PRIVATE cardan_eigen_kernels)
  target_compile_options(${target} PRIVATE -O1)
  target_precompile_headers(${target} REUSE_FROM cardan_headers_cold)
endfunction()
