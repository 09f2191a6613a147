"""The interface to run jobs beside a node's loop, for kernels and stores."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

T = TypeVar("T")


class Worker(Protocol):
    """Runs jobs one after the other beside the node's tick: on ROS in a separate thread.

    On the scheduler a job runs at once and its result arrives after a simulated duration.
    """

    def submit(self, job: Callable[[], T], done: Callable[[T], None]) -> None:
        """Queues ``job``; ``done`` is called with its result in the node's loop. A job must not raise."""
        ...

    def close(self, timeout_s: float) -> None:
        """Ends the worker once the queued jobs have run, at the latest after ``timeout_s``."""
        ...
