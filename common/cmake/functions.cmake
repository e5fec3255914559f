# exmat_library(NAME FOLDER...): a static library of all sources in the named folders of the current directory.
function(exmat_library name)
  set(sources)
  foreach(folder IN LISTS ARGN)
    file(GLOB found CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cpp)
    list(APPEND sources ${found})
  endforeach()
  add_library(${name} STATIC ${sources})
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  # Eigen parallelises products by blocks that depend on the number of threads, and with them the last digits.
  target_compile_definitions(${name} PUBLIC EIGEN_DONT_PARALLELIZE)
  target_link_libraries(${name} PUBLIC Eigen3::Eigen PRIVATE $<BUILD_INTERFACE:exmat_flags>)
endfunction()
