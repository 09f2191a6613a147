"""Every row of the transition table is taken, and no transition outside of it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robot_stack.core.safe_places import SafePlace
from robot_stack.core.transitions import Transition
from robot_stack.mission import events as ev
from robot_stack.mission.orders import Operation, Origin
from robot_stack.mission.record import Record
from robot_stack.mission.states import TRANSITIONS, State, Trigger

from .conftest import DockStory, make_mission

DOCK = {"dock": "chair_1"}
WAIT = {"wait": 2.0}
BASE = SafePlace(name="base", x=-1.0, y=0.0, yaw=0.0)
Step = Callable[[DockStory], object]


def tries(story: DockStory, number: int) -> None:
    story.at(0.3)
    for _ in range(number):
        story.stall()


def full_disk(story: DockStory) -> None:
    story.journal.problem = "full"
    story.happens(ev.PassengerChanged(not story.kernel.record.passenger_attached))


def stopped_at(dock: Step) -> Step:
    def way(story: DockStory) -> None:
        dock(story)
        story.tick().command(ev.PAUSE)

    return way


def docking(story: DockStory) -> None:
    story.start(DOCK).arrive(2.0)


def undocking(story: DockStory) -> None:
    story.attach().start("undock").arrive(2.0)


# The default way into each state. A row whose history matters has its own.
INTO: dict[State, Step] = {
    State.IDLE: lambda story: None,
    State.RUNNING: lambda story: story.start("park"),
    State.WAITING: lambda story: story.start(WAIT).reach(2.0),
    State.DOCKING: docking,
    State.UNDOCKING: undocking,
    State.PAUSED: lambda story: story.start("park").command(ev.PAUSE),
    State.STOPPED: lambda story: story.start("park").emergency(True).emergency(False),
    State.COMPLETED: lambda story: story.start("park").reach(2.0),
    State.ABORTED: lambda story: story.start("park").command(ev.ABORT),
    State.FAILED: lambda story: (story.start("park"), tries(story, 3)),
}
THEN: dict[Trigger, Step] = {
    Trigger.START: lambda story: story.start("park"),
    Trigger.START_DOCKED: lambda story: story.given(docking_state="DOCKED").start("park"),
    Trigger.PAUSE: lambda story: story.command(ev.PAUSE),
    Trigger.RESUME: lambda story: story.command(ev.RESUME),
    Trigger.RESUME_DOCKING: lambda story: story.command(ev.RESUME),
    Trigger.RESUME_UNDOCKING: lambda story: story.command(ev.RESUME),
    Trigger.RESUME_DONE: lambda story: story.attach().command(ev.RESUME),
    Trigger.ABORT: lambda story: story.command(ev.ABORT),
    Trigger.EMERGENCY_STOP: lambda story: story.emergency(True),
    Trigger.WAIT_HERE: lambda story: story.reach(2.0),
    Trigger.DOCK_HERE: lambda story: story.arrive(2.0),
    Trigger.UNDOCK_HERE: lambda story: story.arrive(2.0),
    Trigger.DONE: lambda story: story.reach(2.0).tick(2.5),
    Trigger.NEXT: lambda story: story.at(2.0).tick().tick(2.5),
    Trigger.TRY_FAILED: lambda story: tries(story, 1),
    Trigger.GAVE_UP: lambda story: tries(story, 3),
    Trigger.DOCKING_FAILED: lambda story: story.tick().accept().ends(False, "no"),
    Trigger.JOURNAL_LOST: full_disk,
    Trigger.RESTORED: lambda story: None,
    Trigger.REPLACE: lambda story: story.order("x", "park", operation=Operation.REPLACE, origin=Origin.CLI),
    Trigger.TO_SAFE_PLACE: lambda story: story.given(faults=("BATTERY_CRITICAL",)).tick(),
    Trigger.NO_SAFE_PLACE: lambda story: story.given(faults=("BATTERY_CRITICAL",)).tick(),
    Trigger.SAFE_PLACE: lambda story: (
        story.tick().accept().ends(True) if story.state is State.DOCKING else story.reach(BASE.x)
    ),
    Trigger.RESUME_AWAITING: lambda story: story.command(ev.RESUME),
    Trigger.CANCEL: lambda story: story.asks(Operation.CANCEL, origin="cli"),
    Trigger.AWAIT_PART: lambda story: story.reach(2.0).tick(2.5),
    Trigger.EXTENDED: lambda story: story.extends("park", first=1, origin="cli"),
    Trigger.LOST: lambda story: story.given(faults=("LOCALIZATION_LOST",)).tick(story.params.localization_lost_s + 1.0),
}


def stopped(dock: Step) -> Step:
    def way(story: DockStory) -> None:
        dock(story)
        story.emergency(True).emergency(False)

    return way


def ordered(*actions: object, then: Step = lambda story: None) -> Step:
    """An open order under way, not of the fleet, which starts nothing with a passenger aboard."""

    def way(story: DockStory) -> None:
        if actions[0] == "undock":
            story.attach()
        story.brings(*actions, origin="cli")
        then(story)

    return way


# Rows that need another way into their source state than the default.
VIA: dict[tuple[State, Trigger], Step] = {
    (State.PAUSED, Trigger.RESUME_DOCKING): stopped_at(docking),
    (State.PAUSED, Trigger.RESUME_UNDOCKING): stopped_at(undocking),
    (State.PAUSED, Trigger.RESUME_DONE): stopped_at(docking),
    (State.STOPPED, Trigger.RESUME_DOCKING): stopped(docking),
    (State.STOPPED, Trigger.RESUME_UNDOCKING): stopped(undocking),
    (State.STOPPED, Trigger.RESUME_DONE): stopped(docking),
    (State.PAUSED, Trigger.RESUME_AWAITING): ordered("park", then=lambda story: story.reach(2.0).command(ev.PAUSE)),
    (State.STOPPED, Trigger.RESUME_AWAITING): ordered(
        "park", then=lambda story: story.reach(2.0).emergency(True).emergency(False)
    ),
    (State.RUNNING, Trigger.CANCEL): ordered("park"),
    (State.WAITING, Trigger.CANCEL): ordered("park", then=lambda story: story.reach(2.0)),
    (State.DOCKING, Trigger.CANCEL): ordered(DOCK, then=lambda story: story.arrive(2.0)),
    (State.UNDOCKING, Trigger.CANCEL): ordered("undock", then=lambda story: story.arrive(2.0)),
    (State.PAUSED, Trigger.CANCEL): ordered("park", then=lambda story: story.command(ev.PAUSE)),
    (State.STOPPED, Trigger.CANCEL): ordered("park", then=lambda story: story.emergency(True)),
    (State.RUNNING, Trigger.AWAIT_PART): ordered("park"),
    (State.WAITING, Trigger.AWAIT_PART): ordered(WAIT, then=lambda story: story.reach(2.0)),
    (State.DOCKING, Trigger.AWAIT_PART): ordered(DOCK, then=lambda story: story.arrive(2.0)),
    (State.UNDOCKING, Trigger.AWAIT_PART): ordered("undock", then=lambda story: story.arrive(2.0)),
    (State.WAITING, Trigger.EXTENDED): ordered("park", then=lambda story: story.reach(2.0)),
    (State.WAITING, Trigger.LOST): ordered("park", then=lambda story: story.reach(2.0)),
    (State.RUNNING, Trigger.WAIT_HERE): lambda story: story.start(WAIT),
    (State.RUNNING, Trigger.DOCK_HERE): lambda story: story.start(DOCK),
    (State.RUNNING, Trigger.UNDOCK_HERE): lambda story: story.attach().start("undock"),
    (State.RUNNING, Trigger.NEXT): lambda story: story.start("pass", "park"),
    (State.WAITING, Trigger.NEXT): lambda story: story.start(WAIT, "park").reach(2.0),
    (State.DOCKING, Trigger.NEXT): lambda story: story.start(DOCK, "park").arrive(2.0),
    (State.RUNNING, Trigger.SAFE_PLACE): lambda story: story.start("park").given(faults=("BATTERY_CRITICAL",)).tick(),
    (State.DOCKING, Trigger.SAFE_PLACE): lambda story: (
        story.command(ev.START_MISSION, make_mission("park", home=(-0.5, 0.0, 0.0), charger="charger"))
        .given(faults=("BATTERY_CRITICAL",))
        .tick()
        .arrive(-0.5)
    ),
    (State.UNDOCKING, Trigger.NEXT): lambda story: story.attach().start("undock", "park").arrive(2.0),
}
SERVED: dict[State, Step] = {
    State.DOCKING: lambda story: story.tick().docks(),
    State.UNDOCKING: lambda story: story.tick().accept().attach(False).ends(True),
}


def name_of(row: Transition[State, Trigger]) -> str:
    return f"{row.source.value}-{row.trigger.name}"


@pytest.mark.parametrize("row", TRANSITIONS, ids=name_of)
def test_every_row_is_walked(params, row):
    if row.trigger is Trigger.RESTORED:
        story = DockStory(params, Record(State.RUNNING, make_mission("park")))
        assert story.state is row.target
        return
    places = () if row.trigger is Trigger.NO_SAFE_PLACE else (BASE,)
    story = DockStory(params, safe_places=places)
    VIA.get((row.source, row.trigger), INTO[row.source])(story)
    assert story.state is row.source
    saved = len(story.journal.records)
    served = SERVED.get(row.source) if row.trigger in (Trigger.NEXT, Trigger.DONE, Trigger.AWAIT_PART) else None
    (served or THEN[row.trigger])(story)
    assert story.state is row.target
    if row.trigger is Trigger.JOURNAL_LOST:
        assert len(story.journal.records) == saved
        return
    assert len(story.journal.records) > saved, "the journal has it"
    assert story.journal.records[-1].state is row.target
