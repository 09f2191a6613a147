"""The queue of orders: which mission is started next, by whom it was ordered, and what became of the last ones.

Times in s of the node's clock (Unix time on a robot), because an order's earliest time outlives a restart.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum

from robot_stack.contract.states import HeldBy
from robot_stack.core.mission import Mission

# As in custom_msgs/MissionQueue. A mission is journaled with its order, so that the number of orders is limited.
MAX_ORDERS = 50
MAX_ENDED = 50
# By START_MISSION, which needs no PIN: riders cannot fill the queue.
MAX_UI_COMMANDS = 5
# builtin_interfaces/Time.
_LATEST_S = 2.0**31 - 1.0
MAX_ID_LENGTH = 64
NORMAL_PRIORITY = 100


class Origin(StrEnum):
    """``MissionOrder.origin``."""

    TOUCH_SCREEN = "touch_screen"
    CLI = "cli"
    FLEET = "fleet"
    UI_COMMAND = "ui_command"

    @property
    def text(self) -> str:
        """For people."""
        return "the command line" if self is Origin.CLI else "the fleet" if self is Origin.FLEET else "the touch screen"


class OrderState(IntEnum):
    """``MissionOrder.state``."""

    QUEUED = 0
    UNDER_WAY = 1
    COMPLETED = 2
    ABORTED = 3
    FAILED = 4
    REMOVED = 5


class Operation(IntEnum):
    """``EditMissionQueue.operation``."""

    ADD = 0
    REMOVE = 1
    MOVE = 2
    HOLD = 3
    RELEASE = 4
    REPLACE = 5
    EXTEND = 6
    CANCEL = 7
    PAUSE = 8
    RESUME = 9


WITH_ORDER = (Operation.ADD, Operation.REPLACE)
# Of an order of the request's own origin.
OF_ORIGIN = (Operation.EXTEND, Operation.CANCEL, Operation.PAUSE, Operation.RESUME)


class QueueRefusal(Exception):
    """A change of the queue is not possible. The message is one line for people."""


@dataclass(frozen=True, slots=True)
class Order:
    """One order.

    id: chosen by who gives the order. mission: as it was when ordered; None once the order was started or removed.
    priority: [0, 255], higher is earlier. earliest_s: not before this time, 0 = at once.
    route: digest of the route as it came with the order, empty for that of a mission file. open: it may be extended.
    """

    id: str
    mission_id: str
    origin: Origin
    priority: int = NORMAL_PRIORITY
    earliest_s: float = 0.0
    state: OrderState = OrderState.QUEUED
    mission: Mission | None = None
    route: str = ""
    open: bool = False

    def without_mission(self, state: OrderState) -> Order:
        return replace(self, state=state, mission=None, open=self.open and state is OrderState.UNDER_WAY)


@dataclass(frozen=True, slots=True)
class OrderQueue:
    """orders: waiting, in their sequence. current: of the mission under way, None also if that has no order.

    ended: the last ones, oldest first. number: of the next id that the mission manager chooses.
    """

    orders: tuple[Order, ...] = ()
    current: Order | None = None
    ended: tuple[Order, ...] = ()
    number: int = 1

    @property
    def under_way(self) -> tuple[Order, ...]:
        return () if self.current is None else (self.current,)

    def known(self, order_id: str) -> Order | None:
        """The order of this id in any state."""
        everything = (*self.orders, *self.under_way, *self.ended)
        return next((order for order in everything if order.id == order_id), None)

    def owned(self, order_id: str, origin: Origin | None) -> Order:
        """The known order of this id. Raises QueueRefusal without one, and for that of another origin."""
        order = self.known(order_id)
        if order is None:
            raise QueueRefusal(f"there is no order {order_id[:MAX_ID_LENGTH]!r}")
        if order.origin is not origin:
            raise QueueRefusal(f"the order {order_id!r} is from {order.origin.value}")
        return order

    def with_changed(self, order: Order) -> OrderQueue:
        """With ``order`` in the place of the waiting one, or the one under way, of its id."""
        if self.current is not None and self.current.id == order.id:
            return replace(self, current=order)
        return replace(self, orders=tuple(order if item.id == order.id else item for item in self.orders))

    def due(self, now_s: float) -> Order | None:
        """The first order whose time has come. None for a clock that is not known (NaN)."""
        return next((order for order in self.orders if order.earliest_s <= now_s), None)

    def checked(self, order: Order) -> Order | None:
        """The known order of the same id, None for a new one.

        Raises QueueRefusal for an id or a time out of range, and for another order with its id.
        """
        if not order.id or len(order.id) > MAX_ID_LENGTH or not order.id.isprintable():
            raise QueueRefusal(f"an order needs an id of 1 to {MAX_ID_LENGTH} printable characters")
        if not 0.0 <= order.earliest_s < _LATEST_S:
            raise QueueRefusal(f"the earliest time {order.earliest_s} s is out of range")
        known = self.known(order.id)
        if known is not None and (known.mission_id, known.origin) != (order.mission_id, order.origin):
            raise QueueRefusal(
                f"the id {order.id!r} belongs to an order of {known.mission_id!r} from {known.origin.value}"
            )
        if known is not None and known.route != order.route:
            raise QueueRefusal(f"the id {order.id!r} belongs to an order with another route")
        return known

    def added(self, order: Order) -> OrderQueue:
        """With a new order behind the last one of its priority or a higher one. Raises QueueRefusal if it is full."""
        if len(self.orders) >= MAX_ORDERS:
            raise QueueRefusal(f"the queue is full: {MAX_ORDERS} orders")
        place = next(
            (index + 1 for index in reversed(range(len(self.orders))) if self.orders[index].priority >= order.priority),
            0,
        )
        return replace(self, orders=(*self.orders[:place], order, *self.orders[place:]))

    def named(self, mission: Mission) -> tuple[OrderQueue, Order]:
        """An order of START_MISSION with an id that is not known, and the queue with the next number; not added yet."""
        number = self.number
        while self.known(f"start_{number}") is not None:
            number += 1
        order = Order(f"start_{number}", mission.id, Origin.UI_COMMAND, mission=mission)
        return replace(self, number=number + 1), order

    def removed(self, order_id: str) -> OrderQueue:
        """Raises QueueRefusal if no such order waits."""
        index = self._index(order_id)
        gone = self.orders[index].without_mission(OrderState.REMOVED)
        return replace(self, orders=self._without(index), ended=_newest((*self.ended, gone)))

    def moved(self, order_id: str, steps: int) -> OrderQueue:
        """With an order moved by ``steps`` places, negative = earlier; not beyond the ends. Raises QueueRefusal."""
        index = self._index(order_id)
        rest = self._without(index)
        place = min(max(0, index + steps), len(rest))
        return replace(self, orders=(*rest[:place], self.orders[index], *rest[place:]))

    def begun(self, order: Order) -> OrderQueue:
        """With ``order`` as the one under way; one that was under way has been aborted in its favour."""
        rest = tuple(item for item in self.orders if item.id != order.id)
        queue = self.finished(OrderState.ABORTED)
        return replace(queue, orders=rest, current=order.without_mission(OrderState.UNDER_WAY))

    def finished(self, state: OrderState) -> OrderQueue:
        """With the order under way ended as ``state``; unchanged without one."""
        if self.current is None:
            return self
        return replace(self, current=None, ended=_newest((*self.ended, self.current.without_mission(state))))

    def _index(self, order_id: str) -> int:
        for index, order in enumerate(self.orders):
            if order.id == order_id:
                return index
        known = self.known(order_id)
        raise QueueRefusal(f"the order {order_id!r} " + (f"is {known.state.name}" if known else "is not in the queue"))

    def _without(self, index: int) -> tuple[Order, ...]:
        return (*self.orders[:index], *self.orders[index + 1 :])


EMPTY_QUEUE = OrderQueue()


def _newest(orders: tuple[Order, ...]) -> tuple[Order, ...]:
    return orders[-MAX_ENDED:]


def problem_of_queue(queue: OrderQueue, active: bool) -> str:
    """Why a queue from the journal is invalid, empty if it is valid. active: a mission is under way."""
    if any(order.mission is None or order.mission.id != order.mission_id for order in queue.orders):
        return "an order without its mission"
    if queue.current is not None and not active:
        return f"order {queue.current.id!r} under way without a mission"
    everything = (*queue.orders, *queue.under_way, *queue.ended)
    if any(order.open and not order.route for order in everything) or any(order.open for order in queue.ended):
        return "an order is open that ended, or that has no route of its own"
    ids = [order.id for order in everything]
    return "two orders with one id" if len(set(ids)) != len(ids) else ""


@dataclass(frozen=True, slots=True)
class QueueReport:
    """Content of /mission/queue. reason: why no order starts, for people; empty = orders start.

    paused_by: origin that paused the mission under way and may resume it; None = not paused, or only a person may.
    """

    queue: OrderQueue
    held_by: HeldBy
    reason: str
    paused_by: Origin | None = None


@dataclass(frozen=True, slots=True)
class QueueAnswer:
    """Answer to a request to change the queue."""

    success: bool = False
    message: str = ""


HELD_TEXTS = {
    HeldBy.RESTART: "the mission manager was restarted",
    HeldBy.STAFF: "a person holds it",
    HeldBy.EMERGENCY_STOP: "after an emergency stop",
    HeldBy.MISSION_ABORTED: "the mission before was ended by a person",
    HeldBy.MISSION_FAILED: "the mission before failed",
    HeldBy.PASSENGER: "a passenger is aboard without a mission",
    HeldBy.MANUAL: "the robot was driven by hand",
    HeldBy.BATTERY_LOW: "the battery is low: charge the robot",
    HeldBy.JOURNAL: "the journal cannot be written",
    HeldBy.LOCALIZATION_LOST: "localization was lost: check the pose on the map",
    HeldBy.DOCKED: "the robot is docked or charging: undock it first",
}


class Hold:
    """Why the queue is held. Not journaled, because every restart holds the queue."""

    def __init__(self) -> None:
        self.by, self._detail = HeldBy.RESTART, ""

    def hold(self, by: HeldBy, detail: str = "") -> None:
        """The first cause stays until the release, unless a person holds the queue."""
        if self.by is HeldBy.NOTHING or by is HeldBy.STAFF:
            self.by, self._detail = by, detail

    def release(self) -> None:
        self.by, self._detail = HeldBy.NOTHING, ""

    @property
    def reason(self) -> str:
        """For people, empty if the queue is not held."""
        if self.by is HeldBy.NOTHING:
            return ""
        return f"queue held: {self._detail or HELD_TEXTS[self.by]}"
