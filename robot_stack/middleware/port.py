"""The middleware port: the interface of a node to its middleware.

Two implementations exist: ``robot_stack.ros.port.RosPort`` (rclpy and DDS, one process per node) and the simulated port
of the deterministic scheduler (one process, virtual time). A node holds exactly one port, independent of which.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from enum import Enum, auto
from typing import Any, ParamSpec, Protocol, TypeVar

from robot_stack.contract.model import Action, Topic
from robot_stack.core.goals import GoalStatus
from robot_stack.core.node_record import NodeRecord
from robot_stack.core.worker import Worker
from robot_stack.middleware.timers import NodeTimer

P = ParamSpec("P")
T = TypeVar("T")


class Logger(Protocol):
    """As rclpy's logger. ``throttle_duration_sec`` limits the calls of one code line."""

    def debug(self, message: str, **options: Any) -> Any: ...
    def info(self, message: str, **options: Any) -> Any: ...
    def warning(self, message: str, **options: Any) -> Any: ...
    def error(self, message: str, **options: Any) -> Any: ...


class Publisher(Protocol):
    """The publisher of one topic. May be used from any thread on ROS."""

    @property
    def topic_name(self) -> str: ...

    def publish(self, message: Any) -> None:
        """A message object, or the bytes of one that is serialised already (CDR with its encapsulation header)."""
        ...

    def get_subscription_count(self) -> int:
        """Subscribers that are matched now."""
        ...


class Subscription(Protocol):
    """A node's subscription."""

    def end(self) -> None:
        """No further callback is called."""
        ...


class ServiceClient(Protocol):
    def service_is_ready(self) -> bool: ...

    def call(self, request: Any, done: Callable[[Any], None]) -> None:
        """Sends a request. ``done`` is called with the response in the node's loop, or never if it is lost."""
        ...


class ActionGoal(Protocol):
    """A goal on the server's side. Exactly one of ``succeed``, ``abort`` and ``cancel`` ends it."""

    @property
    def request(self) -> Any: ...
    @property
    def goal_id(self) -> bytes: ...
    @property
    def is_active(self) -> bool: ...
    @property
    def is_cancel_requested(self) -> bool: ...
    def publish_feedback(self, feedback: Any) -> None: ...
    def succeed(self, result: Any) -> None: ...
    def abort(self, result: Any) -> None: ...
    def cancel(self, result: Any) -> None: ...


class CancelAnswer(Enum):
    """An action server's answer to the request to cancel a goal."""

    ACCEPTED = auto()
    REJECTED = auto()
    UNKNOWN_GOAL = auto()
    ALREADY_ENDED = auto()


class ClientGoal(Protocol):
    """A goal on the client's side. Its id is valid whether or not the server's answer arrives."""

    def ask_result(self, done: Callable[[GoalStatus, Any], None]) -> None:
        """``done`` is called with the result once the goal has ended; may be called repeatedly."""
        ...

    def cancel(self, done: Callable[[CancelAnswer], None]) -> None: ...


class ActionClient(Protocol):
    def server_is_ready(self) -> bool: ...

    def send_goal(self, request: Any, accepted: Callable[[bool], None], feedback: Callable[[Any], None]) -> ClientGoal:
        """accepted: called with the server's answer. feedback: called with each feedback message."""
        ...

    def cancel_all(self, before: Any) -> None:
        """Requests the server to cancel every goal that was accepted up to the stamp ``before``."""
        ...


class Port(Protocol):
    """One node's access to the middleware. Callbacks run one at a time in the node's loop."""

    @property
    def name(self) -> str: ...
    @property
    def logger(self) -> Logger: ...

    @property
    def process_id(self) -> int:
        """Differs between two runs of the node, also after a restart."""
        ...

    @property
    def node_record(self) -> NodeRecord:
        """The node's state for this machine: alive, ready, waiting for."""
        ...

    # --- time --------------------------------------------------------------------------------------------------------

    @property
    def simulated_time(self) -> bool: ...

    def now_ns(self) -> int:
        """The ROS clock."""
        ...

    def steady_s(self) -> float:
        """For ages and watchdogs: never stepped, and stands still while this process is paused."""
        ...

    def monotonic_s(self) -> float:
        """The computer's monotonic clock, also where simulated time stands still."""
        ...

    def device_s(self) -> float:
        """The clock by which the computer times its devices: the monotonic clock, or the simulated world's time."""
        ...

    def system_s(self) -> float:
        """The computer's system clock, which may be stepped."""
        ...

    def age_s(self, real_s: float) -> float:
        """The age on the ROS clock of a value read ``real_s`` ago by the computer's monotonic clock."""
        ...

    def add_timer(self, period_s: float, callback: Callable[[], Any]) -> NodeTimer:
        """A timer on the steady clock, or on simulated time."""
        ...

    def add_real_timer(self, period_s: float, callback: Callable[[], Any]) -> NodeTimer:
        """A timer on the computer's monotonic clock."""
        ...

    def call_soon(self, callback: Callable[[], None], *, wakes: bool = True) -> None:
        """Calls ``callback`` once in the node's loop; may be called from any thread.

        wakes: wakes the loop; otherwise the call waits for the next wake-up.
        """
        ...

    # --- endpoints ---------------------------------------------------------------------------------------------------

    def advertise(self, row: Topic, name: str) -> Publisher: ...

    def subscribe(
        self, row: Topic, name: str, callback: Callable[[Any, float], None], depth: int, *, wakes: bool, raw: bool
    ) -> Subscription:
        """callback: called with the message and the steady time of its reception. Clouds and images come as views on
        the received bytes (``robot_stack.middleware.wire``). depth: messages kept until the node reads them. wakes: a
        message wakes the node; otherwise it is read at the next tick. raw: the bytes instead of the message.
        """
        ...

    def listen(self, row: Topic, callback: Callable[[Any, int, int], None], *, raw: bool, wakes: bool) -> Subscription:
        """Subscribes with a deep queue. callback: the message (raw: its bytes), and the times in ns on the ROS clock at
        which it was received and sent.
        """
        ...

    def prepare_bulk(self) -> None:
        """Makes the resources for subscriptions to clouds and images in advance."""
        ...

    def serve(self, type_name: str, name: str, callback: Callable[[Any, Any, Callable[[Any], None]], None]) -> None:
        """callback: called with the request, an empty response, and a function that sends the response."""
        ...

    def client(self, type_name: str, name: str) -> ServiceClient: ...

    def serve_action(self, row: Action, name: str, on_goal: Callable[[ActionGoal], None]) -> None:
        """Accepts every goal and every request to cancel. on_goal: called once a goal is accepted."""
        ...

    def action_client(self, row: Action) -> ActionClient: ...

    def count_publishers(self, name: str) -> int: ...
    def count_subscribers(self, name: str) -> int: ...
    def publisher_nodes(self, name: str) -> list[str]: ...
    def subscriber_nodes(self, name: str) -> list[str]: ...
    def node_names(self) -> list[str]: ...

    # --- beside the loop ---------------------------------------------------------------------------------------------

    def worker(self, name: str, *, world_waits: bool = False) -> Worker:
        """world_waits: a simulated world stands still while a job runs, so that its result arrives at the same
        simulated time, independent of the speed of the machine.
        """
        ...

    def device(self, make: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Makes a connection of the node to hardware: ``make(*arguments, **options)``.

        The scheduler makes its own counterpart of ``make`` instead, e.g. an engine in the same process.
        """
        ...

    # --- start and end -----------------------------------------------------------------------------------------------

    def parameter_overrides(self) -> Mapping[str, Any]:
        """Parameters given at the start, by dotted name, without those of the middleware itself."""
        ...

    def show_parameters(self, values: Mapping[str, Any]) -> None:
        """Shows the parameters in force, read-only."""
        ...

    def follow_clock(self) -> None:
        """Sets the middleware's own clock to the world's time in shared memory."""
        ...

    def report_values(self) -> Mapping[str, str]:
        """Values that the port adds to the node's entry in /diagnostics."""
        ...

    def wait_until(self, condition: Callable[[], bool], timeout_s: float, *, loop: bool = False) -> None:
        """For ``safe_output`` only: polls ``condition`` every 10 ms until it holds, at most until the timeout.

        loop: the node's callbacks run meanwhile.
        """
        ...

    def wait_delivered(self, timeout_s: float) -> None:
        """Waits until the last published messages have left the process."""
        ...

    def close(self) -> None: ...


OpenPort = Callable[[str], Port]
_open_port: list[OpenPort] = []


def open_port(name: str) -> Port:
    """The port of a node under construction: rclpy's, unless ``ports_from`` is active."""
    if _open_port:
        return _open_port[-1](name)
    port: Port = importlib.import_module("robot_stack.ros.port").RosPort(name)
    return port


@contextmanager
def ports_from(open_port: OpenPort) -> Iterator[None]:
    """Nodes constructed in this context get their port from ``open_port``."""
    _open_port.append(open_port)
    try:
        yield
    finally:
        _open_port.pop()
