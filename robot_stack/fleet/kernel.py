"""The fleet agent: messages of the master and the robot's state in, requests to the mission manager and messages out.

It never moves the robot: everything goes through the mission manager's queue.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Final

from robot_stack.contract.states import HeldBy
from robot_stack.core.geometry import Pose2
from robot_stack.fleet import acceptance, codec, instant, progress, report
from robot_stack.fleet.acceptance import Mode
from robot_stack.fleet.errors import Error, ErrorType, Refused
from robot_stack.fleet.headers import Headers
from robot_stack.fleet.link import Topic
from robot_stack.fleet.order import MAX_ID_LENGTH, Action, read_actions, read_order
from robot_stack.fleet.params import FleetParams
from robot_stack.fleet.progress import Operation, Request
from robot_stack.fleet.record import Phase, Record
from robot_stack.fleet.robot import RobotView
from robot_stack.fleet.vehicle import Vehicle
from robot_stack.fleet.version import Version

_MAX_ERRORS: Final = 8  # of each topic: a state has a limited length
_NEVER: Final = -math.inf
_OPERATIONS: Final = {"startPause": Operation.PAUSE, "stopPause": Operation.RESUME}
_KINDS: Final = {operation: kind for kind, operation in _OPERATIONS.items()}
_ERRORS_OF: Final = {Topic.ORDER: "orders", Topic.INSTANT_ACTIONS: "instant actions"}


@dataclass
class Outputs:
    """What is to be sent once the record is on the disk. pose: for /initialpose."""

    messages: dict[Topic, bytes] = field(default_factory=dict)
    request: Request | None = None
    pose: Pose2 | None = None


class FleetKernel:
    """Times in s: of a clock for periods, and of the Unix clock for timestamps. record: to be journaled."""

    def __init__(self, params: FleetParams, vehicle: Vehicle, factsheet: codec.Data, record: Record) -> None:
        self._params, self._vehicle, self._factsheet = params, vehicle, factsheet
        self.record = record
        self._headers = Headers(params.identity, vehicle.version, record.reserved)
        self._inbox: deque[tuple[Topic, bytes]] = deque()
        self._errors: dict[Topic, dict[Error, None]] = {topic: {} for topic in _ERRORS_OF}
        self._outputs = Outputs()
        self._asked: Request | None = None
        self._asked_s = self._state_s = self._shown_s = self._order_s = _NEVER
        self._retry_s = _NEVER
        self._number = 0
        self._sent: codec.Data = {}
        self._send_state = self._send_factsheet = False
        self._pose_given = False
        self._reserve()

    @property
    def headers(self) -> Headers:
        return self._headers

    def connected(self) -> None:
        self._send_state = self._send_factsheet = True

    def receive(self, topic: Topic, payload: bytes) -> None:
        """Takes a message for the next tick. Of too many of a topic the oldest is dropped: none of another topic."""
        if topic not in self._errors:
            return
        self._inbox.append((topic, payload))
        of_topic = [index for index, (other, _) in enumerate(self._inbox) if other is topic]
        if len(of_topic) > self._params.limits.waiting_messages:
            del self._inbox[of_topic[0]]
            self._report(topic, Error(ErrorType.OVERLOAD, f"messages on {topic} come faster than they are read"))

    def answered(self, request: Request, success: bool, text: str) -> None:
        """The mission manager's answer."""
        if self._asked is None or request.number != self._asked.number:
            return
        self._asked = None
        if request.operation in _KINDS:
            # Not again before /mission/queue shows the effect.
            self._retry_s = self._asked_s + self._params.answer_timeout_s
            if not success:
                self.record = instant.refused_by_manager(self.record, _KINDS[request.operation], text)
        elif self.record.order is not None:
            order = progress.answered(self.record.order, request, success, text)
            self.record = self.record.model_copy(update={"order": order})
        if not success:
            self._retry_s = self._asked_s + self._params.answer_timeout_s

    def tick(self, robot: RobotView, now_s: float, unix_s: float) -> None:
        """Brings record and outputs up to date."""
        standing = self._stands(robot)
        if robot.queue is not None and robot.queue.held_by == HeldBy.MANUAL:
            self.record = instant.cancelled_by_robot(self.record, "the robot was driven by hand")
        elif progress.is_overtaken(self.record.order, robot):
            self.record = instant.cancelled_by_robot(self.record, "an order of another client began first")
        self._follow(robot, standing)  # the end of an order, before another one takes its place
        left_bytes = self._params.limits.message_bytes
        for _ in range(min(len(self._inbox), self._params.limits.messages_per_tick)):
            topic, payload = self._inbox.popleft()
            self._read(topic, payload, robot, unix_s)
            left_bytes -= len(payload)  # the schema's check of long messages takes long
            if left_bytes <= 0:
                break
        self._follow(robot, standing)
        if self._vehicle.version is Version.V3:
            self._follow_mode(robot)
        self._ask(now_s)
        self._publish(robot, standing, now_s, unix_s)
        self._reserve()

    def _follow(self, robot: RobotView, standing: bool) -> None:
        self.record = progress.followed(self.record, robot)
        pose_given = self._pose_given if self._outputs.pose is None else None
        self.record = instant.updated(self.record, robot, standing, pose_given)

    def take(self) -> Outputs:
        """The outputs; call it once the record is on the disk."""
        outputs, self._outputs = self._outputs, Outputs()
        self._pose_given |= outputs.pose is not None
        return outputs

    # --- messages ----------------------------------------------------------------------------------------------------

    def _read(self, topic: Topic, payload: bytes, robot: RobotView, unix_s: float) -> None:
        try:
            data = codec.decode(topic, payload, self._params.limits.message_bytes, self._vehicle.version)
            self._check_header(topic, data)
            if topic is Topic.ORDER:
                order = read_order(data, self._vehicle.version)
                self.record = acceptance.accepted(
                    self.record, order, robot, self._vehicle, unix_s, self._params.limits.state_bytes
                )
                self._errors[topic] = {}
                self._send_state = True
            else:
                self._begin_all(data, robot)
        except Refused as refused:
            self._report(topic, refused.error)

    def _check_header(self, topic: Topic, data: codec.Data) -> None:
        """Raises Refused for another protocol, or a message for another robot."""
        identity = self._params.identity
        wrong = [key for key, mine in identity.robot().items() if data[key] != mine]
        if Version.of(data["version"]) is not self._vehicle.version:
            wrong.append("version")
        if wrong:
            text = f"{topic}: {wrong[0]} {data[wrong[0]][:MAX_ID_LENGTH]!r} is not that of this robot"
            raise Refused(Error(ErrorType.VALIDATION, text, (*codec.references(topic, data), ("field", wrong[0]))))

    def _begin_all(self, data: codec.Data, robot: RobotView) -> None:
        actions = read_actions(data["actions"], self._vehicle.version)
        limit = self._params.limits.instant_actions
        if len(actions) > limit or not all(0 < len(action.id) <= MAX_ID_LENGTH for action in actions):
            text = f"at most {limit} instant actions, with ids of 1 to {MAX_ID_LENGTH} characters"
            raise Refused(Error(ErrorType.VALIDATION, text, codec.references(Topic.INSTANT_ACTIONS, data)))
        earlier = tuple(self._errors[Topic.INSTANT_ACTIONS])
        begun = [self._begin(action, robot) for action in actions if not instant.is_known(self.record, action)]
        if any(begun):  # 3.0.0, 6.6.5.4: until a new instant action is accepted
            for error in earlier:
                self._errors[Topic.INSTANT_ACTIONS].pop(error, None)

    def _begin(self, action: Action, robot: RobotView) -> bool:
        """True if it is accepted."""
        try:
            begun = instant.begin(self.record, action, robot, self._vehicle)
        except Refused as refused:
            self.record = instant.failed(self.record, action, refused.error.description)
            # 3.0.0, 6.6.5.4: until a new order is accepted.
            lasts = refused.error.type == ErrorType.NO_ORDER_TO_CANCEL and self._vehicle.version is Version.V3
            self._report(Topic.ORDER if lasts else Topic.INSTANT_ACTIONS, refused.error)
            return False
        self.record = begun.record
        self._send_state |= begun.send_state
        self._send_factsheet |= begun.send_factsheet
        self._outputs.pose = begun.pose or self._outputs.pose
        return True

    def _report(self, topic: Topic, error: Error) -> None:
        """An error is reported until the next message of its topic is accepted; of many, the newest."""
        errors = self._errors[topic]
        errors.pop(error, None)
        errors[error] = None
        while len(errors) > _MAX_ERRORS:
            errors.pop(next(iter(errors)))

    def _follow_mode(self, robot: RobotView) -> None:
        """3.0.0, 6.6.5.4 and table 10."""
        order = self.record.order
        mode = acceptance.mode_of(robot, order)
        if mode is Mode.AUTOMATIC:
            kept = (error for error in self._errors[Topic.ORDER] if error.type != ErrorType.NOT_AVAILABLE)
            self._errors[Topic.ORDER] = dict.fromkeys(kept)
        elif mode is Mode.SERVICE and self.record.last_node and (order is None or not order.under_way):
            self.record = self.record.model_copy(update={"last_node": ""})

    # --- mission manager ---------------------------------------------------------------------------------------------

    def _ask(self, now_s: float) -> None:
        if self._asked is not None and now_s - self._asked_s < self._params.answer_timeout_s:
            return
        if now_s < self._retry_s:
            return
        request = self._due()
        self._asked = request
        if request is not None:
            self._asked_s = now_s
            self._outputs.request = request  # in the place of one that could not be sent yet

    def _due(self) -> Request | None:
        self._number += 1
        order = self.record.order
        if order is None:
            return None
        cancelling = order.phase is Phase.CANCELLING
        kind = "" if cancelling else instant.wanted(self.record)
        # Not until the order is there: what is to be paused.
        if kind and order.part is not None and order.part.seen:
            return Request(self._number, _OPERATIONS[kind], order.part.id)
        order, request = progress.due(order, self._number)
        self.record = self.record.model_copy(update={"order": order})
        return request

    # --- state -------------------------------------------------------------------------------------------------------

    def _stands(self, robot: RobotView) -> bool:
        twist, params = robot.twist, self._params
        if twist is None or not twist.is_finite():
            return True
        return twist.speed() <= params.standstill_mps and abs(twist.omega) <= params.standstill_radps

    def _publish(self, robot: RobotView, standing: bool, now_s: float, unix_s: float) -> None:
        params = self._params
        if self._send_factsheet:
            self._send(Topic.FACTSHEET, self._factsheet, unix_s)
            self._send_factsheet = False
        since_s = now_s - self._state_s
        if since_s >= params.state_min_interval_s:
            errors = [error for of_topic in self._errors.values() for error in of_topic]
            state = report.state_of(
                self.record, robot, self._vehicle, errors, standing=standing, base_request_m=params.base_request_m
            )
            event = report.event_of(state)
            if self._send_state or event != self._sent or since_s >= params.state_period_s:
                self._send(Topic.STATE, state, unix_s)
                self._state_s, self._sent, self._send_state = now_s, event, False
        if params.visualization_rate_hz and now_s - self._shown_s >= 1.0 / params.visualization_rate_hz:
            self._shown_s = now_s
            shown = report.position_of(robot, self._vehicle)
            if self._vehicle.version is Version.V3:
                shown["referenceStateHeaderId"] = self._headers.last(Topic.STATE)
            self._send(Topic.VISUALIZATION, shown, unix_s)

    def _send(self, topic: Topic, body: codec.Data, unix_s: float) -> None:
        header: dict[str, Any] = self._headers.next(topic, unix_s)
        self._outputs.messages[topic] = codec.encode(topic, header | body, self._vehicle.version)

    def _reserve(self) -> None:
        reserved = self._headers.reserve()
        if reserved != self.record.reserved:
            self.record = self.record.model_copy(update={"reserved": reserved})
