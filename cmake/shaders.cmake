# bitr_shaders(TARGET SOURCES source... [SHUFFLE stem...] [TEXELS stem...]): compiles compute shaders. Of STEM.comp, and of
# its variants STEM_shuffle and STEM_texels with SHUFFLE or TEXELS defined, the target may include STEM.spv.hpp, which
# declares vk::shaders::STEM (src/vk/shader.hpp).
find_program(GLSLC glslc REQUIRED)
set(BITR_SPIRV_DIR ${PROJECT_BINARY_DIR}/spirv)
set(BITR_COMPILE_SHADER ${CMAKE_CURRENT_LIST_DIR}/compile_shader.cmake)

# Builds in folders of build/ share what takes long.
set(builds ${PROJECT_SOURCE_DIR}/build)
cmake_path(IS_PREFIX builds ${PROJECT_BINARY_DIR} below)
if(below AND NOT builds STREQUAL PROJECT_BINARY_DIR)
  set(kept ${builds}/spirv)
else()
  set(kept ${BITR_SPIRV_DIR}/optimised)
endif()
set(BITR_SPIRV_CACHE ${kept} CACHE PATH "Folder of optimised SPIR-V, which builds may share")
file(MAKE_DIRECTORY ${BITR_SPIRV_DIR} ${BITR_SPIRV_CACHE})

set(BITR_REFLECT "" CACHE FILEPATH "bitr_reflect of the machine that builds, if the library is for another (cmake/reflect)")
mark_as_advanced(GLSLC BITR_SPIRV_CACHE BITR_REFLECT)
if(NOT BITR_REFLECT)
  if(CMAKE_CROSSCOMPILING AND NOT CMAKE_CROSSCOMPILING_EMULATOR)
    message(FATAL_ERROR "Build cmake/reflect for this machine first and set BITR_REFLECT to its bitr_reflect")
  endif()
  add_subdirectory(${CMAKE_CURRENT_LIST_DIR}/reflect ${PROJECT_BINARY_DIR}/reflect)
  set_target_properties(bitr_reflect PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/reflect)
endif()

# bitr_shader(OUT SOURCE [VARIANT]): appends what is to be made to the list OUT.
function(bitr_shader out source)
  cmake_path(GET source STEM name)
  set(definition)
  if(ARGC GREATER 2)
    string(APPEND name _${ARGV2})
    string(TOUPPER -D${ARGV2} definition)
  endif()
  set(reflect bitr_reflect)
  if(BITR_REFLECT)
    set(reflect ${BITR_REFLECT})
  endif()
  set(to ${BITR_SPIRV_DIR}/${name})
  add_custom_command(
    OUTPUT ${to}.plain.spv BYPRODUCTS ${to}.spv ${to}.spv.hpp
    COMMAND ${CMAKE_COMMAND} -DNAME=${name} -DSOURCE=${source} -DDEFINITION=${definition}
            -DINCLUDE=${PROJECT_SOURCE_DIR}/shaders -DGLSLC=${GLSLC} -DPLAIN=${to}.plain.spv -DSHIPPED=${to}.spv
            -DKEPT=${BITR_SPIRV_CACHE} -P ${BITR_COMPILE_SHADER}
    COMMAND ${reflect} ${name} ${to}.plain.spv ${to}.spv ${to}.spv.hpp
    DEPENDS ${source} ${BITR_COMPILE_SHADER} ${reflect} DEPFILE ${to}.plain.spv.d
    COMMENT "Shader ${name}" VERBATIM)
  set(${out} ${${out}} ${to}.plain.spv PARENT_SCOPE)
endfunction()

function(bitr_shaders target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "SOURCES;SHUFFLE;TEXELS")
  set(made)
  foreach(source IN LISTS arg_SOURCES)
    cmake_path(GET source STEM stem)
    bitr_shader(made ${source})
    foreach(variant shuffle texels)
      string(TOUPPER arg_${variant} stems)
      string(REPLACE ARG_ arg_ stems ${stems})
      if(stem IN_LIST ${stems})
        bitr_shader(made ${source} ${variant})
      endif()
    endforeach()
  endforeach()
  add_custom_target(${target}_shaders DEPENDS ${made})
  add_dependencies(${target} ${target}_shaders)
  target_include_directories(${target} PRIVATE ${BITR_SPIRV_DIR} ${PROJECT_SOURCE_DIR}/shaders)
  set_property(TARGET ${target} PROPERTY BITR_SHADERS ${made})
endfunction()
