# Man pages of what --help says, one for a program and one for each of its commands, if help2man is there.
find_program(EXMAT_HELP2MAN help2man)

# exmat_man_pages(PROGRAM COMPONENT COMMAND...)
function(exmat_man_pages program component)
  if(NOT EXMAT_HELP2MAN)
    return()
  endif()
  foreach(command "" ${ARGN})
    string(JOIN - name ${program} ${command})
    set(page ${exmat_BINARY_DIR}/man/${name}.1)
    string(JOIN " " words $<TARGET_FILE:${program}> ${command})
    set(make "${EXMAT_HELP2MAN} --no-info --section=1 --version-string=${exmat_VERSION} --source=exmat")
    add_custom_command(OUTPUT ${page}.gz
      COMMAND ${CMAKE_COMMAND} -E make_directory ${exmat_BINARY_DIR}/man
      COMMAND sh -c "${make} --name=\"$(${words} --help | head -n 1)\" \"${words}\" | sed 's|${exmat_BINARY_DIR}/bin/||g' > ${page}"
      COMMAND gzip -9nf ${page}
      DEPENDS ${program} VERBATIM)
    list(APPEND pages ${page}.gz)
  endforeach()
  add_custom_target(${program}-man ALL DEPENDS ${pages})
  install(FILES ${pages} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${component} OPTIONAL)
endfunction()
