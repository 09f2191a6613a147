"""The deterministic scheduler: many nodes in one process, under one seed, in virtual time.

Generic middleware only: ``robot_stack.middleware.port`` without DDS, threads or a wall clock. No robot, no physics.
"""

from sim.scheduler.logs import LogLine
from sim.scheduler.observers import Digest, Observer, Recording
from sim.scheduler.params import SchedulerParams
from sim.scheduler.scheduler import Failure, Scheduler

__all__ = ["Digest", "Failure", "LogLine", "Observer", "Recording", "Scheduler", "SchedulerParams"]
