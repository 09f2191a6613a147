# Passed as CMAKE_PROJECT_INCLUDE when setup builds an interface package into the environment.
#
# Everything in the environment speaks Python, which needs the C type support. The C++ one would more than double the time
# of the build; whoever writes C++ nodes builds the packages with colcon, which makes it.
include_guard(DIRECTORY)
include("${CMAKE_CURRENT_LIST_DIR}/wheels_include_dirs.cmake")
find_package(rosidl_default_generators REQUIRED)
list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")

# Every generator runs through a program that stores the parsed definitions for the generators after it.
foreach(generator generator_type_description generator_c generator_py
    typesupport_c typesupport_fastrtps_c typesupport_introspection_c)
  list(PREPEND rosidl_${generator}_BIN "${CMAKE_CURRENT_LIST_DIR}/generate_interfaces.py")
endforeach()

# A target's generated sources are compiled together, because the headers that all of them include take most of the time.
# The type descriptions are compiled one by one: each repeats the static names of the types that it contains.
set(CMAKE_UNITY_BUILD ON)

function(compile_type_descriptions_one_by_one)
  get_target_property(sources ${PROJECT_NAME}__rosidl_generator_c SOURCES)
  list(FILTER sources INCLUDE REGEX "__description\\.c$")
  set_source_files_properties(${sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

cmake_language(DEFER CALL compile_type_descriptions_one_by_one)
