"""Missions with a wheelchair, and what may happen on the way, on the whole stack: how they end, and for whom."""

from __future__ import annotations

import math
import statistics
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import yaml

from custom_msgs.msg import MissionOrder, MissionQueue, UICommand
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services, topics
from robot_stack.contract.states import ENDED, MissionState
from robot_stack.core.config import config_dir
from robot_stack.core.geometry import Pose2
from sim.run.scenario import Scenario
from sim.scheduler.streams import Streams
from sim.settings import SHORT_MISSION, SHORT_START, pose_settings
from sim.stack.random_ride import place
from sim.stack.run import RunFailed, RunOptions, ScheduledRun
from sim.worldfile import load_world
from tests.benchmarks.support.framework import Aim, Result

AIMS = {
    "success_pct": Aim(">=", 100.0),
    "collisions": Aim("<=", 0),
    "invariants_broken": Aim("<=", 0),
    "stranded_passengers": Aim("<=", 0),
    "orders_lost": Aim("<=", 0),
}
_WORLD: Final = "yard"
_ORDER: Final = "next"
_KILLED: Final = ("mission_manager", "docking_controller", "navigation_controller")
_LIMIT_S: Final = 400.0
_LOOK_S: Final = 2.0  # between two looks of the operator at the screen
# A robot whose battery is critical ends its ride there, and has stood for so long.
_STOOD_S: Final = 20.0
_CRITICAL: Final = 0.15


@dataclass(frozen=True, slots=True)
class Case:
    """What is drawn for one run; None does not happen. Times in s from the start of the mission.

    chair: where the wheelchair stands against its place, m and rad. box: x, y in m of an obstacle beside the way.
    battery: time, charge from then on. pause: time, duration. order_s: when another mission is ordered. kill: time,
    process.
    """

    seed: int
    chair: Pose2
    people: bool
    box: tuple[float, float] | None
    battery: tuple[float, float] | None
    pause: tuple[float, float] | None
    order_s: float | None
    kill: tuple[float, str] | None

    @property
    def critical(self) -> bool:
        return self.battery is not None and self.battery[1] < _CRITICAL


@dataclass(frozen=True, slots=True)
class Outcome:
    """problems: invariants that did not hold, and a run that did not start."""

    case: Case
    state: str
    reason: str
    time_s: float
    aboard: bool
    touched: tuple[str, ...]
    problems: tuple[str, ...]
    order_lost: bool

    @property
    def stranded(self) -> bool:
        """A passenger is aboard, and no mission that a person could resume."""
        return self.aboard and self.state not in (MissionState.PAUSED, MissionState.RUNNING, MissionState.WAITING)

    @property
    def success(self) -> bool:
        clean = not (self.touched or self.problems or self.order_lost or self.stranded)
        if self.case.critical and self.state == MissionState.PAUSED:
            return clean
        return clean and self.state == MissionState.COMPLETED and not self.aboard


def draw(seed: int) -> Case:
    """The case of a seed."""
    x, y, yaw, people, *shares = Streams(seed).generator("missions").random(18).tolist()
    boxed, box_x, box_y, low, low_s, charge, paused, pause_s, lasting, ordered, order_s, killed, kill_s, which = shares
    return Case(
        seed,
        Pose2(0.1 * (2.0 * x - 1.0), 0.1 * (2.0 * y - 1.0), math.radians(5.0) * (2.0 * yaw - 1.0)),
        people < 0.5,
        (round(-1.3 + 0.8 * box_x, 3), round(9.3 + 0.8 * box_y, 3)) if boxed < 0.5 else None,
        (round(5.0 + 50.0 * low_s, 1), round(0.10 + 0.19 * charge, 3)) if low < 0.5 else None,
        (round(3.0 + 50.0 * pause_s, 1), round(2.0 + 10.0 * lasting, 1)) if paused < 0.5 else None,
        round(3.0 + 40.0 * order_s, 1) if ordered < 0.5 else None,
        (round(3.0 + 50.0 * kill_s, 1), _KILLED[int(which * len(_KILLED))]) if killed < 0.4 else None,
    )


def run(runs: int = 20, first: int = 1, workers: int = 1) -> Result:
    """Runs mission short_transport in simulated time with light sensors; an operator resumes it after every pause.

    first: seed of the first run. workers: processes; the figures do not depend on it.
    """
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        outcomes = list(_reported(pool.map(play, range(first, first + runs)), runs))
    return Result(_figures(outcomes), _conditions(outcomes, first))


def play(seed: int) -> Outcome:
    """One run."""
    case = draw(seed)
    with tempfile.TemporaryDirectory() as folder, ScheduledRun(_scenario(case, Path(folder)), seed, _OPTIONS) as ride:
        try:
            ride.start()
        except RunFailed as error:
            return Outcome(case, "", "", 0.0, aboard=False, touched=(), problems=(str(error),), order_lost=False)
        return _Ride(ride, case).play()


_OPTIONS: Final = RunOptions(light=True, parallel=False)


def _scenario(case: Case, folder: Path) -> Scenario:
    world, settings = _WORLD, []
    if case.box is not None:
        content = yaml.safe_load((config_dir() / "worlds" / f"{_WORLD}.yaml").read_text(encoding="utf-8"))
        x, y = case.box
        box = {"name": "left_box", "x_m": x, "y_m": y, "length_m": 0.3, "width_m": 0.3, "height_m": 0.6}
        content["boxes"].append(box)
        path = folder / "boxed.yaml"
        path.write_text(yaml.safe_dump(content), encoding="utf-8")
        world = str(path)
        # The box is not in the site's map.
        settings = [
            f'{name}.map="{_WORLD}"' for name in ("ndt_localization", "navigation_controller", "mission_manager")
        ]
    standing = load_world(_WORLD).wheelchair
    assert standing is not None
    settings += pose_settings("sim_world.wheelchair", standing.pose().compose(case.chair))
    settings.append(f"sim_world.people={str(case.people).lower()}")
    return Scenario(
        description="a mission drawn from a seed",
        world=world,
        seed=case.seed,
        limit_s=_LIMIT_S,
        start=place(SHORT_START),
        mission=SHORT_MISSION,
        settings=settings,
    )


class _Ride:
    """One run after its start, with its operator."""

    def __init__(self, run: ScheduledRun, case: Case) -> None:
        self._run, self._case = run, case
        self._queue: MissionQueue | None = None
        self._aboard = False
        self._stood_s = 0.0
        run.stack.test_tool.subscribe(topics.MISSION_QUEUE, self._on_queue)
        run.stack.test_tool.subscribe(topics.PASSENGER_ATTACHED, self._on_passenger)
        self._edit = run.stack.operator.port.client(services.EDIT_MISSION_QUEUE.type, services.EDIT_MISSION_QUEUE.name)
        self._due: list[tuple[float, Any]] = []
        if case.battery is not None:
            self._due.append((case.battery[0], self._drain))
        if case.pause is not None:
            self._due.append((case.pause[0], lambda: run.command(UICommand.PAUSE)))
        if case.order_s is not None:
            self._due.append((case.order_s, lambda: self._request(EditMissionQueue.Request.ADD)))
        if case.kill is not None:
            self._due.append((case.kill[0], lambda: run.stack.faults.inject("process_killed", case.kill[1])))
        self._due.sort(key=lambda item: item[0])

    def play(self) -> Outcome:
        run = self._run
        while run.now_s < _LIMIT_S and not self._over():
            while self._due and self._due[0][0] <= run.now_s:
                self._due.pop(0)[1]()
            self._operate()
            run.stack.scheduler.run_for(_LOOK_S)
        mission = run.mission
        asked = self._case.order_s is not None and self._case.order_s < run.now_s - 2.0 * _LOOK_S
        kept = [] if self._queue is None else [*self._queue.orders, *self._queue.current, *self._queue.ended]
        return Outcome(
            self._case,
            "" if mission is None else mission.state,
            "" if mission is None else mission.reason,
            run.now_s,
            self._aboard,
            tuple(sorted(run.world.sim.world.touched)),
            tuple(item.describe() for item in run.invariants.broken),
            asked and not any(order.id == _ORDER for order in kept),
        )

    def _operate(self) -> None:
        """Resumes a mission that waits for a person."""
        mission, pause = self._run.mission, self._case.pause
        paused = mission is not None and mission.state == MissionState.PAUSED
        self._stood_s = self._stood_s + _LOOK_S if paused else 0.0
        asked = pause is not None and pause[0] <= self._run.now_s < sum(pause)
        if paused and not asked:
            self._run.command(UICommand.RESUME)

    def _over(self) -> bool:
        mission = self._run.mission
        if mission is None or self._run.now_s < 2.0 * _LOOK_S:
            return False
        stays = self._case.critical and self._stood_s >= _STOOD_S
        return stays or mission.state in ENDED

    def _drain(self) -> None:
        assert self._case.battery is not None
        self._run.world.sim.battery.charge = self._case.battery[1]

    def _request(self, operation: int) -> None:
        order = MissionOrder(id=_ORDER, mission_id="short_hop", origin=MissionOrder.CLI, priority=100)
        self._edit.call(EditMissionQueue.Request(operation=operation, order=order), lambda _: None)

    def _on_queue(self, message: MissionQueue) -> None:
        self._queue = message

    def _on_passenger(self, message: Any) -> None:
        self._aboard = message.data


def _reported(outcomes: Iterable[Outcome], runs: int) -> Iterator[Outcome]:
    for number, outcome in enumerate(outcomes, 1):
        print(f"{number}/{runs} {_shown(outcome)}", file=sys.stderr, flush=True)
        yield outcome


def _figures(outcomes: Sequence[Outcome]) -> dict[str, float]:
    completed = [outcome.time_s for outcome in outcomes if outcome.state == MissionState.COMPLETED]
    return {
        "runs": len(outcomes),
        "success_pct": 100.0 * sum(outcome.success for outcome in outcomes) / len(outcomes),
        "collisions": sum(bool(outcome.touched) for outcome in outcomes),
        "invariants_broken": sum(len(outcome.problems) for outcome in outcomes),
        "stranded_passengers": sum(outcome.stranded for outcome in outcomes),
        "orders_lost": sum(outcome.order_lost for outcome in outcomes),
        "time_s_median": statistics.median(completed) if completed else math.nan,
    }


def _conditions(outcomes: Sequence[Outcome], first: int) -> dict[str, object]:
    return {
        "runs": f"seeds {first} to {first + len(outcomes) - 1}: mission {SHORT_MISSION} in {_WORLD}, light sensors",
        "drawn": "the chair 0.1 m and 5 deg off; people, a box beside the way, a battery at 10 to 29 %, a pause, an "
        f"order during the ride (half of the runs each), a kill of {', '.join(_KILLED)} (two of five)",
        "operator": "sends RESUME while the mission is PAUSED",
        "success_pct": "COMPLETED, or PAUSED with a critical battery; without contact and with every order kept",
        "stranded_passengers": "aboard after a mission that has ended",
        "time_s_median": "of the missions COMPLETED, simulated, with the way home",
        "failed": [_shown(outcome) for outcome in outcomes if not outcome.success],
        "peer": "none",
    }


def _shown(outcome: Outcome) -> str:
    aboard = ", passenger aboard" if outcome.aboard else ""
    head = f"seed {outcome.case.seed}: {'success' if outcome.success else 'FAILED'}, {outcome.state}{aboard}"
    more = [outcome.reason, *outcome.touched, *outcome.problems, *(["order lost"] if outcome.order_lost else [])]
    return f"{head} after {outcome.time_s:.0f} s; {outcome.case}; {' | '.join(filter(None, more))}"
