"""Small nodes and contract rows for the tests of the scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from robot_stack.contract.model import Durability, Qos, Reliability, Topic
from robot_stack.middleware.port import Port, open_port
from sim.scheduler import Scheduler, SchedulerParams
from sim.scheduler.process import Process

VOLATILE, LATCHED = Durability.VOLATILE, Durability.TRANSIENT_LOCAL


def row(name: str = "/count", *, depth: int = 10, durability: Durability = VOLATILE, bulk: bool = False) -> Topic:
    """Returns a topic of integers that any node may use."""
    return Topic(
        name, "std_msgs/msg/Int32", Qos(Reliability.RELIABLE, durability, depth), ("*",), ("*",), "test", bulk=bulk
    )


def constant(milliseconds: float) -> dict[str, float]:
    return {"median_ms": milliseconds, "p99_ms": milliseconds}


def params(**changes: Any) -> SchedulerParams:
    """Returns durations without jitter: latency 1 ms, calls 2 ms, discovery 100 ms, start 10 ms, construction 50 ms,
    computing 3 ms, jobs 20 ms. changes: top-level entries.
    """
    named = {"names": {}}
    values: dict[str, Any] = {
        "latency": {"small": constant(1.0), "bulk": constant(5.0), "call": constant(2.0), "rows": {}},
        "discovery": {"appear": constant(100.0), "leave": constant(30.0), "lease_s": 2.0},
        "start": {"default": constant(10.0), **named},
        "construction": {"default": constant(50.0), **named},
        "compute": {"default": constant(3.0), **named},
        "workers": {"default": constant(20.0), **named},
    }
    return SchedulerParams.model_validate({**values, **changes})


READY_S = 0.2
"""With ``params``: time after which nodes spawned at 0 run and have discovered each other: 10 + 50 + 100 ms."""


class Bare:
    """A node that only does what ``build`` sets up on its port."""

    def __init__(self, name: str, build: Callable[[Port], Any]) -> None:
        self.port = open_port(name)
        self.ended: list[str] = []
        build(self.port)

    def safe_output(self) -> None:
        self.ended.append("safe")

    def destroy_node(self) -> None:
        self.ended.append("destroyed")
        self.port.close()


class Rig:
    """A scheduler with bare nodes."""

    def __init__(self, scheduler: Scheduler) -> None:
        self.scheduler = scheduler

    def node(self, name: str, build: Callable[[Port], Any] = lambda _: None, **options: Any) -> Process:
        return self.scheduler.spawn(name, lambda: Bare(name, build), **options)

    def port(self, name: str) -> Any:
        """The port of a node that was built."""
        life = self.scheduler.processes[name].life
        assert life is not None
        return life.ports[0]

    def talker(self, topic: Topic, name: str = "talker") -> Process:
        """Adds a node whose publisher is used from outside its loop, by ``say``."""
        return self.node(
            name, lambda port: self._publishers.__setitem__((name, topic.name), port.advertise(topic, topic.name))
        )

    def listener(
        self, topic: Topic, name: str = "listener", *, wakes: bool = True, depth: int | None = None, **options: Any
    ) -> list[tuple[float, int]]:
        """Adds a node that subscribes. Returns its received (virtual time in ms, value) pairs."""
        taken: list[tuple[float, int]] = []

        def build(port: Port) -> None:
            def on_message(message: Any, _: float) -> None:
                taken.append((round(1e3 * self.scheduler.now_s, 6), message.data))

            port.subscribe(topic, topic.name, on_message, depth or topic.qos.depth, wakes=wakes, raw=False)

        self.node(name, build, **options)
        return taken

    def say(self, at_ms: float, value: int, topic: Topic, name: str = "talker") -> None:
        from std_msgs.msg import Int32

        def publish() -> None:
            self._publishers[name, topic.name].publish(Int32(data=value))

        self.scheduler.at(round(at_ms * 1e6), publish)

    def publisher(self, topic: Topic, name: str = "talker") -> Any:
        return self._publishers[name, topic.name]

    @property
    def _publishers(self) -> dict[tuple[str, str], Any]:
        return self.__dict__.setdefault("publishers", {})


@contextmanager
def rig(seed: int = 1, given: SchedulerParams | None = None, *, parallel: bool = False) -> Iterator[Rig]:
    with Scheduler(seed, given or params(), parallel=parallel) as scheduler:
        yield Rig(scheduler)
