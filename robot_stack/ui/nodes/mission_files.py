"""The mission files, for display and editing by pages. The mission manager's rules validate them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robot_stack.core.docks import Dock
from robot_stack.core.keepout import Keepout
from robot_stack.core.mission import Kind, Mission
from robot_stack.core.mission_library import MissionError, MissionLibrary, Problem, judge, read_mission
from robot_stack.core.own_missions import MissionChanged, MissionTaken, OwnMissions, revision_of
from robot_stack.ui import protocol as p

INVALID, TAKEN, CHANGED, NOT_SAVED = (
    "answer.mission_invalid",
    "answer.mission_taken",
    "answer.mission_changed",
    "answer.mission_not_saved",
)
_PROBLEMS_MAX, _TEXT_MAX = 20, 200


@dataclass(frozen=True, slots=True)
class EditAnswer:
    """why: key of a text, empty if it is done. detail: the file system's message. problems: errors and their places."""

    why: str = ""
    detail: str = ""
    problems: tuple[Problem, ...] = ()

    def fields(self) -> dict[str, Any]:
        """The problems as a page takes them."""
        found = [
            {"field": ".".join(map(str, item.field)), "where": item.where[:_TEXT_MAX], "text": item.text[:_TEXT_MAX]}
            for item in self.problems[:_PROBLEMS_MAX]
        ]
        return {"problems": found} if found else {}


class MissionFiles:
    """library: the shipped missions, then those made on this robot. docks: by their ids. keepout: of the site.

    Files are read again when one has changed.
    """

    def __init__(self, library: MissionLibrary, docks: Mapping[str, Dock], keepout: Keepout | None = None) -> None:
        shipped, own = library.folders
        self._library, self._own = library, OwnMissions(own, shipped)
        self._docks, self._keepout = docks, keepout
        self._kinds = {name: dock.kind for name, dock in docks.items()}
        self._seen: list[tuple[Path, int]] = []
        self._found: list[tuple[Path, Mission | None, str]] = []

    def section(self) -> dict[str, Any]:
        """The choice for riders: valid missions."""
        return {"list": [_choice(mission) for _, mission, _ in self._read() if mission is not None]}

    def files_section(self) -> dict[str, Any]:
        """The missions for staff to edit. Missions shipped with the software have no revision and are read-only."""
        return {
            "folder": str(self._own.folder),
            "list": [self._file(*item) for item in self._read()],
            "docks": [
                {"id": name, "kind": dock.kind, "x": at.x_m, "y": at.y_m, "yaw": at.yaw_rad}
                for name, dock in self._docks.items()
                for at in (dock.staging,)
            ],
        }

    def edit(self, message: p.CheckMission | p.SaveMission | p.DeleteMission) -> EditAnswer:
        """Executes a request of staff."""
        try:
            if isinstance(message, p.DeleteMission):
                self._own.delete(message.mission, message.revision)
                return EditAnswer()
            mission, problems = judge(message.mission, self._kinds, self._keepout)
            if mission is None:
                return EditAnswer(INVALID, problems=tuple(problems))
            if isinstance(message, p.SaveMission):
                self._own.save(mission, message.was, message.revision)
            else:
                self._own.require_free(mission.id, message.was)
        except MissionTaken:
            return EditAnswer(TAKEN, problems=(Problem(("id",), "id", "another mission has this name"),))
        except MissionChanged:
            return EditAnswer(CHANGED)
        except OSError as error:
            return EditAnswer(NOT_SAVED, f"{error.filename}: {error.strerror}")
        return EditAnswer()

    def _read(self) -> Sequence[tuple[Path, Mission | None, str]]:
        """File, its mission and its error."""
        paths = self._library.paths()
        seen = [(path, path.stat().st_mtime_ns) for path in paths if path.is_file()]
        if seen != self._seen:
            self._seen = seen
            self._found = [self._judged(path) for path, _ in seen]
        return self._found

    def _judged(self, path: Path) -> tuple[Path, Mission | None, str]:
        try:
            return path, read_mission(path), ""
        except MissionError as error:
            return path, None, str(error)[:_TEXT_MAX]

    def _file(self, path: Path, mission: Mission | None, problem: str) -> dict[str, Any]:
        own = path.parent == self._own.folder
        return {
            "id": path.stem,
            "own": own,
            "revision": revision_of(path) if own else "",
            "mission": mission.model_dump(mode="json") if mission else None,
            "problem": problem,
        }


def _choice(mission: Mission) -> dict[str, Any]:
    return {
        "id": mission.id,
        "name": mission.name.model_dump(),
        "stops": [item.names() for item in mission.waypoints],
        "carries": any(item.action.kind is Kind.DOCK for item in mission.waypoints),
    }
