"""Reception during teaching: records and collects messages at once, in a dedicated thread."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from queue import SimpleQueue
from typing import Any, NamedTuple

from robot_stack.cli.map_recording import feed
from robot_stack.cli.nodes.taught_topics import Taken, TaughtTopics, decoded
from robot_stack.cli.recordings import Recorded
from robot_stack.contract import topics
from robot_stack.core.robot import Robot
from robot_stack.core.world_clock import WorldClock
from robot_stack.mapping.collector import MOST_WAITING, Collector
from robot_stack.mapping.params import Sweeps, Teach
from robot_stack.mapping.ride import Ride
from robot_stack.mapping.teaching import Inputs, Motion
from robot_stack.recording.background import BackgroundWriter

_TAKE_S = 0.05


class _Cloud(NamedTuple):
    stamp_s: float
    taken: Taken


class TaughtRide:
    """A context manager. ``kept``: for each addition, the ride of the new sweeps and the one before them, and their
    number. ``problem``: the reason if reception has ended.

    Only sweeps that the collector keeps are recorded, each before the odometry that decided on it, so that a reader of
    the recording collects the same ride.
    """

    def __init__(
        self, inputs: TaughtTopics, writer: BackgroundWriter, sweeps: Sweeps, robot: Robot, settings: Teach
    ) -> None:
        self._inputs, self._writer = inputs, writer
        self._collector = Collector(sweeps, robot)
        self._world = WorldClock.find()
        self._waiting: deque[_Cloud] = deque()
        self._seen = 0
        self._received_s = dict.fromkeys((topics.IMU.name, topics.LIDAR_POINTS.name, topics.ODOM.name), -math.inf)
        self.motion = Motion(settings)
        self.kept: SimpleQueue[tuple[Ride, int]] = SimpleQueue()
        self.problem: Exception | None = None
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="teaching", daemon=True)

    def __enter__(self) -> TaughtRide:
        begun_s = time.monotonic()
        self._received_s = dict.fromkeys(self._received_s, begun_s)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """Processes the messages received until now and stops."""
        self._ending.set()
        self._thread.join()

    @property
    def sweeps(self) -> int:
        """Number of kept and recorded sweeps."""
        return self._collector.kept

    def inputs(self, lost: int) -> Inputs:
        now_s, at_s = time.monotonic(), self._received_s
        return Inputs(
            sweeps=self._collector.sweeps,
            without_odometry=self._collector.without_odometry,
            points_age_s=now_s - at_s[topics.LIDAR_POINTS.name],
            odometry_age_s=now_s - at_s[topics.ODOM.name],
            imu_age_s=now_s - at_s[topics.IMU.name],
            lost=lost,
        )

    def _run(self) -> None:
        try:
            while not self._ending.wait(_TAKE_S):
                self._take()
            self._take()
        except Exception as error:  # reported by the thread that waits for the end
            self.problem = error

    def _take(self) -> None:
        for taken in self._inputs.take():
            self._received_s[taken.row.name] = time.monotonic()
            try:
                self._on_message(taken)
            except ValueError as error:
                raise ValueError(f"{taken.row.name}: {error}") from None

    def _on_message(self, taken: Taken) -> None:
        message = decoded(taken.row, taken.data)
        stamp_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        feed(self._collector, Recorded(taken.row.name, stamp_s, lambda: message))
        if taken.row is topics.LIDAR_POINTS:
            self._waiting.append(_Cloud(stamp_s, taken))
            if len(self._waiting) > MOST_WAITING:
                self._waiting.popleft()
            return
        if taken.row is topics.ODOM:
            self._on_odometry(stamp_s, message)
        self._write(taken)

    def _on_odometry(self, stamp_s: float, message: Any) -> None:
        twist = message.twist.twist
        self.motion.update(stamp_s, twist.linear.x, twist.linear.y, twist.angular.z)
        fresh = self._collector.kept - self._seen
        wanted: set[float] = set()
        if fresh:
            ride = self._collector.newest(fresh + 1)
            wanted = {sweep.stamp_s for sweep in ride.sweeps[-fresh:]}
            self._seen += fresh
            self.kept.put((ride, fresh))
        # As in the collector, the newest odometry decides on every sweep until its time.
        while self._waiting and self._waiting[0].stamp_s <= stamp_s:
            cloud = self._waiting.popleft()
            if cloud.stamp_s in wanted:
                self._write(cloud.taken)

    def _write(self, taken: Taken) -> None:
        # As in the recorder, the middleware's system times are meaningless on a simulated clock.
        if self._world is not None:
            log_ns = sent_ns = self._world.now_ns()
        else:
            log_ns, sent_ns = taken.received_ns, taken.sent_ns or taken.received_ns
        self._writer.add(taken.row.name, log_ns, sent_ns, taken.data)
