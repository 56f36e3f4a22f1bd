# bitr_shader(TARGET STEM [VARIANT DEFINITION]): compiles shaders/STEM.comp to optimised SPIR-V and makes it a C++
# header, STEM[_VARIANT].spv.hpp, for the target.
find_program(GLSLC glslc REQUIRED)
set(BITR_SPIRV_DIR ${PROJECT_BINARY_DIR}/spirv)
set(BITR_SPIRV_WORDS ${CMAKE_CURRENT_LIST_DIR}/spirv_words.cmake)
file(MAKE_DIRECTORY ${BITR_SPIRV_DIR})

function(bitr_shader target stem)
  set(name ${stem})
  set(definitions)
  if(ARGC GREATER 2)
    set(name ${stem}_${ARGV2})
    set(definitions -D${ARGV3})
  endif()
  set(source ${PROJECT_SOURCE_DIR}/shaders/${stem}.comp)
  set(numbers ${BITR_SPIRV_DIR}/${name}.spv.inc)
  set(BITR_SHADER ${name})
  configure_file(${PROJECT_SOURCE_DIR}/cmake/spirv.hpp.in ${BITR_SPIRV_DIR}/${name}.spv.hpp @ONLY)
  set(spirv ${BITR_SPIRV_DIR}/${name}.spv)
  add_custom_command(
    OUTPUT ${numbers} BYPRODUCTS ${spirv}
    COMMAND ${GLSLC} --target-env=vulkan1.2 -O -Werror ${definitions} -I ${PROJECT_SOURCE_DIR}/shaders
            -MD -MF ${numbers}.d -MT ${numbers} -o ${spirv} ${source}
    COMMAND ${CMAKE_COMMAND} -DSPIRV=${spirv} -DOUT=${numbers} -P ${BITR_SPIRV_WORDS}
    DEPENDS ${source} ${BITR_SPIRV_WORDS} DEPFILE ${numbers}.d
    COMMENT "Shader ${name}" VERBATIM)
  add_custom_target(shader_${name} DEPENDS ${numbers})
  add_dependencies(${target} shader_${name})
endfunction()
