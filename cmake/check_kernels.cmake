# Two object files compiled for different instruction sets must not share a function: the linker would keep one of the two, and
# an older processor could meet an instruction that it does not know. So each exports its table and defines nothing weak.
#   cmake -D NM=<nm> -D OBJECTS=<a.o;b.o> -D BUILT=<v2;v3;v4> -P check_kernels.cmake
set(bad "")
set(seen 0)
list(LENGTH BUILT expected)
foreach(object ${OBJECTS})
  get_filename_component(name ${object} NAME)
  if(NOT name MATCHES "kernels_(v[234])")
    continue()
  endif()
  math(EXPR seen "${seen} + 1")
  set(target ${CMAKE_MATCH_1})
  execute_process(COMMAND ${NM} -C --defined-only ${object} OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCHALL "[0-9a-f]+ [A-Zuvw] [^\n]*" shared "${symbols}")   # capital letters: seen by other files
  foreach(symbol ${shared})
    if(NOT symbol MATCHES " T cardan::soa::kernels_${target}\\(\\)")
      string(APPEND bad "  ${name}: ${symbol}\n")
    endif()
  endforeach()
endforeach()
if(bad OR NOT seen EQUAL expected)
  message(FATAL_ERROR "kernel files may only define their table (${seen} files seen); these are shared:\n${bad}")
endif()
