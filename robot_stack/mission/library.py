"""The mission files of a folder, read afresh at every request: what an operator saved is what the robot drives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from robot_stack.core.config import ConfigError, read_yaml
from robot_stack.mission.model import Mission


class MissionError(Exception):
    """There is no such mission, or its file is wrong. The message is one line for people."""


class MissionLibrary:
    """Missions in ``folder``, one file ``<id>.yaml`` each."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def ids(self) -> list[str]:
        """The ids of all mission files, sorted; also of those that are malformed."""
        return sorted(path.stem for path in self.folder.glob("*.yaml"))

    def find(self, mission_id: str) -> Mission:
        """The mission of this id. Raises MissionError: an unknown id lists the known ones."""
        known = self.ids()
        if mission_id not in known:
            raise MissionError(f"there is no mission {mission_id[:64]!r}; known: {', '.join(known) or 'none'}")
        return read_mission(self.folder / f"{mission_id}.yaml")


def read_mission(path: Path) -> Mission:
    """The mission in a file. Raises MissionError naming file, waypoint and field."""
    try:
        data = read_yaml(path)
    except ConfigError as error:
        raise MissionError(str(error)) from error
    try:
        mission = Mission.model_validate(data)
    except ValidationError as error:
        problems = "; ".join(_describe(item, data) for item in error.errors())
        raise MissionError(f"{path}: {problems}") from error
    if mission.id != path.stem:
        raise MissionError(f"{path}: id: must be the file's name {path.stem!r}, is {mission.id!r}")
    return mission


def _describe(item: Any, data: dict[str, Any]) -> str:
    field = ".".join(str(part) for part in item["loc"]) or "(whole file)"
    if len(item["loc"]) > 1 and item["loc"][0] == "waypoints":
        field = _waypoint_field(item["loc"], data)
    if item["type"] == "missing":
        return f"{field}: is missing"
    if item["type"] == "extra_forbidden":
        return f"{field}: is not a known field"
    return f"{field}: {item['msg'].removeprefix('Value error, ')} (is {item['input']!r})"


def _waypoint_field(loc: tuple[str | int, ...], data: dict[str, Any]) -> str:
    """``waypoint 2 'bench': action`` for (waypoints, 1, action): people count from one and know the name."""
    _, index, *rest = loc
    entry = data["waypoints"][int(index)]
    name = f" {entry['name']!r}" if isinstance(entry, dict) and isinstance(entry.get("name"), str) else ""
    return f"waypoint {int(index) + 1}{name}" + (f": {'.'.join(str(part) for part in rest)}" if rest else "")
