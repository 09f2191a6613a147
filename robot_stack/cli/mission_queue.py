"""mission queue list, add, remove, move, hold, release; mission change."""

from __future__ import annotations

import uuid
from datetime import datetime
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from robot_stack.cli.errors import CommandError
from robot_stack.cli.safety import Timeout

if TYPE_CHECKING:
    from robot_stack.cli.nodes.mission_queue import Queue

queue = typer.Typer(help="Orders of missions: list, add, remove, move, hold, release.", no_args_is_help=True)

OrderId = Annotated[str, typer.Argument(help="Id, as in `mission queue list`.")]
MissionId = Annotated[str, typer.Argument(help="Id, as in `mission list`.")]
NewId = Annotated[
    str, typer.Option("--id", help="Id of the order; the same id twice is one order. Default: a new one.")
]
_TIMES = ["%Y-%m-%dT%H:%M", "%Y-%m-%dT%H:%M:%S"]


@queue.command("list")
def list_orders(timeout_s: Timeout = 5.0) -> None:
    """The orders under way and waiting, in their sequence, and why none starts."""
    from robot_stack.cli.nodes.mission_queue import read_queue

    print_queue(read_queue(timeout_s))


@queue.command()
def add(
    mission_id: MissionId,
    order_id: NewId = "",
    priority: Annotated[int, typer.Option(min=0, max=255, help="Higher is earlier.")] = 100,
    earliest: Annotated[datetime | None, typer.Option(formats=_TIMES, help="Not before this local time.")] = None,
    timeout_s: Timeout = 5.0,
) -> None:
    """Add an order behind the last one of its priority."""
    _edit("ADD", timeout_s, mission_id=mission_id, order_id=order_id, priority=priority, earliest=earliest)


@queue.command()
def remove(order_id: OrderId, timeout_s: Timeout = 5.0) -> None:
    """Remove a waiting order."""
    _edit("REMOVE", timeout_s, order_id=order_id)


@queue.command()
def move(
    order_id: OrderId,
    way: Annotated[Literal["up", "down"], typer.Argument(help="up: earlier.")],
    places: Annotated[int, typer.Option(min=1, max=127)] = 1,
    timeout_s: Timeout = 5.0,
) -> None:
    """Move a waiting order up or down."""
    _edit("MOVE", timeout_s, order_id=order_id, steps=-places if way == "up" else places)


@queue.command()
def hold(timeout_s: Timeout = 5.0) -> None:
    """Start no order until `release`; a mission under way goes on."""
    _edit("HOLD", timeout_s)


@queue.command()
def release(timeout_s: Timeout = 5.0) -> None:
    """Start the waiting orders, one after the other."""
    _edit("RELEASE", timeout_s)


def change(mission_id: MissionId, order_id: NewId = "", timeout_s: Timeout = 5.0) -> None:
    """Change the destination: this mission takes the place of the one under way, at once."""
    _edit("REPLACE", timeout_s, mission_id=mission_id, order_id=order_id)


def print_queue(shown: Queue) -> None:
    """Columns of a fixed width, for people and for a pipe."""
    print(shown.reason or "orders start one after the other")
    for number, order in enumerate(shown.orders, 1):
        time = f", not before {datetime.fromtimestamp(order.earliest_s):%Y-%m-%d %H:%M:%S}" if order.earliest_s else ""
        place = "under way" if order.under_way else f"{number - shown.under_way}."
        more = ", open route" if order.open else ""
        paused = f", paused by {shown.paused_by}" if order.under_way and shown.paused_by else ""
        facts = f"priority {order.priority}, from {order.origin}{time}{more}{paused}"
        print(f"{place} {order.id}: {order.mission_id}, {facts}")
    if not shown.orders:
        print("no orders")


def _edit(operation: str, timeout_s: float, *, order_id: str = "", **fields: Any) -> None:
    from robot_stack.cli.nodes.mission_queue import edit_queue

    new = operation in ("ADD", "REPLACE") and not order_id
    earliest = fields.pop("earliest", None)
    fields["earliest_s"] = earliest.timestamp() if earliest else 0.0
    success, message = edit_queue(
        operation, timeout_s, order_id=f"cli_{uuid.uuid4().hex[:8]}" if new else order_id, **fields
    )
    if not success:
        raise CommandError(message)
    print(message)
