"""The row types of the contract: topic, service, action, process and fault.

The rows themselves live beside this file, one module per kind. Nothing here imports ROS, so that tests, tools and
documentation can read the contract anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

EVERY_NODE = "*"  # in the publishers and subscribers of a row


class ContractViolation(Exception):
    """A node asked for an endpoint, or for a number of a row, that the contract does not give."""


class System(Enum):
    """The machine a row belongs to. A profile runs the rows of one machine, never of both."""

    ROBOT = "robot"
    WMX = "wmx"
    SIMULATION = "simulation"


class Reliability(Enum):
    RELIABLE = "reliable"
    BEST_EFFORT = "best_effort"


class Durability(Enum):
    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of an endpoint. History is always KEEP_LAST(depth)."""

    reliability: Reliability
    durability: Durability
    depth: int

    def describe(self) -> str:
        return f"{self.reliability.name}, {self.durability.name}, depth {self.depth}"


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic.

    name: absolute topic name.
    type: ROS type, ``package/msg/Name``.
    qos: the QoS that publisher and subscribers of this stack use.
    rate_hz: publication rate of each publisher in Hz; None for topics published on events.
    stale_s: age in seconds after which a subscriber calls its newest message stale; None where age means nothing.
    queue: messages that a subscriber with a callback keeps until its next tick, if more than the QoS depth: for topics
     of which no message may be missed. It is not part of the endpoints' QoS negotiation.
    wakes: subscribers that a message wakes at once: stops, commands, goals, and inputs that a node processes. The
     others read it when they wake for another reason, at their tick at the latest; its age counts from its reception.
    bulk: messages so large that a socket loses them: they go by shared memory (``robot_stack.ros.transport``).
    on_demand: published at that rate only while its publisher has something to command; silence is no fault then.
    sometimes: those of its publishers and subscribers that have the endpoint only in some situations or configurations,
     each for a reason given in the row; the others always have it.
    publishers, subscribers: node names. ``EVERY_NODE`` stands for every node process; names in ``OUTSIDE`` belong to
        tools and operators outside the process table.
    """

    name: str
    type: str
    qos: Qos
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]
    note: str
    rate_hz: float | None = None
    stale_s: float | None = None
    queue: int | None = None
    wakes: tuple[str, ...] = ()
    on_demand: bool = False
    bulk: bool = False
    sometimes: tuple[str, ...] = ()
    system: System = System.ROBOT

    @property
    def nominal_rate_hz(self) -> float:
        """``rate_hz`` of a topic that has one. Raises ContractViolation for one that is published on events."""
        if self.rate_hz is None:
            raise ContractViolation(f"{self.name} has no rate: it is published on events")
        return self.rate_hz

    @property
    def stale_limit_s(self) -> float:
        """``stale_s`` of a topic that has one. Raises ContractViolation for one whose age means nothing."""
        if self.stale_s is None:
            raise ContractViolation(f"{self.name} has no staleness limit: its age is not checked")
        return self.stale_s

    def wakes_node(self, node: str) -> bool:
        """True if a message wakes this subscriber."""
        return node in self.wakes or EVERY_NODE in self.wakes


@dataclass(frozen=True, slots=True)
class Service:
    """One service: ``type`` is ``package/srv/Name``, ``server`` the node that offers it."""

    name: str
    type: str
    server: str
    note: str
    system: System = System.ROBOT


@dataclass(frozen=True, slots=True)
class Action:
    """One action: ``type`` is ``package/action/Name``, ``server`` the node that offers it, ``clients`` its callers."""

    name: str
    type: str
    server: str
    clients: tuple[str, ...]
    note: str
    system: System = System.ROBOT


class Criticality(Enum):
    """Effect of the loss of a process on the ride (fault NODE_DEAD) and on the supervisor's restart."""

    CRITICAL = "critical"  # the robot stops
    LIMITING = "limiting"  # the robot goes on, slowly
    OPTIONAL = "optional"  # a convenience; its loss is shown and nothing else


@dataclass(frozen=True, slots=True)
class Process:
    """One operating-system process of the stack.

    name: process name, also the name of its first node and of its executable.
    module: Python module with ``main``; None while the process is specified but not built.
    nodes: ROS node names that live in it, the process's own first.
    max_restarts: restarts within a minute before the supervisor gives up on it.
    """

    name: str
    module: str | None
    criticality: Criticality
    note: str
    nodes: tuple[str, ...]
    system: System = System.ROBOT
    max_restarts: int = 5

    @property
    def available(self) -> bool:
        return self.module is not None


class SafetyAction(IntEnum):
    """What a fault does to the motion, mildest first: of several active faults the greatest wins."""

    NONE = 0
    WARN = 1
    LIMIT = 2
    STOP = 3
    EMERGENCY_STOP = 4


class SafetyState(IntEnum):
    """The states of ``/safety/status``, mildest first."""

    NORMAL = 0
    DEGRADED = 1
    COLLISION_AVOIDANCE = 2
    EMERGENCY_STOP = 3


class Clears(Enum):
    """How a raised fault goes away."""

    WHEN_GONE = "when gone"  # the condition has been false for the row's clear_after_s
    ON_RESET = "reset"  # latched: only /safety/reset, once the condition is gone


@dataclass(frozen=True, slots=True)
class Fault:
    """One row of the closed fault list.

    raised_when: the condition in words; its thresholds are the safety monitor's parameters.
    action: the most severe action the row can ask for.
    state: the safety state it shows.
    clears: how it goes away; clear_after_s: for how many seconds the condition must be gone first.
    gentle: its stop may use the deceleration of an ordinary ride: the way ahead is observed and free.
    """

    code: str
    raised_when: str
    action: SafetyAction
    state: SafetyState
    clears: Clears
    clear_after_s: float = 0.0
    gentle: bool = False
