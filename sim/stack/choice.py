"""Selects the run of ``robot-stack simulate``: a scenario by file or name, a mission, the demo's or a random ride."""

from __future__ import annotations

from typing import Any, Final

from robot_stack.contract.states import MissionState
from robot_stack.core.config import ConfigError, config_dir, validate
from robot_stack.core.mission_library import MissionError, MissionLibrary
from sim.run.scenario import Scenario, load_named_scenario
from sim.settings import DEMO_MISSION, SHORT_MISSION, SHORT_START, START_ERROR_DEG, START_ERROR_M, own_site, wrong_start
from sim.stack.random_ride import place, random_ride
from sim.worldfile import load_world

RANDOM: Final = "random"
_MISSION: Final = "mission:"
_WORLD: Final = "yard"
_SEED: Final = 1
_LIMIT_S: Final = 1800.0
_ARRIVED: Final = [
    {"figure": "mission_state", "equals": MissionState.COMPLETED.value},
    {"figure": "touched", "equals": ""},
]


def choose_scenario(name: str, seed: int | None = None, world: str | None = None) -> tuple[Scenario, str]:
    """The scenario of a name, and a name for its results.

    name: a file, a name in config/scenarios/, ``mission:<id>``, ``demo``, ``demo:short``, or ``random`` for one drawn
    from the seed. seed, world: instead of the scenario's own. Raises ConfigError.
    """
    if name == "demo":
        start = load_world(_WORLD).start.pose()
        found = _mission(DEMO_MISSION, estimated_start=place(wrong_start(start, START_ERROR_M, START_ERROR_DEG)))
    elif name == "demo:short":
        found = _mission(SHORT_MISSION, start=place(SHORT_START))
    elif name == RANDOM:
        found = _random(_SEED if seed is None else seed)
    elif name.startswith(_MISSION):
        found = _mission(name.removeprefix(_MISSION), world or _WORLD)
    else:
        found, name = load_named_scenario(name)
    changes = {key: value for key, value in (("seed", seed), ("world", world)) if value is not None}
    found = validate(Scenario, found.model_dump() | changes, name)
    load_world(found.world)
    return found, name.replace(":", "-")


def _mission(mission_id: str, world: str = _WORLD, **more: Any) -> Scenario:
    folder = config_dir() / "sites" / site if (site := own_site(world)) else config_dir()
    try:
        mission = MissionLibrary(folder / "missions").find(mission_id)
    except MissionError as error:
        raise ConfigError(f"{_MISSION}{mission_id}: {error}") from error
    described = {"description": mission.name_in("en"), "world": world, "seed": _SEED, "limit_s": _LIMIT_S}
    return validate(Scenario, {**described, "mission": mission_id, "expect": _ARRIVED, **more}, _MISSION + mission_id)


def _random(seed: int) -> Scenario:
    described = {"description": "a ride drawn from the seed", "world": _WORLD, "seed": seed}
    return validate(Scenario, described | random_ride(seed, load_world(_WORLD)), RANDOM)
