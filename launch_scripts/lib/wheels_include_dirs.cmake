# Passed as CMAKE_PROJECT_INCLUDE when an interface package is built against the ROS 2 wheels.
#
# The wheels' exported targets name include folders of the machine they were built on (/opt/python/...), and CMake refuses
# imported targets with folders that do not exist. At the end of the project's CMakeLists.txt this drops such folders from
# every imported target; the interpreter's own headers are found by find_package(Python3) anyway.
include_guard(DIRECTORY)

function(drop_missing_include_directories)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(folders ${target} INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT folders)
      continue()
    endif()
    set(kept "")
    foreach(folder IN LISTS folders)
      if(folder MATCHES "^\\$<" OR EXISTS "${folder}")
        list(APPEND kept "${folder}")
      endif()
    endforeach()
    if(NOT kept STREQUAL folders)
      set_property(TARGET ${target} PROPERTY INTERFACE_INCLUDE_DIRECTORIES "${kept}")
    endif()
  endforeach()
endfunction()

cmake_language(DEFER CALL drop_missing_include_directories)
