include(CMakePackageConfigHelpers)

install(TARGETS bitr EXPORT bitrTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/bitr DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT bitrTargets NAMESPACE bitr:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/bitr)
if(TARGET bitr_command)
  install(TARGETS bitr_command DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

configure_package_config_file(cmake/bitrConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/bitrConfig.cmake
                              INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/bitr)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/bitrConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/bitrConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/bitrConfigVersion.cmake
              cmake/FindLZF.cmake cmake/FindLibZip.cmake
        DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/bitr)
