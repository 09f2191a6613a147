"""The mission files of a robot, read at every request, so that a saved mission takes effect at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from robot_stack.core.config import ConfigError, read_yaml, site_path
from robot_stack.core.keepout import Keepout, keepout_problems
from robot_stack.core.mission import Mission, aboard_at_start, home_problem, never_dockable
from robot_stack.core.runtime import own_missions_dir

# A longer value is not repeated in a problem.
_LONGEST_VALUE = 100


class MissionError(Exception):
    """There is no such mission, or its file is wrong. The message is one line for people."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What is wrong with a mission. field: its path in the file. where: the same for people. text: why, for people."""

    field: tuple[str | int, ...]
    where: str
    text: str


class MissionLibrary:
    """Missions in ``folders``, one file ``<id>.yaml`` each; a folder need not exist."""

    def __init__(self, *folders: Path) -> None:
        self.folders = folders

    def paths(self) -> list[Path]:
        """All mission files, by id; also those that are malformed."""
        return sorted((path for folder in self.folders for path in folder.glob("*.yaml")), key=lambda path: path.stem)

    def ids(self) -> list[str]:
        """The ids of all mission files, sorted; also of those that are malformed."""
        return sorted({path.stem for path in self.paths()})

    def find(self, mission_id: str) -> Mission:
        """The mission of this id. Raises MissionError: an unknown id lists the known ones, a double one its files."""
        found = [path for path in self.paths() if path.stem == mission_id]
        if not found:
            raise MissionError(f"there is no mission {mission_id[:64]!r}; known: {', '.join(self.ids()) or 'none'}")
        if len(found) > 1:
            raise MissionError(f"there are two missions {mission_id!r}: {' and '.join(map(str, found))}")
        return read_mission(found[0])


def mission_library(shipped: str = "", own: str = "") -> MissionLibrary:
    """The library of the site's missions and of those made on this robot; arguments replace these folders."""
    return MissionLibrary(
        Path(shipped).expanduser() if shipped else site_path("missions"),
        Path(own).expanduser() if own else own_missions_dir(),
    )


def read_mission(path: Path) -> Mission:
    """The mission in a file. Raises MissionError naming file, waypoint and field."""
    try:
        data = read_yaml(path)
    except ConfigError as error:
        raise MissionError(str(error)) from error
    mission, problems = judge(data)
    if mission is None:
        raise MissionError(f"{path}: {'; '.join(f'{item.where}: {item.text}' for item in problems)}")
    if mission.id != path.stem:
        raise MissionError(f"{path}: id: must be the file's name {path.stem!r}, is {mission.id!r}")
    return mission


def judge(
    data: Mapping[str, Any], docks: Mapping[str, str] | None = None, keepout: Keepout | None = None
) -> tuple[Mission | None, list[Problem]]:
    """The mission that ``data`` describes, or None, and what is wrong with it.

    docks: kind of each dock by its id: if given, a docking that is impossible from any start state is a problem too.
    keepout: if given too, so are waypoints and a home in the site's keepout zones.
    """
    try:
        mission = Mission.model_validate(data)
    except ValidationError as error:
        # Invalid waypoints are missing from the count, so a "too short" error that follows from them is dropped.
        found = [item for item in error.errors() if not (item["type"] == "too_short" and item["input"])]
        return None, [_problem(item, data) for item in found]
    if docks is None:
        return mission, []
    homeless = home_problem(mission, docks)
    if homeless:
        return None, [Problem(("home", "dock"), "home.dock", homeless)]
    undockable = never_dockable(mission, docks)
    if undockable is not None:
        index, text = undockable
        field = ("waypoints", index, "action")
        return None, [Problem(field, _where(field, data), text)]
    aboard = aboard_at_start(mission, False)
    closed = [] if keepout is None else list(keepout_problems(mission, docks, keepout, aboard))
    return None if closed else mission, [Problem(where, _where(where, data), text) for where, text in closed]


def _problem(item: Any, data: Mapping[str, Any]) -> Problem:
    where = _where(item["loc"], data)
    if item["type"] == "missing":
        return Problem(item["loc"], where, "is missing")
    if item["type"] == "extra_forbidden":
        return Problem(item["loc"], where, "is not a known field")
    found = repr(item["input"])
    text = item["msg"].removeprefix("Value error, ")
    return Problem(item["loc"], where, f"{text} (is {found})" if len(found) <= _LONGEST_VALUE else text)


def _where(loc: tuple[str | int, ...], data: Mapping[str, Any]) -> str:
    """``waypoint 2 'bench': action`` for (waypoints, 1, action): text for people, counted from one."""
    if len(loc) < 2 or loc[0] != "waypoints":
        return ".".join(str(part) for part in loc) or "(whole file)"
    _, index, *rest = loc
    entry = data["waypoints"][int(index)]
    name = (
        f" {entry['name'][:_LONGEST_VALUE]!r}" if isinstance(entry, dict) and isinstance(entry.get("name"), str) else ""
    )
    return f"waypoint {int(index) + 1}{name}" + (f": {'.'.join(str(part) for part in rest)}" if rest else "")
