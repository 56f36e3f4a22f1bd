# bitr_embed(TARGET SYMBOL FILE): the file's bytes between SYMBOL_begin and SYMBOL_end in the target.
function(bitr_embed target BITR_EMBEDDED_SYMBOL BITR_EMBEDDED_FILE)
  set(object ${CMAKE_CURRENT_BINARY_DIR}/${BITR_EMBEDDED_SYMBOL}.S)
  configure_file(${PROJECT_SOURCE_DIR}/cmake/embed.S.in ${object} @ONLY)
  set_source_files_properties(${object} TARGET_DIRECTORY ${target} PROPERTIES OBJECT_DEPENDS ${BITR_EMBEDDED_FILE})
  target_sources(${target} PRIVATE ${object})
endfunction()
