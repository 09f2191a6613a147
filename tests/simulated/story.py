"""Common functions of tests on the scheduler: waits in virtual time, received messages, service and action calls."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from custom_msgs.srv import InjectFault
from robot_stack.contract import services
from robot_stack.contract.model import Action, Durability, Service, Topic
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.interfaces import interface_class
from robot_stack.middleware.port import Port, Publisher
from sim.scheduler.scheduler import Scheduler

ValueT = TypeVar("ValueT")
_POLL_S = 0.005
_LIMIT_S = 10.0
_DISCOVERY_S = 5.0


class Received:
    """Messages received on a topic: (virtual time in s, message) pairs."""

    def __init__(self, story: Story, name: str) -> None:
        self._story, self._name = story, name
        self.items: list[tuple[float, Any]] = []

    @property
    def messages(self) -> list[Any]:
        return [message for _, message in self.items]

    @property
    def times_s(self) -> list[float]:
        return [time_s for time_s, _ in self.items]

    @property
    def last(self) -> Any:
        return self.items[-1][1] if self.items else None

    def since(self, time_s: float) -> list[Any]:
        """Messages received later than ``time_s``."""
        return [message for received_s, message in self.items if received_s > time_s]

    def wait(
        self, condition: Callable[[Any], Any] = lambda _: True, what: str = "a message", limit_s: float = _LIMIT_S
    ) -> Any:
        """Returns the newest message or the first later one that meets the condition."""
        asked = max(0, len(self.items) - 1)

        def found() -> Any:
            nonlocal asked
            while asked < len(self.items):
                if condition(self.items[asked][1]):
                    return self.items[asked]
                asked += 1
            return None

        return self._story.wait(found, f"{what} on {self._name}; the newest is {self._text}", limit_s)[1]

    def wait_next(self, count: int = 1, limit_s: float = _LIMIT_S) -> list[Any]:
        """Waits for the next messages."""
        begun = len(self.items)
        self._story.wait(lambda: len(self.items) >= begun + count, f"{count} messages on {self._name}", limit_s)
        return [message for _, message in self.items[begun : begun + count]]

    def period_s(self, count: int = 20) -> float:
        """The mean time between the newest ``count + 1`` messages."""
        times = self.times_s[-count - 1 :]
        assert len(times) == count + 1, f"{len(times)} messages on {self._name} so far"
        return (times[-1] - times[0]) / count

    @property
    def _text(self) -> Text:
        return Text(lambda: str(self.last)[:400])


class Text:
    """A text that is computed when it is read."""

    def __init__(self, make: Callable[[], str]) -> None:
        self._make = make

    def __str__(self) -> str:
        return self._make()


class Goal:
    """A goal of an action. states: the feedback's states in order. result: None until it ends."""

    def __init__(self, story: Story, port: Port, row: Action, request: Any) -> None:
        self._story = story
        self.states: list[str] = []
        self.feedback: list[Any] = []
        self.accepted: bool | None = None
        self.status: GoalStatus | None = None
        self.result: Any = None
        client = port.action_client(row)
        story.wait(client.server_is_ready, f"a server of {row.name}")
        self._goal = client.send_goal(request, self._on_accepted, self._on_feedback)

    def cancel(self, limit_s: float = _LIMIT_S) -> Any:
        self._goal.cancel(lambda _: None)
        return self.wait(limit_s)

    def wait(self, limit_s: float = _LIMIT_S) -> Any:
        """Waits for the result."""
        return self._story.wait(lambda: self.result, f"the result; states so far {self.states}", limit_s)

    def _on_accepted(self, accepted: bool) -> None:
        self.accepted = accepted
        if accepted:
            self._goal.ask_result(self._on_result)

    def _on_feedback(self, feedback: Any) -> None:
        self.feedback.append(feedback)
        state = getattr(feedback, "state", None)
        if state is not None and (not self.states or self.states[-1] != state):
            self.states.append(state)

    def _on_result(self, status: GoalStatus, result: Any) -> None:
        self.status, self.result = status, result


class Story:
    """A test in virtual time. port: of a tool, which may use every topic, service and action."""

    def __init__(self, scheduler: Scheduler, port: Port) -> None:
        self.scheduler = scheduler
        self._port = port
        self._publishers: dict[str, Publisher] = {}
        self._clients: dict[str, Any] = {}

    # --- time --------------------------------------------------------------------------------------------------------

    @property
    def now_s(self) -> float:
        """Virtual time."""
        return self.scheduler.now_s

    def run(self, duration_s: float) -> None:
        self.scheduler.run_for(duration_s)

    def wait(self, condition: Callable[[], ValueT], what: Any, limit_s: float = _LIMIT_S) -> ValueT:
        """Returns the first true value of ``condition``. On a timeout in virtual time raises AssertionError."""
        end_s = self.now_s + limit_s
        while True:
            value = condition()
            if value:
                return value
            assert self.now_s < end_s, f"waited {limit_s} s of virtual time for: {what}; {self.describe()}"
            self.scheduler.run_for(_POLL_S)

    def stays(self, condition: Callable[[], Any], what: str, duration_s: float) -> None:
        """Runs for the duration and checks the condition throughout."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            assert condition(), f"no longer true: {what}; {self.describe()}"
            self.scheduler.run_for(_POLL_S)
        assert condition(), f"no longer true: {what}; {self.describe()}"

    def describe(self) -> str:
        """The state of the test, for failure messages."""
        failures = "".join(f"; {item.process} failed: {item.text}" for item in self.scheduler.failures)
        return f"at {self.now_s:.3f} s{failures}"

    def log(self, node: str) -> str:
        """The log of a node."""
        return "\n".join(line.text for line in self.scheduler.log if line.node == node)

    # --- messages ----------------------------------------------------------------------------------------------------

    def listen(self, row: Topic, callback: Callable[[Any], object] = lambda _: None) -> Received:
        arrived = Received(self, row.name)

        def on_message(message: Any, *_: int) -> None:
            arrived.items.append((self.now_s, message))
            callback(message)

        self._port.listen(row, on_message, raw=False, wakes=True)
        return arrived

    def publisher(self, row: Topic) -> Publisher:
        if row.name not in self._publishers:
            self._publishers[row.name] = self._port.advertise(row, row.name)
        return self._publishers[row.name]

    def publish(self, row: Topic, message: Any) -> None:
        """Waits for a subscriber first, unless the topic is latched."""
        publisher = self.publisher(row)
        if row.qos.durability is Durability.VOLATILE:
            self.wait(publisher.get_subscription_count, f"a subscriber of {row.name}", _DISCOVERY_S)
        publisher.publish(message)

    def call(self, row: Service, request: Any = None, limit_s: float = _LIMIT_S) -> Any:
        """Calls a service and returns its response."""
        client = self._clients.get(row.name)
        if client is None:
            client = self._clients[row.name] = self._port.client(row.type, row.name)
        self.wait(client.service_is_ready, f"service {row.name}", limit_s)
        answers: list[Any] = []
        client.call(interface_class(row.type).Request() if request is None else request, answers.append)
        return self.wait(lambda: answers, f"an answer of {row.name}", limit_s)[0]

    def begin(self, row: Action, request: Any) -> Goal:
        """Sends a goal, which the server must accept."""
        goal = Goal(self, self._port, row, request)
        self.wait(lambda: goal.accepted is not None, f"an answer to the goal of {row.name}")
        assert goal.accepted, f"{row.name} rejected the goal"
        return goal

    def inject(
        self,
        kind: str,
        target: str = "",
        value: float = 0.0,
        duration_s: float = 0.0,
        *,
        into: Service = services.INJECT_FAULT,
    ) -> str:
        """Injects a fault by a service of type InjectFault; ``clear`` ends all faults."""
        answer = self.call(into, InjectFault.Request(kind=kind, target=target, value=value, duration_s=duration_s))
        assert answer.success, answer.message
        return str(answer.message)
