"""Selection of the recorded LiDAR sweeps: all of them make 40 MB/s, but a map needs only two a second."""

from __future__ import annotations

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.recording.images import Thinning

_ROWS = (topics.LIDAR_POINTS, topics.LIDAR_HALF_SWEEP, topics.OVERHEAD_LIDAR_POINTS)


class SweepChoice:
    """mode: ``always``, ``never``, or ``thinned`` to ``rate_hz`` sweeps per second of each topic. Other rows pass."""

    def __init__(self, mode: str, rate_hz: float) -> None:
        self._mode = mode
        self._thinning = Thinning(rate_hz)

    def subscribes(self, row: Topic) -> bool:
        """False for sweeps that are not recorded: receiving them costs as much as writing."""
        return self._mode != "never" or row not in _ROWS

    def thins(self, row: Topic) -> bool:
        """True if ``keeps`` selects this row's messages."""
        return self._mode == "thinned" and row in _ROWS

    def keeps(self, topic: str, now_s: float) -> bool:
        return self._thinning.keeps(topic, now_s)
