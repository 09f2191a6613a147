# Passed as CMAKE_PROJECT_INCLUDE when setup builds an interface package into the environment.
#
# Everything in the environment speaks Python, which needs the C type support. The C++ one would more than double the time
# of the build; whoever writes C++ nodes builds the packages with colcon, which makes it.
include_guard(DIRECTORY)
include("${CMAKE_CURRENT_LIST_DIR}/wheels_include_dirs.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/generated_code.cmake")
list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")
