"""Start-up hook of the environment's interpreter, installed beside the wheels: hides a sourced ROS installation.

A sourced /opt/ros stands in PYTHONPATH and LD_LIBRARY_PATH before the wheels, and its rclpy belongs to another Python
or to other libraries. The environment is complete without it. A workspace that was built on the environment itself
stays. It runs before the hook of the wheels, which starts the interpreter again with the library path it finds.
"""

import os
import sys
from collections.abc import Callable

_PACKAGE = "share/ament_index/resource_index/packages/rclpy"  # of an installation, not of a workspace
_PREFIXES = "AMENT_PREFIX_PATH"


def hide() -> None:
    """Removes every prefix of AMENT_PREFIX_PATH but the environment's if one of them is a ROS installation."""
    own = os.path.realpath(sys.prefix)
    foreign = [entry for entry in _entries(_PREFIXES) if os.path.realpath(entry) != own]
    if not any(os.path.exists(os.path.join(entry, _PACKAGE)) for entry in foreign):
        return
    roots = tuple(os.path.join(entry, "") for entry in foreign)

    def hidden(entry: str) -> bool:
        return os.path.join(entry, "").startswith(roots)

    for variable in (_PREFIXES, "PYTHONPATH", "LD_LIBRARY_PATH", "CMAKE_PREFIX_PATH"):
        _keep(variable, lambda entry: not hidden(entry))
    sys.path[:] = [entry for entry in sys.path if not hidden(entry)]


def _entries(variable: str) -> list[str]:
    return [entry for entry in os.environ.get(variable, "").split(os.pathsep) if entry]


def _keep(variable: str, wanted: Callable[[str], bool]) -> None:
    if variable not in os.environ:
        return
    kept = [entry for entry in _entries(variable) if wanted(entry)]
    if kept:
        os.environ[variable] = os.pathsep.join(kept)
    else:
        del os.environ[variable]


hide()
