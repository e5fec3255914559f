# exmat.wasm with registers of 128 bits, exmat_plain.wasm without. No exceptions, threads or files: exceptions.cpp and
# thread_team.cpp say how.
file(GLOB kernels CONFIGURE_DEPENDS ${runtime}/kernels/*.cpp)
file(GLOB ports CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/wasi/*.cpp)

# The functions of the interface, by their declarations: others, such as those of libc++, are dropped where nothing
# calls them.
set(exports --export=malloc --export=free --export=__stack_pointer --export=exmat_web_layouts)
file(GLOB headers CONFIGURE_DEPENDS ${runtime}/include/exmat/*.h)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${headers})
foreach(header IN LISTS headers)
  file(READ ${header} text)
  string(REGEX MATCHALL "exmat_[a-z0-9_]+\\(" names "${text}")
  foreach(name IN LISTS names)
    string(REPLACE "(" "" name ${name})
    list(APPEND exports --export-if-defined=${name})
  endforeach()
endforeach()
list(REMOVE_DUPLICATES exports)
list(TRANSFORM exports PREPEND -Wl,)

# exmat_module(NAME FLAG...)
function(exmat_module name)
  add_library(${name}_kernels OBJECT ${kernels})
  exmat_port(${name}_kernels)
  exmat_kernel_options(${name}_kernels ${runtime}/kernels)
  add_executable(${name} ${sources} ${ports})
  exmat_port(${name})
  foreach(target ${name} ${name}_kernels)
    # Exceptions are compiled and their handlers left out: the target has no model of them.
    target_compile_options(${target} PRIVATE -fexceptions -Wno-shorten-64-to-32 ${ARGN})
    target_compile_definitions(${target} PRIVATE _WASI_EMULATED_PROCESS_CLOCKS)
    target_include_directories(${target} BEFORE PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/wasi)
  endforeach()
  # All but the kernels is optimised for size, at no cost in time.
  target_compile_options(${name} PRIVATE -Os)
  target_sources(${name} PRIVATE $<TARGET_OBJECTS:${name}_kernels>)
  # The stack comes first, so that one that overflows traps: Eigen's products overflow the default of 64 kB.
  target_link_options(${name} PRIVATE -mexec-model=reactor -Wl,-z,stack-size=1048576 -Wl,--stack-first
    -Wl,--gc-sections -Wl,--strip-all ${exports})
  target_link_libraries(${name} PRIVATE c++abi)
endfunction()

exmat_module(exmat -msimd128)
exmat_module(exmat_plain)

# The package as npm takes it: build/web/package.
set(package ${CMAKE_BINARY_DIR}/package)
file(GLOB files CONFIGURE_DEPENDS ${runtime}/web/*.js ${runtime}/web/*.ts ${runtime}/web/package.json ${runtime}/web/README.md)
list(APPEND files ${exmat_SOURCE_DIR}/LICENSE)
add_custom_command(OUTPUT ${package}/bytes.js
  COMMAND ${CMAKE_COMMAND} -E make_directory ${package}
  COMMAND ${CMAKE_COMMAND} -E copy ${files} $<TARGET_FILE:exmat> $<TARGET_FILE:exmat_plain> ${package}
  COMMAND node ${runtime}/web/make_bytes.mjs ${package}
  DEPENDS exmat exmat_plain ${files} ${runtime}/web/make_bytes.mjs
  VERBATIM)
add_custom_target(package ALL DEPENDS ${package}/bytes.js)
