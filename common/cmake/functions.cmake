# Warnings and sanitizers, of every target.
add_library(exmat_flags INTERFACE)
target_compile_options(exmat_flags INTERFACE
  $<$<CXX_COMPILER_ID:GNU,Clang,AppleClang>:-Wall;-Wextra;-Wpedantic;-Wshadow;-Wconversion;-Wno-sign-conversion>
  # False alarms of GCC 12: on string concatenation (bug 105329), and of a unity build on sources as if they were headers.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict;-Wno-subobject-linkage>
  # GCC collects garbage from 1 GB on, not from 128 MB: a tenth of the time of units with much of Eigen.
  $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1048576>)
if(EXMAT_SANITIZE)
  target_compile_options(exmat_flags INTERFACE -fsanitize=${EXMAT_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(exmat_flags INTERFACE -fsanitize=${EXMAT_SANITIZE})
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    target_compile_options(exmat_flags INTERFACE -Wno-maybe-uninitialized)  # false alarms of what sanitizers put in
  endif()
endif()

# exmat_unity(NAME): in a unity build (CMAKE_UNITY_BUILD) the sources of a folder are one unit, so that local names have to
# differ within a folder alone.
function(exmat_unity name)
  get_target_property(sources ${name} SOURCES)
  foreach(source IN LISTS sources)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR})
    cmake_path(GET source PARENT_PATH folder)
    cmake_path(RELATIVE_PATH folder BASE_DIRECTORY ${exmat_SOURCE_DIR})
    string(MAKE_C_IDENTIFIER ${folder} group)
    set_source_files_properties(${source} PROPERTIES UNITY_GROUP ${group})
  endforeach()
  set_target_properties(${name} PROPERTIES UNITY_BUILD_MODE GROUP)
endfunction()

# exmat_embed_schemas(SOURCE SCHEMA...): sets SOURCE to a source that holds these as exmat::embedded_schema("NAME").
function(exmat_embed_schemas source)
  set(embedded ${CMAKE_CURRENT_BINARY_DIR}/embedded_schemas.cpp)
  add_custom_command(
    OUTPUT ${embedded}
    COMMAND ${CMAKE_COMMAND} -DOUTPUT=${embedded} "-DSCHEMAS=${ARGN}" -P ${exmat_SOURCE_DIR}/schemas/embed.cmake
    DEPENDS ${ARGN} ${exmat_SOURCE_DIR}/schemas/embed.cmake
    VERBATIM)
  set(${source} ${embedded} PARENT_SCOPE)
endfunction()

# exmat_target(NAME): what all targets have in common. Without the extensions of GNU products are not contracted.
function(exmat_target name)
  target_compile_features(${name} PRIVATE cxx_std_20)
  set_target_properties(${name} PROPERTIES CXX_EXTENSIONS OFF)
  target_link_libraries(${name} PRIVATE $<BUILD_INTERFACE:exmat_flags>)
  exmat_unity(${name})
  if(exmat_IS_TOP_LEVEL OR NOT CMAKE_RUNTIME_OUTPUT_DIRECTORY)
    set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${exmat_BINARY_DIR}/bin)
  endif()
  if(exmat_IS_TOP_LEVEL OR NOT CMAKE_LIBRARY_OUTPUT_DIRECTORY)
    set_target_properties(${name} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${exmat_BINARY_DIR}/lib)
  endif()
endfunction()

# exmat_library(NAME FOLDER...): a static library of all sources in the named folders of the current directory.
function(exmat_library name)
  set(sources)
  foreach(folder IN LISTS ARGN)
    file(GLOB found CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cpp)
    list(APPEND sources ${found})
  endforeach()
  add_library(${name} STATIC ${sources})
  exmat_target(${name})
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${exmat_SOURCE_DIR}>)
  # Eigen parallelises products by blocks that depend on the number of threads, and with them the last digits.
  target_compile_definitions(${name} PUBLIC EIGEN_DONT_PARALLELIZE)
  target_link_libraries(${name} PUBLIC Eigen3::Eigen)
endfunction()

# exmat_header_library(NAME HEADER PACKAGE): a target for headers that come without a CMake or pkg-config file.
function(exmat_header_library name header package)
  string(TOUPPER ${name}_INCLUDE_DIR variable)
  find_path(${variable} ${header})
  if(NOT ${variable})
    message(FATAL_ERROR "exmat: there is no ${header}; install ${package} or set ${variable} to the folder that it is in")
  endif()
  add_library(${name} INTERFACE)
  target_include_directories(${name} SYSTEM INTERFACE ${${variable}})
endfunction()

# exmat_kernel_options(NAME FOLDER): how the kernels in FOLDER, which are the sources of NAME, are compiled.
function(exmat_kernel_options name folder)
  if(NOT EXMAT_PORTABLE)
    target_compile_options(${name} PRIVATE -ffp-contract=fast)
  endif()
  # Square roots of negative numbers need not be told to errno: that would keep them out of the wide registers.
  target_compile_options(${name} PRIVATE -fno-math-errno)
  # Registers of four doubles are passed to inlined functions alone.
  target_compile_options(${name} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-psabi>)
  # A loop over elements is one function after inlining: what is left out goes through memory, register by register.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    target_compile_options(${name} PRIVATE --param=large-function-growth=10000 --param=inline-unit-growth=1000)
  endif()
  # On Windows GCC does not align the registers of AVX that it spills (bug 54412).
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64" AND NOT EXMAT_PORTABLE AND NOT (WIN32 AND CMAKE_CXX_COMPILER_ID STREQUAL GNU))
    target_compile_definitions(${name} PRIVATE EXMAT_X86_KERNELS)
    set_source_files_properties(${folder}/kernels_avx2.cpp PROPERTIES COMPILE_OPTIONS "-mavx2;-mfma")
    set_source_files_properties(${folder}/kernels_avx512.cpp PROPERTIES
                                COMPILE_OPTIONS "-mavx512f;-mavx512dq;-mavx512vl;-mavx2;-mfma;-mprefer-vector-width=512")
  else()
    set_source_files_properties(${folder}/kernels_avx2.cpp ${folder}/kernels_avx512.cpp PROPERTIES HEADER_FILE_ONLY ON)
  endif()
endfunction()
