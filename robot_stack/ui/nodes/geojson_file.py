"""A GeoJSON file of the site that staff edit on a page."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, TypeVar

from robot_stack.core.atomic_file import replace_file
from robot_stack.core.config import ConfigError, read_json
from robot_stack.core.own_missions import revision_of
from robot_stack.core.site_files import SiteFile
from robot_stack.ui.nodes.mission_files import NOT_SAVED, EditAnswer

Content = TypeVar("Content")


class GeoJsonFile(Generic[Content]):
    """files: None without a map. parse: a FeatureCollection and its source; raises ConfigError.

    nothing: the content without a file.
    invalid, changed: keys of the texts for a content that would be wrong, and for one that differs from the page's.
    The file is read again when it has changed. Changes are saved in the robot's own data.
    """

    def __init__(
        self,
        files: SiteFile | None,
        parse: Callable[[Any, str], Content],
        nothing: Content,
        *,
        invalid: str,
        changed: str,
    ) -> None:
        self._files, self._parse, self._nothing = files, parse, nothing
        self._invalid, self._changed = invalid, changed
        self._begun = self.revision()
        self._seen: tuple[str, Content, str] = self._begun, *self._read()

    def revision(self) -> str:
        """Of the content in force, empty without a file."""
        return "" if self._files is None else revision_of(self._files.in_force)

    def read(self) -> tuple[Content, str]:
        """The content in force, and what is wrong with the file."""
        revision = self.revision()
        if self._seen[0] != revision:
            self._seen = revision, *self._read()
        return self._seen[1:]

    def state(self) -> dict[str, Any]:
        """Of the newest ``read``. problem: of a wrong file. changed: since the node started. file: in force, empty
        without one.
        """
        revision, _, problem = self._seen
        return {
            "problem": problem,
            "revision": revision,
            "changed": revision != self._begun,
            "file": str(self._files.in_force) if self._files is not None and revision else "",
        }

    def edit(self, revision: str, change: Callable[[list[Any]], list[Any] | None]) -> EditAnswer:
        """Replaces the robot's own file at once; the content that was in force is kept as ``before_path``.

        change: the new features, None if those that it concerns are gone.
        """
        if revision != self.revision():
            return EditAnswer(self._changed)
        if self._files is None:
            return EditAnswer(self._invalid, "the site has no map")
        path = self._files.in_force
        try:
            before = path.read_bytes() if path.exists() else b""
            content: dict[str, Any] = {"type": "FeatureCollection", "features": []}
            if before:
                content = json.loads(before)
            self._parse(content, path.name)  # a file with errors is left to people
            features = change(content["features"])
            if features is None:
                return EditAnswer(self._changed)
            content["features"] = features
            self._parse(content, path.name)
        except (ConfigError, ValueError, RecursionError) as error:
            return EditAnswer(self._invalid, str(error))
        except OSError as error:
            return EditAnswer(NOT_SAVED, f"{error.filename}: {error.strerror}")
        return _save(self._files.own, before, json.dumps(content, ensure_ascii=False, indent=1) + "\n")

    def _read(self) -> tuple[Content, str]:
        path = None if self._files is None else self._files.existing
        if path is None:
            return self._nothing, ""
        try:
            return self._parse(read_json(path), str(path)), ""
        except ConfigError as error:
            return self._nothing, str(error)


def before_path(own: Path) -> Path:
    """Where the content before the last change of the robot's own file is kept."""
    return own.with_name(f"{own.name}.before")


def _save(path: Path, before: bytes, content: str) -> EditAnswer:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if before:
            replace_file(before_path(path), before)
        replace_file(path, content)
    except OSError as error:
        return EditAnswer(NOT_SAVED, f"{error.filename}: {error.strerror}")
    return EditAnswer()
