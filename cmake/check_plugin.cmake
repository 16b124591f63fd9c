# A plugin exports its entry and nothing else: two plugins, or a plugin and the program, can then not meet by name.
#   cmake -D NM=<nm> -D PLUGIN=<file.so> -P check_plugin.cmake
execute_process(COMMAND ${NM} -D --defined-only --format=posix ${PLUGIN} OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX REPLACE " [^\n]*" "" symbols "${symbols}")
string(STRIP "${symbols}" symbols)
if(NOT symbols STREQUAL "cardan_plugin_entry")
  message(FATAL_ERROR "${PLUGIN} exports:\n${symbols}\nIt should export cardan_plugin_entry alone.")
endif()
