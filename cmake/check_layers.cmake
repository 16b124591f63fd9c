# Who may include whom: the two tables of docs/architecture.md, as data, against every #include line of our sources.
#   cmake -D SOURCE=<root> -P check_layers.cmake
# A path stands for everything that begins with it; of several rows the longest counts. A layer may include itself. In what is no test, no
# file (a header and its source are one) and no folder uses itself by way of others.
cmake_minimum_required(VERSION 3.25)

set(layers
  "core/abi/cardan_abi.h|"
  "core/abi/cardan_body.h|core/abi/cardan_abi.h"
  "core/abi/cardan_device.h|core/abi/cardan_abi.h"
  "core/abi/cardan_field.h|core/abi/cardan_abi.h"
  "core/abi/cardan_constraint.h|core/abi/cardan_abi.h core/abi/cardan_device.h"
  "core/base|"
  "core/spatial|core/base"
  "core/linalg|core/base"
  "core/io/bounded_child|core/base"
  "core/io/hdf5_file|core/base"
  "core/io/json|core/base"
  "core/io/sha256|core/base"
  "core/io/xml_reader|core/base"
  "core/time|core/base"
  "core/time/ida_integrator.cpp|core/base core/linalg/sparse_lu core/time/"
  "core/abi|core/base core/spatial core/linalg/dense.hpp"
  "core/model|core/base core/spatial core/linalg core/abi"
  "core/io|core/base core/abi core/model"
  "core/reference|core/base core/spatial core/linalg/eigen_kernels.hpp core/linalg/eigen_products.hpp core/model/spec.hpp"
  "core/soa|core/base core/spatial core/linalg core/abi core/model"
  "core/dynamics|core/base core/spatial core/linalg core/abi core/model core/soa"
  "core/operators|core/base core/spatial core/linalg core/abi core/model core/soa core/dynamics"
  "core/sim|core"
  "hinges|core/base core/spatial core/abi"
  "bodies|core/base core/spatial core/abi"
  "bodies/modal/|core/base core/spatial core/linalg core/io/bounded_child core/io/hdf5_file core/io/sha256"
  "plugins|core/base core/spatial core/abi"
  "plugins/astronomy/|core/base"
  "tests/plugins|core/base core/spatial core/abi"
  "bodies/vehicle/|core/base core/spatial core/abi core/model core/io/yaml_reader bodies/modal/"
  "scripts/lua/|core/base"
  "scripts/lua/matrix|core/base core/linalg/dense core/io/hdf5_file scripts/lua/"
  "scripts/prelude/|"
  "scripts/mission/|core bodies/vehicle/ bodies/register.hpp hinges/register.hpp plugins/devices/register.hpp scripts/lua/ scripts/prelude/"
  "scripts/bindings/|core bodies/vehicle/ plugins/astronomy/ plugins/fields/upper_air.hpp scripts/lua/ scripts/prelude/ scripts/mission/"
  "scripts/report/|core/base core/io"
  "scripts/regress/|core/base core/io core/model"
  "scripts/campaign/|core/base core/io scripts/regress/"
  "scripts/precision/|core/base core/io core/time scripts/regress/"
  "scripts/import/|core/base core/spatial core/io/xml_reader"
  "scripts/commands/|core bodies/modal/ bodies/register.hpp hinges/register.hpp plugins/devices/register.hpp scripts/lua/ scripts/mission/ scripts/bindings/ scripts/report/ scripts/regress/ scripts/campaign/ scripts/precision/ scripts/import/"
  "scripts/main.cpp|core/base scripts/commands/"
  "tests|core bodies hinges plugins scripts bench/pairs.hpp"
  "tests/abi/|core cardan_abi.h tests/support/"
  "bench|core bodies hinges plugins"
  "bench/loops.cpp|core bodies hinges plugins bench/command_line.hpp bench/time_ring.hpp tests/support/bench_loops.hpp"
  "bench/peers|bench/time_ring.hpp")

# Headers of others by the beginning of their name, and where they may be named. The standard library is free.
set(external
  "Eigen/|core/spatial core/linalg core/abi/family.hpp core/abi/laws.cpp core/abi/law_tools core/abi/body_laws.cpp core/abi/modal_view.cpp core/model core/dynamics core/operators core/time core/reference core/sim bodies hinges plugins scripts/lua/ scripts/mission/ scripts/bindings/ tests bench"
  "fmt/|core/base core/linalg core/abi core/model core/dynamics core/operators core/io core/time core/sim bodies/modal/ bodies/vehicle/ scripts tests bench"
  "yaml-cpp/|core/io/yaml_reader.cpp tests"
  "tinyxml2.h|core/io/xml_reader.cpp"
  "hdf5|core/io/hdf5_file.cpp tests/fuzz/hdf5_mutations.cpp"
  "nlohmann/|core/io/json.hpp tests bench"
  "openssl/|core/io/sha256.cpp"
  "arkode/|core/time/arkode_integrator.cpp"
  "cvodes/|core/time/cvode_integrator.cpp"
  "ida/|core/time/ida_integrator.cpp"
  "nvector/|core/time/sundials.hpp"
  "sun|core/time/sundials.hpp"
  "cholmod|core/linalg/sparse_cholmod.cpp"
  "dmumps|bench/factors.cpp"
  "erfa|plugins/astronomy/"
  "arpack|core/linalg/eigenpairs_arpack.cpp"
  "boost/|core/reference tests bench"
  "lua|scripts/lua/ scripts/mission/ scripts/bindings/ scripts/commands/ tests"
  "lauxlib.h|scripts/lua/ tests"
  "histedit.h|scripts/commands/line_editor.cpp"
  "CLI/|scripts/commands/command_line.cpp bench/command_line.cpp bench/factors.cpp bench/peers"
  "gtest/|tests"
  "dlfcn.h|core/abi/loader.cpp bench/straight_line.cpp"
  "sched.h|bench"
  "malloc.h|bench/time_ring.hpp bench/factors.cpp tests/core/time/every_method_test.cpp"
  "mujoco/|bench/peers/mujoco.cpp"
  "BulletDynamics/|bench/peers/bullet.cpp"
  "Simbody.h|bench/peers/simbody.cpp"
  "kdl/|bench/peers/kdl.cpp"
  "dart/|bench/peers/dart.cpp"
  "unistd.h|core/base/child_process.cpp core/io/result_folder.cpp scripts/commands/ scripts/main.cpp tests bench"
  "sys/|core/base/child_process.cpp core/io/result_folder.cpp core/io/hdf5_file.cpp scripts/commands/ tests bench"
  "valgrind/|bench/operation_count.hpp"
  "fcntl.h|core/base/child_process.cpp core/io/result_folder.cpp scripts/commands/ tests"
  "signal.h|core/base/child_process.cpp core/abi/trial.cpp core/io/bounded_child.cpp tests"
  "pty.h|tests"
  "poll.h|core/base/child_process.cpp scripts/commands/ tests"
  "stddef.h|tests/abi/2.0/"
  "stdint.h|core/abi/cardan_abi.h tests/abi/2.0/ tests/abi/2.1/ tests/abi/2.2/ tests/abi/2.3/ tests/abi/2.4/ tests/abi/2.5/ tests/abi/2.6/")

# The longest row of `table` whose name begins `path`: its right-hand side in `out`; `found` tells whether there is one.
function(row_of table path out found)
  set(best "")
  set(${found} FALSE PARENT_SCOPE)
  foreach(row ${${table}})
    string(FIND "${row}" "|" bar)
    string(SUBSTRING "${row}" 0 ${bar} key)
    string(FIND "${path}" "${key}" at)
    string(LENGTH "${key}" length)
    string(LENGTH "${best}" best_length)
    if(at EQUAL 0 AND length GREATER best_length)
      set(best "${key}")
      math(EXPR rest "${bar} + 1")
      string(SUBSTRING "${row}" ${rest} -1 allowed)
      set(${out} "${key} ${allowed}" PARENT_SCOPE)
      set(${found} TRUE PARENT_SCOPE)
    endif()
  endforeach()
endfunction()

function(begins_with_any path prefixes out)
  separate_arguments(prefixes)
  set(${out} FALSE PARENT_SCOPE)
  foreach(prefix ${prefixes})
    string(FIND "${path}" "${prefix}" at)
    if(at EQUAL 0)
      set(${out} TRUE PARENT_SCOPE)
    endif()
  endforeach()
endfunction()

# Adds that `from` uses `to`, where they differ.
macro(note_use kind from to)
  if(NOT "${from}" STREQUAL "${to}" AND NOT "${from}" MATCHES "^(tests|bench)")
    list(APPEND ${kind} ${from})
    list(APPEND uses_${kind}_${from} ${to})
  endif()
endmacro()

# What is left of a kind when all that uses nothing that is left is taken away, again and again: nothing, or its cycles and who uses them.
function(cycles_of kind out)
  set(left ${${kind}})
  list(REMOVE_DUPLICATES left)
  foreach(name ${left})
    set(there_${name} TRUE)
  endforeach()
  set(before "")
  while(NOT "${left}" STREQUAL "${before}")
    set(before ${left})
    set(left "")
    foreach(name ${before})
      set(used "")
      foreach(other ${uses_${kind}_${name}})
        if(there_${other})
          set(used ${other})
          break()
        endif()
      endforeach()
      if(used)
        list(APPEND left ${name})
      else()
        set(there_${name} FALSE)
      endif()
    endforeach()
  endwhile()
  set(text "")
  foreach(name ${left})
    foreach(other ${uses_${kind}_${name}})
      if(there_${other})
        string(APPEND text "  ${name} uses ${other}, which uses it or is in a cycle\n")
      endif()
    endforeach()
  endforeach()
  set(${out} "${text}" PARENT_SCOPE)
endfunction()

set(n_files 0)
set(bad "")
set(units "")
set(rooms "")
foreach(folder core bodies hinges plugins scripts tests bench)
  file(GLOB_RECURSE files RELATIVE ${SOURCE} ${SOURCE}/${folder}/*.cpp ${SOURCE}/${folder}/*.hpp ${SOURCE}/${folder}/*.h)
  foreach(file ${files})
    if(file MATCHES "node_modules")
      continue()
    endif()
    math(EXPR n_files "${n_files} + 1")
    row_of(layers ${file} allowed known)
    if(NOT known)
      string(APPEND bad "  ${file}: in no layer of the table\n")
      continue()
    endif()
    file(STRINGS ${SOURCE}/${file} lines REGEX "^[ \t]*#[ \t]*include")
    foreach(line ${lines})
      if(line MATCHES "\"([^\"]+)\"")
        set(header ${CMAKE_MATCH_1})
        string(REGEX REPLACE "[.][a-z]+$" "" unit ${file})
        string(REGEX REPLACE "[.][a-z]+$" "" used_unit ${header})
        note_use(units "${unit}" "${used_unit}")
        get_filename_component(room ${file} DIRECTORY)
        get_filename_component(used_room ${header} DIRECTORY)
        note_use(rooms "${room}" "${used_room}")
        begins_with_any(${header} "${allowed}" ok)
        if(NOT ok)
          string(APPEND bad "  ${file}: may not include \"${header}\" (allowed: ${allowed})\n")
        endif()
      elseif(line MATCHES "<([^>]+)>")
        set(header ${CMAKE_MATCH_1})
        row_of(external ${header} where listed)
        if(listed)
          begins_with_any(${file} "${where}" ok)
          if(NOT ok)
            string(APPEND bad "  ${file}: <${header}> has no place here (${where})\n")
          endif()
        elseif(header MATCHES "[./]")
          string(APPEND bad "  ${file}: <${header}> is in no row of the table of dependencies\n")
        endif()
      endif()
    endforeach()
  endforeach()
endforeach()
foreach(kind units rooms)
  cycles_of(${kind} cycles)
  string(APPEND bad "${cycles}")
endforeach()
if(bad OR n_files EQUAL 0)
  message(FATAL_ERROR "the layers of docs/architecture.md are broken (${n_files} files seen):\n${bad}")
endif()
message("${n_files} files: every #include is permitted by the tables, and there is no cycle")
