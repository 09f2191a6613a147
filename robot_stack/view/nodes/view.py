"""The live view: forwards the raw bytes of subscribed topics to Foxglove's websocket server.

A separate tool in the graph, not a process of a profile: it publishes nothing and accepts nothing from its viewers.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable
from typing import Any

import foxglove

from robot_stack.contract.model import System
from robot_stack.ros import transport
from robot_stack.ros.interfaces import interface_class, listener_profile
from robot_stack.ros.tool_node import ToolNode
from robot_stack.view.channels import MODEL, has_model, offered
from robot_stack.view.nodes.log_clock import LogClock
from robot_stack.view.nodes.robot_model import RobotModel
from robot_stack.view.nodes.server import Event, Listener, channel_of, start_server
from robot_stack.view.params import ViewParams
from robot_stack.view.watching import Change, Watching

NAME = "robot_stack_view"


class View:
    """A context manager. With a simulated clock, messages are logged in the world's time, like their stamps.

    Raises ViewError if the port is not available.
    """

    def __init__(self, params: ViewParams, machine: System) -> None:
        transport.apply(bulk=True)
        transport.keep_memory()
        rows = offered(machine)
        self._params = params
        self._clock = LogClock()
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        # Kept: channels of a deleted context are not advertised.
        self._context = context = foxglove.Context()
        self._channels = {row.name: channel_of(row, context) for row in rows.values()}
        self._model = RobotModel(context, params) if has_model(machine) else None
        self._watching = Watching(rows)
        self._rows = rows
        self._subscriptions: dict[str, Any] = {}
        self._server = start_server(params, Listener(self._events), context)
        self._tool = ToolNode(NAME)

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()
        self._tool.close()

    @property
    def port(self) -> int:
        return int(self._server.port)

    def run(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Runs until ``stopped`` returns True, checked after each wake-up; sleeps without subscriptions."""
        period_s = 1.0 / self._params.take_hz
        due_s = time.monotonic()
        while not stopped():
            self._follow(max(0.0, due_s - time.monotonic()) if self._subscriptions else None)
            if time.monotonic() >= due_s:
                due_s = time.monotonic() + period_s
                self._take()

    def wake(self) -> None:
        """Triggers a check of ``stopped``; from any thread."""
        self._events.put(Event(-1, "", looks=False))

    def _follow(self, timeout_s: float | None) -> None:
        """Waits for the next change of subscriptions and applies it."""
        try:
            client, channel, looks = self._events.get(timeout=timeout_s)
        except queue.Empty:
            return
        change = self._watching.begin(client, channel) if looks else self._watching.end(client, channel)
        self._subscribe(change)

    def _subscribe(self, change: Change) -> None:
        for name in change.end:
            self._tool.node.destroy_subscription(self._subscriptions.pop(name))
        for name in change.begin:
            row = self._rows[name]
            self._subscriptions[name] = self._tool.node.create_subscription(
                interface_class(row.type), name, lambda _: None, listener_profile(row), raw=True
            )

    def _take(self) -> None:
        """Forwards all received messages. Without an executor, which would wake for every single message."""
        log_ns = self._clock.now_ns()
        for name, subscription in self._subscriptions.items():
            channel, handle = self._channels[name], subscription.handle
            while (taken := handle.take_message(subscription.msg_type, True)) is not None:
                channel.log(taken[0], log_time=log_ns)
                if self._model is not None:
                    self._model.update(name, taken[0])
        if self._model is not None and self._watching.looked_at(MODEL):
            self._model.show(log_ns)
