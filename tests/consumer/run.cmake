# Configures, builds and runs the consumer of KIND in WORK.
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ECHO STDOUT COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE ${WORK})
set(options -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_FLAGS=${FLAGS})
if(KIND STREQUAL installed)
  run(${CMAKE_COMMAND} --install ${BITR_BUILD} --prefix ${WORK}/prefix)
  list(APPEND options -DCMAKE_BUILD_TYPE=${BUILD_TYPE} -DCMAKE_PREFIX_PATH=${WORK}/prefix)
  foreach(private Eigen3 nanoflann nlohmann_json)
    list(APPEND options -DCMAKE_DISABLE_FIND_PACKAGE_${private}=ON)
  endforeach()
else()
  list(APPEND options -DBITR_SOURCE=${BITR_SOURCE} -DBITR_SPIRV_CACHE=${SPIRV_CACHE})
endif()
run(${CMAKE_COMMAND} -G Ninja -S ${CMAKE_CURRENT_LIST_DIR}/${KIND} -B ${WORK}/build ${options})

if(KIND STREQUAL installed)
  run(${CMAKE_COMMAND} --build ${WORK}/build)
else()
  # Compiling the library's sources again would show nothing new. All the rest is tried: that every one of them has a rule,
  # the consumer's own unit, and its link, with the library of the developers' build in the place of its own.
  run(${CMAKE_COMMAND} --build ${WORK}/build --target consumer -- -n)
  run(${CMAKE_COMMAND} --build ${WORK}/build --target consumer_unit)
  file(COPY ${BITR_BUILD}/src/libbitr.a DESTINATION ${WORK}/build/bitr/src)
  execute_process(COMMAND ${NINJA} -C ${WORK}/build -t commands -s consumer OUTPUT_VARIABLE link
                  COMMAND_ERROR_IS_FATAL ANY)
  execute_process(COMMAND sh -c "${link}" WORKING_DIRECTORY ${WORK}/build COMMAND_ECHO STDOUT
                  COMMAND_ERROR_IS_FATAL ANY)
endif()
run(${WORK}/build/consumer)
