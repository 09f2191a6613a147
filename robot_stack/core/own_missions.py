"""Missions that people make on this robot: files in their own folder, never overwritten without a check."""

from __future__ import annotations

import hashlib
from pathlib import Path

import yaml

from robot_stack.core.atomic_file import create_file, replace_file
from robot_stack.core.mission import Mission


class MissionTaken(Exception):
    """Another mission has this id."""


class MissionChanged(Exception):
    """The file differs from what the editor opened: it was changed or deleted meanwhile."""


class OwnMissions:
    """One file ``<id>.yaml`` each. shipped: the folder of missions that come with the software and stay as they are.

    Every function raises OSError if the file system fails.
    """

    def __init__(self, folder: Path, shipped: Path) -> None:
        self.folder, self._shipped = folder, shipped

    def path(self, mission_id: str) -> Path:
        return self.folder / f"{mission_id}.yaml"

    def save(self, mission: Mission, was: str = "", revision: str = "") -> None:
        """Writes a new mission, or replaces ``was``, which had ``revision`` when it was opened.

        A mission under a new id takes the old one's place: it is renamed. Raises MissionTaken, MissionChanged.
        """
        if was:
            self._require(was, revision)
        if mission.id == was:
            replace_file(self.path(was), _content(mission))
            return
        self.require_free(mission.id, was)
        self.folder.mkdir(parents=True, exist_ok=True)
        try:
            create_file(self.path(mission.id), _content(mission))
        except FileExistsError:
            raise MissionTaken(mission.id) from None
        if was:
            self.path(was).unlink()

    def require_free(self, mission_id: str, was: str = "") -> None:
        """Raises MissionTaken if a mission other than ``was`` has this id."""
        names = (self._shipped / f"{mission_id}.yaml", self.path(mission_id))
        if mission_id != was and any(path.exists() for path in names):
            raise MissionTaken(mission_id)

    def delete(self, mission_id: str, revision: str) -> None:
        """Raises MissionChanged."""
        self._require(mission_id, revision)
        self.path(mission_id).unlink()

    def _require(self, mission_id: str, revision: str) -> None:
        if revision_of(self.path(mission_id)) != revision or not revision:
            raise MissionChanged(mission_id)


def revision_of(path: Path) -> str:
    """A short hash of a file's content; empty if there is no file."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
    except OSError:
        return ""


def _content(mission: Mission) -> str:
    data = mission.model_dump(mode="json")
    return yaml.safe_dump(data, allow_unicode=True, sort_keys=False, default_flow_style=None)
