"""What ``robot-stack simulate`` runs: a scenario by file or name, a mission, or the ride of the demonstration."""

from __future__ import annotations

import math
from typing import Any, Final

from robot_stack.core.config import ConfigError, config_dir, validate
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission_library import MissionError, MissionLibrary
from sim.run.scenario import Scenario, load_named_scenario
from sim.settings import DEMO_MISSION, SHORT_MISSION, SHORT_START, START_ERROR_DEG, START_ERROR_M, wrong_start
from sim.worldfile import load_world

_MISSION: Final = "mission:"
_WORLD: Final = "yard"
_LIMIT_S: Final = 1800.0
_ARRIVED: Final = [{"figure": "mission_state", "equals": "COMPLETED"}, {"figure": "touched", "equals": ""}]


def choose_scenario(name: str, seed: int | None = None, world: str | None = None) -> tuple[Scenario, str]:
    """The scenario of a name, and a name for its results.

    name: a file, a name in config/scenarios/, ``mission:<id>``, ``demo`` or ``demo:short``. seed, world: instead of the
    scenario's own. Raises ConfigError.
    """
    if name == "demo":
        start = load_world(_WORLD).start.pose()
        found = _mission(DEMO_MISSION, believed_start=_place(wrong_start(start, START_ERROR_M, START_ERROR_DEG)))
    elif name == "demo:short":
        found = _mission(SHORT_MISSION, start=_place(SHORT_START))
    elif name.startswith(_MISSION):
        found = _mission(name.removeprefix(_MISSION))
    else:
        found, name = load_named_scenario(name)
    changes = {key: value for key, value in (("seed", seed), ("world", world)) if value is not None}
    found = validate(Scenario, found.model_dump() | changes, name)
    load_world(found.world)
    return found, name.replace(":", "-")


def _mission(mission_id: str, **more: Any) -> Scenario:
    try:
        mission = MissionLibrary(config_dir() / "missions").find(mission_id)
    except MissionError as error:
        raise ConfigError(f"{_MISSION}{mission_id}: {error}") from error
    described = {"description": mission.name_in("en"), "world": _WORLD, "seed": 1, "limit_s": _LIMIT_S}
    return validate(Scenario, {**described, "mission": mission_id, "expect": _ARRIVED, **more}, _MISSION + mission_id)


def _place(pose: Pose2) -> dict[str, float]:
    return {"x_m": pose.x, "y_m": pose.y, "yaw_deg": math.degrees(pose.yaw)}
