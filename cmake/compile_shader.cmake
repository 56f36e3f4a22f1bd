# cmake -DNAME=… -DSOURCE=… -DDEFINITION=… -DINCLUDE=… -DGLSLC=… -DPLAIN=… -DSHIPPED=… -DKEPT=… -P compile_shader.cmake:
# SPIR-V of a shader as written, with a list of what it depends on beside it, and optimised. Optimised SPIR-V is kept in
# the folder KEPT under a name that says what it was made of, since making it takes a hundred times as long.
cmake_minimum_required(VERSION 3.25)
set(flags --target-env=vulkan1.2 -Werror)
set(optimised_flags ${flags} -O)
set(inputs ${DEFINITION} -I ${INCLUDE} ${SOURCE})

execute_process(COMMAND ${GLSLC} ${flags} -O0 -MD -MF ${PLAIN}.d -MT ${PLAIN} -o ${PLAIN} ${inputs}
                COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${GLSLC} --version OUTPUT_VARIABLE version COMMAND_ERROR_IS_FATAL ANY)
file(SHA256 ${PLAIN} plain)
string(SHA256 key "${version} ${optimised_flags} ${plain}")
set(kept ${KEPT}/${NAME}-${key}.spv)
if(NOT EXISTS ${kept})
  # Another build may be doing the same.
  string(RANDOM LENGTH 16 unfinished)
  set(unfinished ${kept}.${unfinished})
  execute_process(COMMAND ${GLSLC} ${optimised_flags} -o ${unfinished} ${inputs} COMMAND_ERROR_IS_FATAL ANY)
  file(RENAME ${unfinished} ${kept})
endif()
file(COPY_FILE ${kept} ${SHIPPED} ONLY_IF_DIFFERENT)
