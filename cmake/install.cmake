include(CMakePackageConfigHelpers)

install(TARGETS bitr EXPORT bitrTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/bitr DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT bitrTargets NAMESPACE bitr:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/bitr)
if(TARGET bitr_command)
  install(TARGETS bitr_command DESTINATION ${CMAKE_INSTALL_BINDIR})
  # The command writes its manual and its completion itself.
  set(pages ${CMAKE_CURRENT_BINARY_DIR}/manual)
  install(CODE "
    file(MAKE_DIRECTORY ${pages})
    foreach(page \"help --man>bitr.1\" \"completion bash>bitr\" \"completion zsh>_bitr\" \"completion fish>bitr.fish\")
      string(REGEX MATCH \"^(.*) (.*)>(.*)$\" matched \"\${page}\")
      execute_process(COMMAND $<TARGET_FILE:bitr_command> \${CMAKE_MATCH_1} \${CMAKE_MATCH_2}
                      OUTPUT_FILE ${pages}/\${CMAKE_MATCH_3} COMMAND_ERROR_IS_FATAL ANY)
    endforeach()")
  install(FILES ${pages}/bitr.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  install(FILES ${pages}/bitr DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
  install(FILES ${pages}/_bitr DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
  install(FILES ${pages}/bitr.fish DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
endif()

configure_package_config_file(cmake/bitrConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/bitrConfig.cmake
                              INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/bitr)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/bitrConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/bitrConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/bitrConfigVersion.cmake
              cmake/FindLZF.cmake cmake/FindLibZip.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/bitr)
