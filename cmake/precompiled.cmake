# Headers of others that most of our files read, parsed once for all of them by GCC (a third of the work of building the program).
# None of ours is among them: to edit one must not rebuild everything. Clang reads every header where it is included, so ./dev clang
# shows that each file includes what it uses.
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(CMAKE_DISABLE_PRECOMPILE_HEADERS ON)
endif()
set(CARDAN_HEADERS <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <limits> <map> <memory> <mutex> <numbers> <numeric>
    <optional> <random> <ranges> <set> <span> <sstream> <string> <string_view> <utility> <variant> <vector>
    <fmt/format.h> <nlohmann/json.hpp> <CLI/CLI.hpp> <Eigen/Dense> <Eigen/SparseCore>)

# Owner of the compiled headers; a target that uses them must have its flags and definitions (but for -O), else GCC says so.
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/generated/headers.cpp CONTENT "")
add_library(cardan_headers STATIC ${CMAKE_BINARY_DIR}/generated/headers.cpp)
target_link_libraries(cardan_headers PRIVATE cardan_flags fmt::fmt Eigen3::Eigen nlohmann_json::nlohmann_json CLI11::CLI11)
target_precompile_headers(cardan_headers PRIVATE ${CARDAN_HEADERS})

# cardan_precompiled(TARGET HEADERS...)  TARGET uses the compiled headers; with HEADERS it compiles its own, of these too.
function(cardan_precompiled target)
  if(ARGN)
    target_precompile_headers(${target} PRIVATE ${CARDAN_HEADERS} ${ARGN})
  else()
    target_precompile_headers(${target} REUSE_FROM cardan_headers)
  endif()
endfunction()
