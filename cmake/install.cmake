# cmake --install: the program with its manual page and completion, the headers of the plugin contract, and what finds them from outside:
# find_package(cardan), pkg-config. Every path is relative to where the files are found, so that the folder may be moved.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(CMAKE_SKIP_INSTALL_RPATH ON)
set(made ${CMAKE_BINARY_DIR}/install)
set(package ${CMAKE_INSTALL_DATADIR}/cmake/cardan)
set(include_folder ${CMAKE_INSTALL_INCLUDEDIR}/cardan)

add_library(cardan_plugin_headers INTERFACE)
set_target_properties(cardan_plugin_headers PROPERTIES EXPORT_NAME plugin)
target_include_directories(cardan_plugin_headers INTERFACE $<INSTALL_INTERFACE:${include_folder}>)
install(TARGETS cardan cardan_plugin_headers EXPORT cardan)
foreach(header core/abi/cardan_abi.h core/abi/cardan_body.h core/abi/cardan_device.h core/abi/family.hpp core/abi/device_family.hpp
        core/spatial/tangent.hpp core/spatial/vec3.hpp)
  get_filename_component(folder ${header} DIRECTORY)
  install(FILES ${header} DESTINATION ${include_folder}/${folder})
endforeach()

install(EXPORT cardan NAMESPACE cardan:: FILE cardan-targets.cmake DESTINATION ${package})
configure_package_config_file(cmake/cardan-config.cmake.in ${made}/cardan-config.cmake INSTALL_DESTINATION ${package})
write_basic_package_version_file(${made}/cardan-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${made}/cardan-config.cmake ${made}/cardan-config-version.cmake DESTINATION ${package})

file(RELATIVE_PATH to_prefix /prefix/${CMAKE_INSTALL_DATADIR}/pkgconfig /prefix)
configure_file(cmake/cardan.pc.in ${made}/cardan.pc @ONLY)
install(FILES ${made}/cardan.pc DESTINATION ${CMAKE_INSTALL_DATADIR}/pkgconfig)

install(CODE "foreach(words \"help man\" \"completion bash\")
  string(REPLACE \" \" \";\" words \"\${words}\")
  list(GET words 0 name)
  execute_process(COMMAND \"$<TARGET_FILE:cardan>\" \${words} OUTPUT_FILE \"${made}/\${name}\" COMMAND_ERROR_IS_FATAL ANY)
endforeach()")
install(FILES ${made}/help DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 RENAME cardan.1)
install(FILES ${made}/completion DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions RENAME cardan)
