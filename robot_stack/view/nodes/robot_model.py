"""The robot's model in the live view."""

from __future__ import annotations

import math
import time
from typing import Any

import foxglove
from foxglove.channels import SceneUpdateChannel
from rclpy.serialization import deserialize_message

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.display_patterns import load_patterns
from robot_stack.core.docks import load_docks
from robot_stack.core.robot import load_robot
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.middleware.interfaces import interface_class
from robot_stack.view.channels import MODEL
from robot_stack.view.display import DisplayPanel
from robot_stack.view.params import ViewParams
from robot_stack.view.scene import Model, joint_angles

_SILENT_S = 1.0  # timeout of the joint states, after which the robot is not drawn


class RobotModel:
    """The robot's model from the newest joint angles, and above it the state of its display."""

    def __init__(self, context: foxglove.Context, params: ViewParams) -> None:
        self._channel = SceneUpdateChannel(MODEL, context=context)
        self._model = Model(load_robot(), load_robot_shape(), load_docks())
        self._panel = DisplayPanel(params.display, load_patterns())
        self._period_s = 1.0 / params.model_hz
        self._due_s = self._received_s = 0.0
        self._joints: bytes = b""
        self._attached = False
        self._shown: int | None = None
        self._shown_since_s = self._shown_received_s = -math.inf

    def update(self, topic: str, data: bytes) -> None:
        if topic == topics.JOINT_STATES.name:
            self._joints, self._received_s = data, time.monotonic()
        elif topic == topics.PASSENGER_ATTACHED.name:
            self._attached = _message(topics.PASSENGER_ATTACHED, data).data
        elif topic == topics.EHMI_STATUS.name:
            self._on_display(_message(topics.EHMI_STATUS, data))

    def _on_display(self, status: Any) -> None:
        self._shown_received_s = time.monotonic()
        known = status.linked and status.acknowledged_state != status.NO_STATE
        state = status.acknowledged_state if known else None
        if state != self._shown:
            self._shown, self._shown_since_s = state, self._shown_received_s

    def show(self, now_ns: int) -> None:
        now_s = time.monotonic()
        if now_s < self._due_s or now_s - self._received_s > _SILENT_S or not self._joints:
            return
        self._due_s = now_s + self._period_s
        states = _message(topics.JOINT_STATES, self._joints)
        angles = joint_angles(states.name, states.position)
        assert topics.EHMI_STATUS.stale_s is not None
        fresh = now_s - self._shown_received_s <= topics.EHMI_STATUS.stale_s
        panel = [self._panel.entity(self._shown, now_s - self._shown_since_s, now_ns)] if fresh else []
        self._channel.log(self._model.update(angles, self._attached, now_ns, panel), log_time=now_ns)


def _message(row: Topic, data: bytes) -> Any:
    return deserialize_message(data, interface_class(row.type))
