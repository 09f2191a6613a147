# Passed as CMAKE_PROJECT_INCLUDE when setup builds an interface package into the environment.
#
# Everything in the environment speaks Python, which needs the C type support. The C++ one would more than double the time
# of the build; whoever writes C++ nodes builds the packages with colcon, which makes it.
include_guard(DIRECTORY)
include("${CMAKE_CURRENT_LIST_DIR}/wheels_include_dirs.cmake")
find_package(rosidl_default_generators REQUIRED)
list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")

# A target's generated sources are compiled together, since most of the time goes into the headers that all of them read.
# Those of the C structures cannot be: each repeats the static names of what it contains. Nor can the C++ type support.
set(CMAKE_UNITY_BUILD ON)
cmake_language(DEFER CALL set_property TARGET ${PROJECT_NAME}__rosidl_generator_c PROPERTY UNITY_BUILD OFF)
