# Makes the build of an interface package's generated code two to three times as fast. Include it after project().
include_guard(DIRECTORY)
find_package(rosidl_default_generators REQUIRED)

# Every generator runs through a program that stores the parsed definitions for the generators after it.
foreach(generator
    generator_type_description generator_c generator_cpp generator_py typesupport_c typesupport_cpp
    typesupport_fastrtps_c typesupport_fastrtps_cpp typesupport_introspection_c typesupport_introspection_cpp)
  list(PREPEND rosidl_${generator}_BIN "${CMAKE_CURRENT_LIST_DIR}/generate_interfaces.py")
endforeach()

# A target's generated sources are compiled together, because the headers that all of them include take most of the time.
set(CMAKE_UNITY_BUILD ON)

# Not where sources repeat static names: each type description those of the types that it contains, and all of the C++
# introspection.
function(compile_some_one_by_one)
  if(TARGET ${PROJECT_NAME}__rosidl_generator_c)
    get_target_property(sources ${PROJECT_NAME}__rosidl_generator_c SOURCES)
    list(FILTER sources INCLUDE REGEX "__description\\.c$")
    set_source_files_properties(${sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  endif()
  if(TARGET ${PROJECT_NAME}__rosidl_typesupport_introspection_cpp)
    set_target_properties(${PROJECT_NAME}__rosidl_typesupport_introspection_cpp PROPERTIES UNITY_BUILD OFF)
  endif()
endfunction()

cmake_language(DEFER CALL compile_some_one_by_one)
