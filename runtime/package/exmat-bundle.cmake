# exmat_add_bundle(TARGET ASSET.json [SCENE SCENE.json] [OUTPUT BUNDLE.h5] [OPTIONS option...])
#
# Adds a target of the default build that computes a bundle with exmat-precompute: again whenever the asset, the scene or a file
# that they name changes, and not otherwise. With SCENE it holds what the scene needs and no more. ASSET and SCENE are relative to
# the current source folder, OUTPUT (TARGET.h5 if absent) to the current binary folder. OPTIONS go to the program as they are, such
# as --cache FOLDER. The target's property EXMAT_BUNDLE is the bundle's path.
#
# EXMAT_PRECOMPUTE names the program; it is looked for beside this package, then in PATH.
cmake_policy(PUSH)
if(POLICY CMP0116)  # Ninja: the depfile's paths become relative to the top of the build, as the target's
  cmake_policy(SET CMP0116 NEW)
endif()
function(exmat_add_bundle target asset)
  cmake_parse_arguments(PARSE_ARGV 2 ARG "" "SCENE;OUTPUT" "OPTIONS")
  if(ARG_UNPARSED_ARGUMENTS OR ARG_KEYWORDS_MISSING_VALUES)
    message(FATAL_ERROR "exmat_add_bundle(${target}): expected TARGET ASSET [SCENE file] [OUTPUT file] [OPTIONS ...], "
                        "found ${ARG_UNPARSED_ARGUMENTS} ${ARG_KEYWORDS_MISSING_VALUES}")
  endif()
  find_program(EXMAT_PRECOMPUTE exmat-precompute HINTS ${EXMAT_PACKAGE_PREFIX}/bin)
  if(NOT EXMAT_PRECOMPUTE)
    message(FATAL_ERROR "exmat_add_bundle(${target}): there is no exmat-precompute in ${EXMAT_PACKAGE_PREFIX}/bin or PATH; install "
                        "the offline stage too, or set EXMAT_PRECOMPUTE to the program")
  endif()
  get_filename_component(asset "${asset}" ABSOLUTE)
  if(NOT ARG_OUTPUT)
    set(ARG_OUTPUT ${target}.h5)
  endif()
  get_filename_component(output "${ARG_OUTPUT}" ABSOLUTE BASE_DIR "${CMAKE_CURRENT_BINARY_DIR}")
  get_filename_component(folder "${output}" DIRECTORY)
  file(MAKE_DIRECTORY "${folder}")
  set(inputs "${asset}")
  set(options --log-level warning ${ARG_OPTIONS})
  if(ARG_SCENE)
    get_filename_component(scene "${ARG_SCENE}" ABSOLUTE)
    list(APPEND inputs "${scene}")
    list(APPEND options --scene "${scene}")
  endif()
  add_custom_command(
    OUTPUT "${output}"
    COMMAND "${EXMAT_PRECOMPUTE}" bundle "${asset}" -o "${output}" --depfile "${output}.d" ${options}
    DEPENDS ${inputs} "${EXMAT_PRECOMPUTE}"
    DEPFILE "${output}.d"
    COMMENT "Computing the bundle ${output}"
    VERBATIM)
  add_custom_target(${target} ALL DEPENDS "${output}")
  set_target_properties(${target} PROPERTIES EXMAT_BUNDLE "${output}")
endfunction()
cmake_policy(POP)
