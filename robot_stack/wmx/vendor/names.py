"""Translates numbers between the vendor's module and the port, by name.

Newer versions of the library insert entries into its enumerations, so a number depends on its version. Every
number that crosses the adapter is translated to the one with the same name on the other side. A number without a
name there passes unchanged, unless the other side uses it otherwise: then it is replaced by an
unused one, so that it is never misread.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from types import ModuleType
from typing import Final

from robot_stack.wmx.api.errors import AdvancedMotionErrorCode, CoreMotionErrorCode, EcErrorCode, ErrorCode

ERROR_ENUMS: Final[tuple[type[IntEnum], ...]] = (
    ErrorCode,
    CoreMotionErrorCode,
    AdvancedMotionErrorCode,
    EcErrorCode,
)
STRANGER: Final = 1 << 30
"""Added to a number that has no name on the other side, where that side uses it for another name."""


class NumberMap:
    """Translates numbers both ways. ``ours`` and ``theirs`` give each side's numbers by name."""

    def __init__(self, ours: Mapping[str, int], theirs: Mapping[str, int]) -> None:
        both = ours.keys() & theirs.keys()
        self._ours = {theirs[name]: ours[name] for name in both}
        self._theirs = {ours[name]: theirs[name] for name in both}
        self._our_numbers = frozenset(ours.values())
        self._their_numbers = frozenset(theirs.values())

    def ours(self, number: int) -> int:
        """The port's number of a vendor's."""
        known = self._ours.get(number)
        if known is not None:
            return known
        return number + STRANGER if number in self._our_numbers else number

    def theirs(self, number: int) -> int:
        """The vendor's number of one of the port's, or of one that ``ours`` made."""
        known = self._theirs.get(number)
        if known is not None:
            return known
        if number - STRANGER in self._our_numbers:
            return number - STRANGER
        return number + STRANGER if number in self._their_numbers else number


def numbers(kind: object) -> dict[str, int]:
    """The entries of a vendor's enumeration: a class with integers for attributes, its bases' included."""
    found: dict[str, int] = {}
    for name in dir(kind):
        value = None if name.startswith("_") else getattr(kind, name, None)
        if isinstance(value, int) and not isinstance(value, bool):
            found[name] = value
    return found


def enum_map(module: ModuleType, kind: type[IntEnum]) -> NumberMap:
    """The map of one enumeration; the identity where the module does not export it."""
    ours = {member.name: int(member) for member in kind}
    return NumberMap(ours, numbers(getattr(module, kind.__name__, None)) or ours)


def error_map(module: ModuleType) -> NumberMap:
    """The map of all error codes. A name is looked up in its own class first, then in any other of the module."""
    classes = [getattr(module, name) for name in dir(module) if name.endswith("ErrorCode")]
    anywhere: dict[str, int] = {}
    for kind in classes:
        anywhere |= numbers(kind)
    ours: dict[str, int] = {}
    theirs: dict[str, int] = {}
    for enum in ERROR_ENUMS:
        own = numbers(getattr(module, enum.__name__, None))
        for member in enum:
            ours[member.name] = int(member)
            if member.name in own or member.name in anywhere:
                theirs[member.name] = own.get(member.name, anywhere.get(member.name, 0))
    return NumberMap(ours, theirs)
