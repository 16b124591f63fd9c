# cardan_library(NAME DEPS...)  every .cpp of the current folder (minus those in EXCLUDE) becomes the static library NAME.
# COLD: not part of a step; compiled with -O1, which halves its build time.
# Layers are link dependencies: what is not in DEPS cannot be linked, and check_layers.cmake sees that it is not included.
function(cardan_library name)
  cmake_parse_arguments(A "COLD" "FOLDER" "DEPS;EXCLUDE" ${ARGN})
  set(folder ${CMAKE_CURRENT_SOURCE_DIR}/${A_FOLDER})
  file(GLOB sources CONFIGURE_DEPENDS ${folder}/*.cpp)
  foreach(file ${A_EXCLUDE})
    list(REMOVE_ITEM sources ${folder}/${file})
  endforeach()
  if(sources)
    add_library(${name} STATIC ${sources})
    target_include_directories(${name} PUBLIC ${CMAKE_SOURCE_DIR})
    target_link_libraries(${name} PUBLIC ${A_DEPS} PRIVATE cardan_flags)
    target_compile_definitions(${name} PUBLIC EIGEN_MAX_ALIGN_BYTES=32)
    if(A_COLD)
      target_compile_options(${name} PRIVATE -O1)
    endif()
  else()
    add_library(${name} INTERFACE)
    target_include_directories(${name} INTERFACE ${CMAKE_SOURCE_DIR})
    target_link_libraries(${name} INTERFACE ${A_DEPS})
    target_compile_definitions(${name} INTERFACE EIGEN_MAX_ALIGN_BYTES=32)
  endif()
endfunction()

# cardan_external_source(NAME FILE EXTERNAL... [DEPS ours...])  the one .cpp that may touch a third-party library.
function(cardan_external_source name file)
  cmake_parse_arguments(A "" "" "DEPS;EXTERNAL" ${ARGN})
  if(NOT EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${file})
    add_library(${name} INTERFACE)
    return()
  endif()
  add_library(${name} STATIC ${file})
  target_include_directories(${name} PUBLIC ${CMAKE_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${A_DEPS} PRIVATE cardan_flags ${A_EXTERNAL})
endfunction()

# cardan_plugin(NAME FILES...)  a shared library that exports one symbol and links nothing of Cardan.
function(cardan_plugin name)
  add_library(${name} MODULE ${ARGN})
  set_target_properties(${name} PROPERTIES PREFIX "" LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/plugins)
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE cardan_flags Eigen3::Eigen)
endfunction()

# cardan_test(NAME FOLDER LABEL DEPS...)  one GoogleTest program out of the .cpp files of a folder, cases found when ctest starts.
function(cardan_test name)
  cmake_parse_arguments(A "" "FOLDER;LABEL" "DEPS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${A_FOLDER}/*.cpp)
  if(NOT sources)
    return()
  endif()
  add_executable(${name} ${sources})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  target_compile_options(${name} PRIVATE -O1)   # half the build time; what is tested keeps its own flags
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR})
  target_compile_definitions(${name} PRIVATE CARDAN_SOURCE_DIR="${CMAKE_SOURCE_DIR}" CARDAN_BINARY_DIR="${CMAKE_BINARY_DIR}")
  target_link_libraries(${name} PRIVATE cardan_flags ${A_DEPS} GTest::gtest_main)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60 
    PROPERTIES LABELS "${A_LABEL}" TIMEOUT 600 RESOURCE_LOCK ${name})   # cases of one program share scratch files
endfunction()
