"""Stores the corrections from latched dockings, one entry per dock, in a YAML file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import yaml
from pydantic import Field

from robot_stack.core.atomic_file import replace_file
from robot_stack.core.config import Config, ConfigError, read_yaml, validate
from robot_stack.core.geometry import Pose2
from robot_stack.core.runtime import state_dir
from robot_stack.docking.dock_calibration import Correction


class _Entry(Config):
    x_m: Annotated[float, Field(ge=-0.1, le=0.1)]
    y_m: Annotated[float, Field(ge=-0.1, le=0.1)]
    yaw_rad: Annotated[float, Field(ge=-0.1, le=0.1)]
    dockings: Annotated[int, Field(ge=1)]


class _File(Config):
    corrections: dict[str, _Entry]


class CorrectionsFile:
    """path: "" for ``docking_corrections.yaml`` in the state folder."""

    def __init__(self, path: str) -> None:
        self._path = Path(path) if path else state_dir() / "docking_corrections.yaml"

    def load(self) -> tuple[dict[str, Correction], str]:
        """(corrections by dock id, error of the file). An invalid file gives no corrections."""
        if not self._path.exists():
            return {}, ""
        try:
            file = validate(_File, read_yaml(self._path), str(self._path))
        except ConfigError as error:
            return {}, str(error)
        entries = file.corrections.items()
        return {name: Correction(Pose2(e.x_m, e.y_m, e.yaw_rad), e.dockings) for name, e in entries}, ""

    def save(self, corrections: Mapping[str, Correction]) -> str:
        """Replaces the whole file. Returns the error, else an empty text."""
        entries = {
            name: {"x_m": item.pose.x, "y_m": item.pose.y, "yaw_rad": item.pose.yaw, "dockings": item.dockings}
            for name, item in corrections.items()
        }
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._path, yaml.safe_dump({"corrections": entries}))
        except OSError as error:
            return f"{self._path} cannot be written: {error.strerror or error}"
        return ""
