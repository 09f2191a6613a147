"""The live view: hands the bytes of the topics that somebody looks at to Foxglove's websocket server, as they are.

A tool of its own in the graph, no process of a profile: it publishes nothing and takes nothing from its viewers.
"""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import foxglove
from foxglove.channels import SceneUpdateChannel
from foxglove.websocket import ChannelView, Client, ServerListener
from rclpy.serialization import deserialize_message

from robot_stack.contract import topics
from robot_stack.contract.model import System, Topic
from robot_stack.core.display_patterns import load_patterns
from robot_stack.core.docks import load_docks
from robot_stack.core.message_definitions import message_definition
from robot_stack.core.robot import load_robot
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.core.world_clock import WorldClock
from robot_stack.ros import transport
from robot_stack.ros.guest import Guest
from robot_stack.ros.interfaces import interface_class, listener_profile
from robot_stack.view.channels import MODEL, has_model, offered
from robot_stack.view.display import DisplayPanel
from robot_stack.view.params import ViewParams
from robot_stack.view.scene import Model, joint_angles
from robot_stack.view.watching import Change, Watching

NAME = "robot_stack_view"
_CLOCK_LOOKUP_S = 1.0
_SILENT_S = 1.0  # a robot whose joints have been silent for so long is not drawn


class ViewError(Exception):
    """The server cannot start. The message says why."""


class View:
    """A context manager. Beside a simulated clock, messages are logged in the world's time, which their stamps are of.

    Raises ViewError if the port cannot be had.
    """

    def __init__(self, params: ViewParams, machine: System) -> None:
        transport.apply(bulk=True)
        transport.keep_memory()
        rows = offered(machine)
        self._params = params
        self._clock = _LogClock()
        self._events: queue.SimpleQueue[_Event] = queue.SimpleQueue()
        # Kept: channels whose context has gone are not advertised.
        self._context = context = foxglove.Context()
        self._channels = {row.name: _channel(row, context) for row in rows.values()}
        self._model = _RobotModel(context, params) if has_model(machine) else None
        self._watching = Watching(rows)
        self._rows = rows
        self._subscriptions: dict[str, Any] = {}
        self._server = _serve(params, _Listener(self._events), context)
        self._guest = Guest(NAME)

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()
        self._guest.close()

    @property
    def port(self) -> int:
        return int(self._server.port)

    def run(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Until ``stopped``, asked after each look; it sleeps while nobody looks at anything."""
        period_s = 1.0 / self._params.take_hz
        due_s = time.monotonic()
        while not stopped():
            self._follow(max(0.0, due_s - time.monotonic()) if self._subscriptions else None)
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + period_s
                self._take()

    def wake(self) -> None:
        """Has ``stopped`` asked; from any thread."""
        self._events.put(_Event(-1, "", looks=False))

    def _follow(self, timeout_s: float | None) -> None:
        """Waits for the next viewer's command, and does it."""
        try:
            client, channel, looks = self._events.get(timeout=timeout_s)
        except queue.Empty:
            return
        change = self._watching.begin(client, channel) if looks else self._watching.end(client, channel)
        self._subscribe(change)

    def _subscribe(self, change: Change) -> None:
        for name in change.end:
            self._guest.node.destroy_subscription(self._subscriptions.pop(name))
        for name in change.begin:
            row = self._rows[name]
            self._subscriptions[name] = self._guest.node.create_subscription(
                interface_class(row.type), name, lambda _: None, listener_profile(row), raw=True
            )

    def _take(self) -> None:
        """Passes on everything that has arrived. Without an executor: it would wake for every single message."""
        log_ns = self._clock.now_ns()
        for name, subscription in self._subscriptions.items():
            channel, handle = self._channels[name], subscription.handle
            while (taken := handle.take_message(subscription.msg_type, True)) is not None:
                channel.log(taken[0], log_time=log_ns)
                if self._model is not None:
                    self._model.heard(name, taken[0])
        if self._model is not None and self._watching.looked_at(MODEL):
            self._model.show(log_ns)


class _Event(NamedTuple):
    client: int
    channel: str
    looks: bool


class _Listener(ServerListener):
    """Called in threads of the server."""

    def __init__(self, events: queue.SimpleQueue[_Event]) -> None:
        self._events = events

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        self._events.put(_Event(client.id, channel.topic, looks=True))

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Also when the client has gone."""
        self._events.put(_Event(client.id, channel.topic, looks=False))


class _RobotModel:
    """The robot's model from the newest joint angles, and above it what its display says that it shows."""

    def __init__(self, context: foxglove.Context, params: ViewParams) -> None:
        self._channel = SceneUpdateChannel(MODEL, context=context)
        self._model = Model(load_robot(), load_robot_shape(), load_docks())
        self._panel = DisplayPanel(params.display, load_patterns())
        self._period_s = 1.0 / params.model_hz
        self._due_s = self._heard_s = 0.0
        self._joints: bytes = b""
        self._attached = False
        self._shown: int | None = None
        self._shown_since_s = self._shown_heard_s = -math.inf

    def heard(self, topic: str, data: bytes) -> None:
        if topic == topics.JOINT_STATES.name:
            self._joints, self._heard_s = data, time.monotonic()
        elif topic == topics.PASSENGER_ATTACHED.name:
            self._attached = _message(topics.PASSENGER_ATTACHED, data).data
        elif topic == topics.EHMI_STATUS.name:
            self._display_heard(_message(topics.EHMI_STATUS, data))

    def _display_heard(self, status: Any) -> None:
        self._shown_heard_s = time.monotonic()
        known = status.linked and status.acknowledged_state != status.NO_STATE
        state = status.acknowledged_state if known else None
        if state != self._shown:
            self._shown, self._shown_since_s = state, self._shown_heard_s

    def show(self, now_ns: int) -> None:
        now_s = time.monotonic()
        if now_s < self._due_s or now_s - self._heard_s > _SILENT_S or not self._joints:
            return
        self._due_s = now_s + self._period_s
        states = _message(topics.JOINT_STATES, self._joints)
        angles = joint_angles(states.name, states.position)
        assert topics.EHMI_STATUS.stale_s is not None
        told = now_s - self._shown_heard_s <= topics.EHMI_STATUS.stale_s
        panel = [self._panel.entity(self._shown, now_s - self._shown_since_s, now_ns)] if told else []
        self._channel.log(self._model.update(angles, self._attached, now_ns, panel), log_time=now_ns)


class _LogClock:
    """The time that viewers sort messages by."""

    def __init__(self) -> None:
        self._world: WorldClock | None = None
        self._lookup_s = 0.0

    def now_ns(self) -> int:
        if time.monotonic() >= self._lookup_s:  # a stack that starts anew has a new clock
            self._lookup_s = time.monotonic() + _CLOCK_LOOKUP_S
            self._world = WorldClock.find()
        return time.time_ns() if self._world is None else self._world.now_ns()


def _message(row: Topic, data: bytes) -> Any:
    return deserialize_message(data, interface_class(row.type))


def _channel(row: Topic, context: foxglove.Context) -> foxglove.Channel:
    text = message_definition(row.type).encode()
    schema = foxglove.Schema(name=row.type, encoding="ros2msg", data=text)
    return foxglove.Channel(row.name, schema=schema, message_encoding="cdr", context=context)


def _serve(params: ViewParams, listener: ServerListener, context: foxglove.Context) -> Any:
    try:
        return foxglove.start_server(
            name="robot_stack",
            host=params.host,
            port=params.port,
            server_listener=listener,
            context=context,
            message_backlog_size=params.backlog_messages,
        )
    except RuntimeError as error:
        raise ViewError(
            f"port {params.port} of {params.host} cannot be had: {error}; `robot-stack view --port` takes another"
        ) from error
