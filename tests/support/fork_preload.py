"""The server that forks test processes imports this before the first fork."""

from robot_stack.contract.processes import available
from robot_stack.supervisor.preload import preload

preload(process.module for process in available() if process.module)
