"""What the agent journals: it resumes from this after a restart."""

from __future__ import annotations

from enum import StrEnum
from hashlib import blake2b
from typing import Annotated, Final

from pydantic import Field

from robot_stack.core.config import Config
from robot_stack.core.geometry import Pose2
from robot_stack.fleet.vehicle import Stop

NOT_SENT: Final = -1
RESULT_LENGTH: Final = 60


class Status(StrEnum):
    """``actionStatus``. INITIALIZING is not used: an action begins at once."""

    WAITING = "WAITING"
    RUNNING = "RUNNING"
    PAUSED = "PAUSED"
    FINISHED = "FINISHED"
    FAILED = "FAILED"

    @property
    def ended(self) -> bool:
        return self in (Status.FINISHED, Status.FAILED)


class ActionState(Config):
    """node: sequence id of its node, of an action of the order."""

    id: str
    type: str
    status: Status = Status.WAITING
    result: str = ""
    node: int = 0


class GraphPart(Config):
    """A node or an edge that is not traversed yet."""

    id: str
    sequence_id: int
    released: bool


class Phase(StrEnum):
    ACTIVE = "ACTIVE"
    CANCELLING = "CANCELLING"
    COMPLETED = "COMPLETED"
    CANCELLED = "CANCELLED"
    ABORTED = "ABORTED"


class Part(Config):
    """One order of the mission manager. An order of the fleet that goes on after its end has several in turn.

    stops: the route as far as it is known. open: it may be extended. sent, acknowledged: how many of the stops the
    mission manager was given and has taken, NOT_SENT before the order; likewise sent_open, acknowledged_open.
    seen: the mission manager has shown it. done: how many stops are completed. refusal: of the newest extension by the
    mission manager, empty once it is taken.
    """

    id: str
    stops: tuple[Stop, ...]
    open: bool
    sent: int = NOT_SENT
    sent_open: bool = False
    acknowledged: int = NOT_SENT
    acknowledged_open: bool = False
    seen: bool = False
    done: int = 0
    ended: bool = False
    refusal: str = ""

    @property
    def pending(self) -> bool:
        """The mission manager has not taken all of it."""
        return (self.acknowledged, self.acknowledged_open) != (len(self.stops), self.open)


class OrderRecord(Config):
    """nodes, edges: what is not traversed yet. decision: (nodeId, sequenceId) of the last released node.

    end: where the base ends. loaded: a wheelchair is attached at the end of the base. reason: why it ended early.
    unreachable: the node that it failed to reach.
    charging: the base ends docked to a charger.
    load_ids: loadId of each pick, by its action. part: the last order of the mission manager, part_number: how many
    there were. waiting: stops of the next one. accepted_ms: Unix time of the order, for ids. cancel_refused: by the
    mission manager, at least once. digest: of the newest message.
    """

    id: str
    update_id: int
    phase: Phase = Phase.ACTIVE
    reason: str = ""
    unreachable: str = ""
    nodes: tuple[GraphPart, ...]
    edges: tuple[GraphPart, ...]
    decision: tuple[str, int]
    end: Pose2
    loaded: bool
    charging: bool = False
    actions: tuple[ActionState, ...]
    load_ids: dict[str, str] = {}
    part: Part | None = None
    part_number: int = 0
    waiting: tuple[Stop, ...] = ()
    accepted_ms: int
    cancel_refused: bool = False
    digest: str = ""

    @property
    def horizon(self) -> bool:
        return any(not node.released for node in self.nodes)

    @property
    def open_end(self) -> bool:
        """The mission manager does not end its order with the base: it is extended, or leaves the charger."""
        return self.horizon or self.charging

    @property
    def charges(self) -> bool:
        """For the master the order has ended: the robot is docked to a charger."""
        return self.charging and self.phase is Phase.ACTIVE and all(action.status.ended for action in self.actions)

    @property
    def under_way(self) -> bool:
        return self.phase in (Phase.ACTIVE, Phase.CANCELLING)


class Record(Config):
    """reserved: per topic, the header ids below are used up, or were when the agent ended.

    past_orders, past_actions: digests of the orderIds, and of the actionIds of instant actions, that the state does not
    show any more, newest last. A copy of their message that arrives late has no effect.
    """

    order: OrderRecord | None = None
    last_node: str = ""
    last_sequence_id: int = 0
    instant: tuple[ActionState, ...] = ()
    reserved: dict[str, Annotated[int, Field(ge=0)]] = {}
    past_orders: tuple[str, ...] = ()
    past_actions: tuple[str, ...] = ()


def digest(text: str) -> str:
    """Of an id: as long for each."""
    return blake2b(text.encode(), digest_size=8).hexdigest()
