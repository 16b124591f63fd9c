# cardan_unity(TARGET SIZE)  with CARDAN_UNITY the sources of TARGET are compiled in batches of SIZE (0: in one), but for those that have
# options or definitions of their own.
function(cardan_unity target size)
  set_target_properties(${target} PROPERTIES UNITY_BUILD ${CARDAN_UNITY} UNITY_BUILD_BATCH_SIZE ${size})
endfunction()

# cardan_library(NAME DEPS...)  every .cpp of the current folder (minus those in EXCLUDE; of ONLY, if given) becomes the static library NAME.
# COLD: not part of a step; compiled with -O1, which halves its build time.
# HEADERS: more headers of others that all of its files read, to be parsed once (precompiled.cmake).
# Layers are link dependencies: what is not in DEPS cannot be linked, and check_layers.cmake sees that it is not included.
function(cardan_library name)
  cmake_parse_arguments(A "COLD" "FOLDER" "DEPS;EXCLUDE;ONLY;HEADERS" ${ARGN})
  set(folder ${CMAKE_CURRENT_SOURCE_DIR}/${A_FOLDER})
  file(GLOB sources CONFIGURE_DEPENDS ${folder}/*.cpp)
  if(A_ONLY)
    list(TRANSFORM A_ONLY PREPEND ${folder}/ OUTPUT_VARIABLE sources)
  endif()
  foreach(file ${A_EXCLUDE})
    list(REMOVE_ITEM sources ${folder}/${file})
  endforeach()
  if(sources)
    add_library(${name} STATIC ${sources})
    target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
    target_link_libraries(${name} PUBLIC ${A_DEPS} PRIVATE cardan_flags)
    target_compile_definitions(${name} PUBLIC EIGEN_MAX_ALIGN_BYTES=32)
    cardan_unity(${name} 0)
    if(A_COLD AND NOT A_HEADERS)
      cardan_precompiled_cold(${name})
    else()
      cardan_precompiled(${name} ${A_HEADERS})
      if(A_COLD)   # what tests share: as they are compiled
        target_compile_options(${name} PRIVATE -Og)
      endif()
    endif()
  else()
    add_library(${name} INTERFACE)
    target_include_directories(${name} INTERFACE ${PROJECT_SOURCE_DIR})
    target_link_libraries(${name} INTERFACE ${A_DEPS})
    target_compile_definitions(${name} INTERFACE EIGEN_MAX_ALIGN_BYTES=32)
  endif()
endfunction()

# cardan_external_source(NAME FILE [COLD] EXTERNAL... [DEPS ours...])  the one .cpp that may touch a third-party library.
function(cardan_external_source name file)
  cmake_parse_arguments(A "COLD" "" "DEPS;EXTERNAL" ${ARGN})
  if(NOT EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${file})
    add_library(${name} INTERFACE)
    return()
  endif()
  add_library(${name} STATIC ${file})
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${A_DEPS} PRIVATE cardan_flags ${A_EXTERNAL})
  if(A_COLD)
    cardan_precompiled_cold(${name})
  elseif(A_DEPS)
    cardan_precompiled(${name})
  endif()
endfunction()

# cardan_plugin(NAME FILES...)  a shared library that exports one symbol and links nothing of Cardan.
function(cardan_plugin name)
  add_library(${name} MODULE ${ARGN})
  set_target_properties(${name} PROPERTIES PREFIX "" LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/plugins)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE cardan_flags Eigen3::Eigen)
endfunction()

# cardan_test(NAME FOLDER LABEL DEPS...)  one GoogleTest program out of the .cpp files of a folder, cases found when ctest starts.
function(cardan_test name)
  cmake_parse_arguments(A "" "FOLDER;LABEL" "DEPS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${A_FOLDER}/*.cpp)
  if(NOT sources)
    message(FATAL_ERROR "${name}: no tests in ${CMAKE_CURRENT_SOURCE_DIR}/${A_FOLDER}")
  endif()
  add_executable(${name} ${sources})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  list(LENGTH sources n)
  math(EXPR batches "(${n} + 19) / 20")   # of at most twenty files, alike: one of nineteen files is not two
  math(EXPR batch "(${n} + ${batches} - 1) / ${batches}")
  cardan_unity(${name} ${batch})
  target_compile_options(${name} PRIVATE -Og)   # a fifth less to compile than with -O1; what is tested keeps its own flags
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(${name} PRIVATE CARDAN_SOURCE_DIR="${PROJECT_SOURCE_DIR}" CARDAN_BINARY_DIR="${PROJECT_BINARY_DIR}")
  target_link_libraries(${name} PRIVATE cardan_flags ${A_DEPS} GTest::gtest_main)
  if(A_DEPS)   # what stands alone does not know the flags of fmt
    target_precompile_headers(${name} REUSE_FROM cardan_test_support)
  endif()
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60 
    PROPERTIES LABELS "${A_LABEL}" TIMEOUT 600 ENVIRONMENT CARDAN_CACHE=off)   # each case is a process: files of tests are its own (tests/support/scratch.hpp)
endfunction()

# cardan_doc_code(PAGE LANGUAGE N FILE)  block N (from 0) of code in LANGUAGE of docs/PAGE becomes FILE: what is printed is what is tested.
function(cardan_doc_code page language n file)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/docs/${page})
  file(READ ${PROJECT_SOURCE_DIR}/docs/${page} text)
  set(fence "\n```${language}\n")
  string(LENGTH "${fence}" skip)
  foreach(i RANGE ${n})
    string(FIND "${text}" "${fence}" begin)
    if(begin EQUAL -1)
      message(FATAL_ERROR "docs/${page} has no block ${n} of ${language}")
    endif()
    math(EXPR begin "${begin} + ${skip}")
    string(SUBSTRING "${text}" ${begin} -1 text)
  endforeach()
  string(FIND "${text}" "```" end)
  string(SUBSTRING "${text}" 0 ${end} text)
  file(CONFIGURE OUTPUT ${file} CONTENT "@text@" @ONLY)
  set_source_files_properties(${file} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)   # it stands for itself, as its reader has it
endfunction()

# cardan_embeds(TARGET FILES...)  files that sources of TARGET have in them (core/base/embed.hpp): the compiler tells of none, so ccache is told.
function(cardan_embeds target)
  if(CCACHE)
    list(JOIN ARGN ":" files)
    set_target_properties(${target} PROPERTIES CXX_COMPILER_LAUNCHER "${CARDAN_CCACHE};CCACHE_EXTRAFILES=${files};${CCACHE}")
  endif()
endfunction()
