"""Versions of VDA 5050 that the code reads and writes."""

from __future__ import annotations

from enum import StrEnum


class Version(StrEnum):
    V2 = "2.1.0"
    V3 = "3.0.0"

    @property
    def major(self) -> str:
        return self.value.split(".", maxsplit=1)[0]

    @classmethod
    def of(cls, text: str) -> Version | None:
        """The one with the same major version as ``text``, e.g. ``2.0.0``."""
        return next((version for version in cls if version.major == text.split(".", maxsplit=1)[0]), None)
