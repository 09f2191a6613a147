# Passed as CMAKE_PROJECT_INCLUDE when the test builds with colcon against the ROS 2 wheels. robot_stack has no interfaces.
include_guard(DIRECTORY)
include("${CMAKE_CURRENT_LIST_DIR}/../../launch_scripts/lib/wheels_include_dirs.cmake")
if(NOT PROJECT_NAME STREQUAL "robot_stack")
  include("${CMAKE_CURRENT_LIST_DIR}/../../launch_scripts/lib/generated_code.cmake")
endif()
