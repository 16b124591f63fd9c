# cmake --install: the program with its manual page and completion, the headers of the plugin contract, and what finds them from outside:
# find_package(cardan), pkg-config. Every path is relative to where the files are found, so that the folder may be moved.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(CMAKE_SKIP_INSTALL_RPATH ON)
set(made ${PROJECT_BINARY_DIR}/install)
set(package ${CMAKE_INSTALL_DATADIR}/cmake/cardan)
set(include_folder ${CMAKE_INSTALL_INCLUDEDIR}/cardan)

add_library(cardan_plugin_headers INTERFACE)
set_target_properties(cardan_plugin_headers PROPERTIES EXPORT_NAME plugin)
target_include_directories(cardan_plugin_headers INTERFACE $<INSTALL_INTERFACE:${include_folder}>)
install(TARGETS cardan cardan_plugin_headers EXPORT cardan)
foreach(header core/abi/cardan_abi.h core/abi/cardan_body.h core/abi/cardan_device.h core/abi/cardan_field.h core/abi/cardan_constraint.h
        core/abi/family.hpp core/abi/device_family.hpp core/abi/field_family.hpp
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

# What the program contains must be named to whoever gets it: docs/dependencies.md, and Debian's texts on those that are in it.
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright)
install(FILES docs/dependencies.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
foreach(inside libarpack2-dev liblapack-dev libblas-dev libboost-dev libcli11-dev libeigen3-dev liberfa-dev nlohmann-json3-dev)
  install(FILES /usr/share/doc/${inside}/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR}/notices RENAME ${inside} OPTIONAL)
endforeach()

# cpack -G DEB, or ./dev package: the same as a Debian package, which depends on the libraries that the program is linked to.
set(CPACK_PACKAGE_CONTACT "the authors of Cardan")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "simulator of spacecraft made of rigid and flexible bodies")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_GENERATOR DEB)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "libeigen3-dev (>= 3.4), cmake (>= 3.25), g++")
include(CPack)
