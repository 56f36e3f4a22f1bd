# LZF::LZF, the compression of binary_compressed PCD files. A module of our own, because distributions disagree on
# whether liblzf brings a CMake package.
include(FindPackageHandleStandardArgs)
find_path(LZF_INCLUDE_DIR lzf.h PATH_SUFFIXES liblzf)
find_library(LZF_LIBRARY lzf)
mark_as_advanced(LZF_INCLUDE_DIR LZF_LIBRARY)
find_package_handle_standard_args(LZF REQUIRED_VARS LZF_LIBRARY LZF_INCLUDE_DIR)
if(LZF_FOUND AND NOT TARGET LZF::LZF)
  add_library(LZF::LZF UNKNOWN IMPORTED)
  set_target_properties(LZF::LZF PROPERTIES IMPORTED_LOCATION ${LZF_LIBRARY}
                                            INTERFACE_INCLUDE_DIRECTORIES ${LZF_INCLUDE_DIR})
endif()
