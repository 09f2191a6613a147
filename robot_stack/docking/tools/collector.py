"""Cuts a stream of recorded messages into dockings, in one pass.

Messages are any objects with the fields of the ROS type. They come with a decoder, called only for the messages in
use: of the images, one around each change of state.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from robot_stack.contract import topics
from robot_stack.contract.frames import FRONT_CAMERA, REAR_CAMERA
from robot_stack.contract.states import DockingState
from robot_stack.docking.tools.samples import (
    effort_of,
    lens_of,
    limit_of,
    marker_of,
    safety_of,
    speed_of,
    stamp_s,
    status_of,
)
from robot_stack.docking.tools.shots import ShotAlbum, jpeg_of
from robot_stack.docking.tools.trace import Lens, Limit, Safety, Shot, Trace

Decode = Callable[[], Any]

DETECTOR = "aruco_detector"
CONTROLLER = "docking_controller"
_REST = frozenset({DockingState.IDLE, DockingState.FAILED})
_DOCKED = DockingState.DOCKED
_CAMERAS = {
    topics.FRONT_IMAGE.name: FRONT_CAMERA,
    topics.REAR_IMAGE.name: REAR_CAMERA,
    topics.FRONT_CAMERA_INFO.name: FRONT_CAMERA,
    topics.REAR_CAMERA_INFO.name: REAR_CAMERA,
}


@dataclass(frozen=True, slots=True)
class Waits:
    """latch_s: a docking in DOCKED for longer has succeeded. tail_s: evaluated time after its end."""

    latch_s: float
    tail_s: float = 1.0


class Collector:
    """Pass every message of ``TOPICS`` in the order of reception, then call ``finish``."""

    def __init__(self, waits: Waits) -> None:
        self._waits = waits
        self._done: list[Trace] = []
        self._open: Trace | None = None
        self._state = ""
        self._docked_s = math.inf
        self._safety: Safety | None = None
        self._limit: Limit | None = None
        self._lenses: dict[str, Lens] = {}
        self._sources: set[str] = set()
        self._images: dict[str, tuple[float, Decode]] = {}
        self._album = ShotAlbum()
        self.statuses = 0
        self._last_s = -math.inf

    def feed(self, topic: str, at_s: float, decode: Decode) -> None:
        self._last_s = max(self._last_s, at_s)
        trace = self._open
        if trace is not None and trace.after and at_s > trace.end_s + self._waits.tail_s:
            self._close()
        _HANDLERS[topic](self, topic, at_s, decode)

    def finish(self) -> list[Trace]:
        """All dockings of the recording, also an incomplete one."""
        if self._open is not None:
            if not self._open.after:
                self._settle(self._open)
            self._close()
        return self._done

    def _settle(self, trace: Trace) -> None:
        """The recording ends before the docking does; DOCKED counts as its end."""
        if self._state == _DOCKED:
            trace.after, trace.end_s = _DOCKED, min(self._docked_s, self._last_s)
        else:
            trace.end_s = trace.statuses[-1].at_s

    def _close(self) -> None:
        assert self._open is not None
        self._open.shots = self._album.take(self._open.camera())
        self._done.append(self._open)
        self._open = None
        self._images = {}  # images are recorded only while the robot docks: the next docking has its own

    # --- begin and end of a docking

    def _on_status(self, _: str, at_s: float, decode: Decode) -> None:
        message = decode()
        self.statuses += 1
        before, state = self._state, str(message.state)
        self._state = state
        if self._begins(before, state):
            self._begin(at_s, before)
        trace = self._open
        if trace is None:
            return
        trace.statuses.append(status_of(at_s, message))
        if state != before:
            self._photograph(f"{state} begins", at_s)
        elif len(trace.statuses) > 1 and trace.statuses[-2].visible and not trace.statuses[-1].visible:
            self._photograph("no marker any more", at_s)
        if not trace.after:
            self._judge_end(trace, before, state, at_s)

    def _begins(self, before: str, state: str) -> bool:
        """SERVOING out of DOCKED is an undocking, and an undocking that the recording begins in looks like it."""
        if state in _REST or state == _DOCKED:
            return False
        if self._open is not None and not self._open.after:
            return False
        return state == DockingState.APPROACH if before == _DOCKED else before in _REST or before == ""

    def _begin(self, at_s: float, before: str) -> None:
        if self._open is not None:
            self._close()
        # A source that published before and is silent now counts as missing from the start.
        trace = Trace(at_s, before, lenses=self._lenses, seen={source: [] for source in self._sources})
        trace.safety += [self._safety] if self._safety else []
        trace.limits += [self._limit] if self._limit else []
        self._open = trace
        self._docked_s = math.inf

    def _judge_end(self, trace: Trace, before: str, state: str, at_s: float) -> None:
        if state == _DOCKED:
            self._docked_s = at_s if before != _DOCKED else self._docked_s
            if at_s - self._docked_s > self._waits.latch_s:
                self._end(trace, _DOCKED, self._docked_s)
        elif state in _REST:
            self._end(trace, state, at_s)
        elif before == _DOCKED and state == DockingState.SERVOING:
            self._end(trace, _DOCKED, self._docked_s)  # undocked at once

    def _end(self, trace: Trace, state: str, at_s: float) -> None:
        trace.after, trace.end_s = state, at_s

    def _on_passenger(self, _: str, at_s: float, decode: Decode) -> None:
        trace = self._open
        if trace is not None and not trace.after and self._state == _DOCKED and decode().data:
            trace.latched = True
            self._end(trace, _DOCKED, at_s)

    # --- its data

    def _photograph(self, why: str, at_s: float) -> None:
        for camera, (received_s, decode) in self._images.items():
            image = decode()
            jpeg = jpeg_of(image)
            if jpeg is not None:
                exposed_s = stamp_s(image.header)
                self._album.add(Shot(at_s, exposed_s or received_s, camera, why, jpeg))

    def _on_image(self, topic: str, at_s: float, decode: Decode) -> None:
        self._images[_CAMERAS[topic]] = (at_s, decode)

    def _on_camera_info(self, topic: str, at_s: float, decode: Decode) -> None:
        camera = _CAMERAS[topic]
        if camera not in self._lenses:
            self._lenses[camera] = lens_of(decode())
        self._note_source(camera, at_s)

    def _note_source(self, source: str, at_s: float) -> None:
        self._sources.add(source)
        if self._open is not None:
            self._open.seen.setdefault(source, []).append(at_s)

    def _on_detections(self, _: str, at_s: float, decode: Decode) -> None:
        self._note_source(DETECTOR, at_s)
        if self._open is None:
            return
        self._open.markers += [marker_of(at_s, item) for item in decode().detections]

    def _on_safety(self, _: str, at_s: float, decode: Decode) -> None:
        self._safety = safety_of(at_s, decode())
        if self._open is not None:
            self._open.safety.append(self._safety)

    def _on_limit(self, _: str, at_s: float, decode: Decode) -> None:
        self._limit = limit_of(at_s, decode())
        if self._open is not None:
            self._open.limits.append(self._limit)

    def _on_command(self, _: str, at_s: float, decode: Decode) -> None:
        if self._open is not None:
            self._open.commanded.append(speed_of(at_s, decode().twist))

    def _on_odometry(self, _: str, at_s: float, decode: Decode) -> None:
        if self._open is not None:
            self._open.driven.append(speed_of(at_s, decode().twist.twist))

    def _on_joints(self, _: str, at_s: float, decode: Decode) -> None:
        if self._open is not None and (effort := effort_of(at_s, decode())) is not None:
            self._open.efforts.append(effort)

    def _on_diagnostics(self, _: str, at_s: float, decode: Decode) -> None:
        if self._open is None:
            return
        for status in decode().status:
            if status.name == CONTROLLER:
                self._log(at_s, CONTROLLER, status.message)

    def _on_mission(self, _: str, at_s: float, decode: Decode) -> None:
        if self._open is not None and (reason := str(decode().reason)):
            self._log(at_s, "mission", reason)

    def _log(self, at_s: float, who: str, text: str) -> None:
        assert self._open is not None
        last = next((entry for _, author, entry in reversed(self._open.log) if author == who), None)
        if text != last:
            self._open.log.append((at_s, who, text))


_HANDLERS: dict[str, Callable[[Collector, str, float, Decode], None]] = {
    topics.DOCKING_STATUS.name: Collector._on_status,
    topics.PASSENGER_ATTACHED.name: Collector._on_passenger,
    topics.FRONT_IMAGE.name: Collector._on_image,
    topics.REAR_IMAGE.name: Collector._on_image,
    topics.FRONT_CAMERA_INFO.name: Collector._on_camera_info,
    topics.REAR_CAMERA_INFO.name: Collector._on_camera_info,
    topics.ARUCO_DETECTIONS.name: Collector._on_detections,
    topics.SAFETY_STATUS.name: Collector._on_safety,
    topics.VELOCITY_LIMIT.name: Collector._on_limit,
    topics.DOCKING_CMD_VEL.name: Collector._on_command,
    topics.ODOM.name: Collector._on_odometry,
    topics.JOINT_STATES.name: Collector._on_joints,
    topics.DIAGNOSTICS.name: Collector._on_diagnostics,
    topics.MISSION_STATUS.name: Collector._on_mission,
}
TOPICS = frozenset(_HANDLERS)
