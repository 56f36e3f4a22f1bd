# The presets compile the sources of a target a dozen at a time (CMAKE_UNITY_BUILD): what a dozen small units parse and
# instantiate is mostly the same. So names in unnamed namespaces are unique in their folder.

# bitr_alone(TARGET REGEX...): sources of a target that are compiled one by one all the same.
function(bitr_alone target)
  get_target_property(sources ${target} SOURCES)
  list(JOIN ARGN "|" regex)
  list(FILTER sources INCLUDE REGEX "${regex}")
  set_property(SOURCE ${sources} TARGET_DIRECTORY ${target} PROPERTY SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()
