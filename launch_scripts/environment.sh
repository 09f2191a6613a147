# shellcheck shell=sh
# For a shell: `source launch_scripts/environment.sh` puts robot-stack on PATH, and the nodes into the ament index, so that an installed
# ros2cli finds them: `ros2 run robot_stack swerve_controller`. It may be sourced after /opt/ros; the nodes still load their own ROS.
if [ -n "${BASH_SOURCE:-}" ]; then _root=$(cd "$(dirname "${BASH_SOURCE}")/.." && pwd); else _root=$(cd "$(dirname "$0")/.." && pwd); fi
export PATH="$_root/.venv/bin:$PATH"
export AMENT_PREFIX_PATH="$_root/.venv${AMENT_PREFIX_PATH:+:$AMENT_PREFIX_PATH}"
unset _root
