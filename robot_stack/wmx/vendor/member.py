"""One object of the vendor's module with the calls of its table, in the port's shape."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Any, Final

from robot_stack.wmx.api.errors import ErrorCode
from robot_stack.wmx.api.surface import Call, Commands, Table, one_or_many
from robot_stack.wmx.vendor.records import MissingField, Records

WRONG_ARGUMENTS: Final = (TypeError, NotImplementedError)
"""Exceptions of the vendor's wrapper for invalid arguments; the second one for overloaded calls."""

_LEAST, _GREATEST = -(1 << 31), (1 << 32) - 1


def found(theirs: Any, name: str, call: Call) -> Callable[..., Any] | None:
    """The vendor's method of a call under any of its names."""
    for one in (name, *call.also):
        method = getattr(theirs, one, None)
        if callable(method):
            return method  # type: ignore[no-any-return]
    return None


def missing(theirs: Any, table: Table) -> list[str]:
    """The needed calls that the vendor's object lacks."""
    return [name for name, call in table.items() if call.needed and found(theirs, name, call) is None]


class Member:
    """Calls with more than the table's handling are methods of subclasses."""

    def __init__(self, theirs: Any, table: Table, records: Records) -> None:
        self.theirs = theirs
        self.records = records
        for name, call in table.items():
            if not hasattr(type(self), name):
                setattr(self, name, self.bound(name, call))

    def bound(self, name: str, call: Call) -> Callable[..., Any]:
        """The call ``name`` in the port's shape."""
        method = found(self.theirs, name, call)

        def run(*arguments: Any) -> Any:
            if method is None:
                return call.zero(ErrorCode.NoSupportedFunction)
            try:
                sent = self.sent(call, arguments)
                # An overloaded call of the wrapper does not report that a number is too large for its argument.
                if any(isinstance(value, int) and not _LEAST <= value <= _GREATEST for value in sent):
                    return call.zero(call.unfit)
                return self.received(call, method(*sent))
            except OverflowError:
                return call.zero(call.unfit)
            except MissingField:
                return call.zero(ErrorCode.NoSupportedFunction)

        return self._counted(run) if call.takes and isinstance(call.takes[0], Commands) else run

    @staticmethod
    def _counted(run: Callable[..., int]) -> Callable[..., int]:
        """One command, or a count and a list that must be as long: the vendor would read beyond it."""

        def start(*arguments: Any) -> int:
            commands = one_or_many(*arguments)
            if commands is None:
                return ErrorCode.ArgumentOutOfRange
            return run(*commands) if len(arguments) == 1 else run(len(commands), commands)

        return start

    def sent(self, call: Call, arguments: tuple[Any, ...]) -> list[Any]:
        """The arguments as the vendor takes them. Raises MissingField."""
        sent = [self.records.theirs(argument) for argument in arguments]
        for position, kind in enumerate(call.takes[: len(sent)]):
            if isinstance(kind, type) and issubclass(kind, IntEnum):
                sent[position] = self.records.enum(kind).theirs(sent[position])
        return sent

    def received(self, call: Call, result: Any) -> Any:
        """The vendor's answer in the port's form."""
        if call.plain:
            return call.values[0](result)
        code, *values = result if isinstance(result, (tuple, list)) else (result,)
        code = self.records.errors.ours(int(code))
        if code or not call.values:
            return call.zero(code)
        converted = (self.records.ours(kind, value) for kind, value in zip(call.values, values, strict=True))
        return code, *converted
