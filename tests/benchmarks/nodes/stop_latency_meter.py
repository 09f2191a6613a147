"""Drives the robot, stops it, records the time of each event, and releases the stop."""

from __future__ import annotations

import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import Any

from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus, SwerveModuleCommandArray
from robot_stack.contract import frames, services, topics
from robot_stack.contract.model import SafetyState, Topic
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.emergency_stop import StopSource
from robot_stack.ros import transport
from robot_stack.ros.interfaces import interface_class, qos_profile
from robot_stack.ros.tool_node import ToolNode
from robot_stack.wmx import EngineError, connect
from tests.benchmarks.support.framework import BenchError

_ENGINE_POLL_S = 0.0003
_STANDSTILL_MPS = 0.01
_AT_SPEED = 0.97  # share of the requested speed that counts as reached
_HELD_S = 0.3
_PERIOD_S = 0.05  # of the swerve controller
_DEADLINE_S = 20.0


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth at a time of the system clock: s, m, m, m/s."""

    time_s: float
    x_m: float
    y_m: float
    speed_mps: float


@dataclass(frozen=True, slots=True)
class Stop:
    """One stop: times after the message in s, speed at the message in m/s, distance to standstill in m."""

    zero_command_s: float
    engine_stop_s: float
    standstill_s: float
    speed_mps: float
    distance_m: float


@dataclass(slots=True)
class _Marks:
    """System times of the observed events of the present stop."""

    zero_s: float | None = None
    engine_s: float | None = None


class StopLatencyMeter:
    """A context manager; callbacks run in a thread of their own."""

    def __init__(self, moment: Random) -> None:
        self._moment = moment
        transport.apply()
        self._tool = ToolNode("stop_bench")
        self._node = self._tool.node
        self._teleop = self._advertise(topics.TELEOP_CMD_VEL)
        self._stop_publisher = self._advertise(topics.EMERGENCY_STOP)
        self._reports = self._advertise(topics.EMERGENCY_STOP_SOURCES)
        clock = self._node.get_clock()
        self._stop = StopSource(
            "stop_bench", os.getpid(), self._stop_publisher, self._reports, lambda: clock.now().to_msg()
        )
        self._passenger = self._advertise(topics.PASSENGER_ATTACHED)
        self._truths: deque[Truth] = deque(maxlen=500)
        self.delays = 0
        self._safety: SafetyStatus | None = None
        self._requested_mps = 0.0
        self._sent_s = math.inf  # system time of the message of the stop that is being measured
        self._pressed = False
        self._marks = _Marks()
        self._subscribe(topics.SIM_GROUND_TRUTH, self._on_truth)
        self._subscribe(topics.SAFETY_STATUS, self._on_safety)
        self._subscribe(topics.WHEEL_COMMANDS, self._on_command)
        self._subscribe(topics.EMERGENCY_STOP, self._on_stop)
        self._node.create_timer(1.0 / topics.TELEOP_CMD_VEL.nominal_rate_hz, self._send_command)
        self._reset = self._node.create_client(interface_class(services.SAFETY_RESET.type), services.SAFETY_RESET.name)
        self._inject = self._node.create_client(interface_class(services.INJECT_FAULT.type), services.INJECT_FAULT.name)
        self._end = threading.Event()
        self._watch = threading.Thread(target=self._watch_engine, daemon=True)

    def __enter__(self) -> StopLatencyMeter:
        self._tool.spin_beside("stop_bench")
        self._watch.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._watch.join(2.0)
        self._tool.close()

    # --- interface of the benchmark ----------------------------------------------------------------------------------

    def begin(self, passenger: bool) -> None:
        """Waits for the stack and publishes whether a passenger is aboard."""
        self._passenger.publish(Bool(data=passenger))
        self._wait(lambda: self._truths and self._safety, "ground truth and safety status")
        self._wait(lambda: self._teleop.get_subscription_count() > 0, "a listener on /teleop/cmd_vel")
        self._wait(lambda: self._stop_publisher.get_subscription_count() > 1, "a listener on /emergency_stop")
        self._wait(lambda: self._reports.get_subscription_count() > 0, "a safety monitor that receives the sources")
        self._wait(self._inject.service_is_ready, "the simulation's fault service")
        if self._stopped():
            self.release()
        self._wait(
            lambda: self._safety and self._safety.safety_state == SafetyState.NORMAL.name, "a robot that may move"
        )

    def drive(self, speed_mps: float) -> None:
        """Returns when the robot has driven at the speed (negative: backwards) for a moment.

        On an overloaded machine the safety monitor may stop the robot; this stop is released and counted in ``delays``.
        """
        self._requested_mps = speed_mps
        since_s: list[float] = []

        def at_speed() -> bool:
            if self._stopped():
                self.delays += 1
                self.release()
                self._requested_mps = speed_mps
            if self._truths[-1].speed_mps < _AT_SPEED * abs(speed_mps):
                since_s.clear()
            elif not since_s:
                since_s.append(time.monotonic())
            return bool(since_s) and time.monotonic() - since_s[0] > _HELD_S

        self._wait(at_speed, f"{speed_mps:.1f} m/s")

    def stop(self) -> Stop:
        """Sends the emergency stop at a random phase of the controller's period and waits until the robot stands.

        The drive command continues meanwhile.
        """
        time.sleep(self._moment.uniform(0.0, _PERIOD_S))
        marks = self._marks = _Marks()
        self._sent_s = time.time()
        self._stop.publish(True)
        return self._measure(marks)

    def press(self) -> Stop:
        """The same by the emergency-stop button of the simulated robot; times count from the message of its process."""
        time.sleep(self._moment.uniform(0.0, _PERIOD_S))
        marks = self._marks = _Marks()
        self._sent_s, self._pressed = math.inf, True
        self._press(True)
        self._wait(lambda: math.isfinite(self._sent_s), "the message of the button")
        return self._measure(marks)

    def _measure(self, marks: _Marks) -> Stop:
        sent_s = self._sent_s
        self._wait(lambda: marks.zero_s is not None, "a zero wheel command")
        self._wait(lambda: marks.engine_s is not None, "the engine's stop")
        self._wait(lambda: self._stands(sent_s), "standstill")
        truths = list(self._truths)
        # Between two samples the robot moves at constant speed.
        before = max((item for item in truths if item.time_s <= sent_s), key=lambda item: item.time_s)
        rest = next(item for item in truths if item.time_s > sent_s and item.speed_mps < _STANDSTILL_MPS)
        gone_m = before.speed_mps * (sent_s - before.time_s)
        assert marks.zero_s is not None
        assert marks.engine_s is not None
        return Stop(
            zero_command_s=marks.zero_s - sent_s,
            engine_stop_s=marks.engine_s - sent_s,
            standstill_s=rest.time_s - sent_s,
            speed_mps=before.speed_mps,
            distance_m=math.hypot(truths[-1].x_m - before.x_m, truths[-1].y_m - before.y_m) - gone_m,
        )

    def release(self) -> None:
        """Releases button and message; returns when the robot may move again."""
        self._requested_mps = 0.0
        self._sent_s = math.inf
        if self._pressed:
            self._press(False)
            self._pressed = False
        self._stop.publish(False)
        reasons: list[str] = []

        def granted() -> bool:
            response = self._call_reset()
            reasons.append(response.message)
            return bool(response.success)

        self._wait(granted, "the release of the emergency stop", lambda: reasons[-1] if reasons else "", 0.1)
        self._wait(lambda: self._safety and not self._stopped(), "a safety status without emergency")

    def _stopped(self) -> bool:
        return self._safety is not None and bool(self._safety.safety_state == SafetyStatus.EMERGENCY_STOP)

    # --- callbacks ---------------------------------------------------------------------------------------------------

    def _on_truth(self, message: Odometry) -> None:
        position, linear = message.pose.pose.position, message.twist.twist.linear
        speed_mps = math.hypot(linear.x, linear.y)
        self._truths.append(Truth(time_to_s(message.header.stamp), position.x, position.y, speed_mps))

    def _on_safety(self, message: SafetyStatus) -> None:
        self._safety = message

    def _on_command(self, message: SwerveModuleCommandArray) -> None:
        zero = all(module.drive_velocity == 0.0 for module in message.modules)
        # The button's message may arrive here after its effects.
        if zero and self._marks.zero_s is None and (self._pressed or time.time() > self._sent_s):
            self._marks.zero_s = time.time()

    def _on_stop(self, message: Bool, info: dict[str, int]) -> None:
        if message.data and self._pressed and math.isinf(self._sent_s):
            self._sent_s = 1e-9 * info["source_timestamp"]

    def _send_command(self) -> None:
        message = TwistStamped()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.header.frame_id = frames.BASE_LINK
        message.twist.linear.x = self._requested_mps
        self._teleop.publish(message)

    def _watch_engine(self) -> None:
        try:
            with connect("stop_bench", timeout_s=_DEADLINE_S) as engine:
                while not self._end.is_set():
                    code, status = engine.read_status()
                    now_s = time.time()
                    marks, measuring = self._marks, self._pressed or math.isfinite(self._sent_s)
                    if not code and status.emergency_stop and marks.engine_s is None and measuring:
                        marks.engine_s = now_s
                    time.sleep(_ENGINE_POLL_S if measuring else 0.01)
        except EngineError as error:
            print(f"the engine cannot be watched: {error}", flush=True)

    # --- helpers -----------------------------------------------------------------------------------------------------

    def _advertise(self, row: Topic) -> Any:
        return self._node.create_publisher(interface_class(row.type), row.name, qos_profile(row.qos))

    def _subscribe(self, row: Topic, callback: Callable[..., None]) -> None:
        self._node.create_subscription(interface_class(row.type), row.name, callback, qos_profile(row.qos))

    def _stands(self, sent_s: float) -> bool:
        truths = list(self._truths)  # a copy: the callbacks' thread keeps appending
        last = truths[-1]
        moving = [t.time_s for t in truths if t.speed_mps >= _STANDSTILL_MPS]
        return last.time_s - max(sent_s, moving[-1] if moving else sent_s) > 0.2

    def _press(self, pressed: bool) -> None:
        request = interface_class(services.INJECT_FAULT.type).Request(kind="estop_button", value=float(pressed))
        self._inject.call_async(request)

    def _call_reset(self) -> Any:
        future = self._reset.call_async(interface_class(services.SAFETY_RESET.type).Request())
        self._wait(future.done, "an answer of /safety/reset")
        return future.result()

    def _wait(
        self,
        condition: Callable[[], Any],
        what: str,
        why: Callable[[], str] = lambda: "",
        pause_s: float = 0.002,
    ) -> None:
        end_s = time.monotonic() + _DEADLINE_S
        while not condition():
            if time.monotonic() > end_s:
                faults = ", ".join(self._safety.active_faults) if self._safety else "unknown"
                raise BenchError(f"waited {_DEADLINE_S:.0f} s waiting for {what} {why()} (active faults: {faults})")
            time.sleep(pause_s)
