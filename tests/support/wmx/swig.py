"""Python classes as strict as those of a SWIG wrapper: C argument types, own value classes, overloads.

Behaviour of SWIG that affects a caller: wrong arguments raise TypeError, or NotImplementedError in an overloaded call.
A number out of the C type's range raises OverflowError, or is a wrong argument of an overloaded call. A float or a
numpy int is not accepted as int; only True and False are bool. A proxy object accepts any attribute, so a misspelt
field is silently lost.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

Run = Callable[..., Any]


class CType:
    """One C type: ``take`` returns the plain value of an argument or raises like the wrapper."""

    def __init__(self, name: str, low: int | None = None, high: int | None = None) -> None:
        self.name, self.low, self.high = name, low, high

    def take(self, value: Any) -> Any:
        if type(value) not in (int, bool):
            raise TypeError(f"expected argument of type '{self.name}', got {type(value).__name__}")
        assert self.low is not None
        assert self.high is not None
        if not self.low <= value <= self.high:
            raise OverflowError(f"{value} does not fit into '{self.name}'")
        return int(value)


class _Double(CType):
    def take(self, value: Any) -> Any:
        if type(value) not in (int, float, bool):
            raise TypeError(f"expected argument of type 'double', got {type(value).__name__}")
        return float(value)


class _Bool(CType):
    def take(self, value: Any) -> Any:
        if type(value) is not bool:
            raise TypeError(f"expected argument of type 'bool', got {type(value).__name__}")
        return value


class _Str(CType):
    def take(self, value: Any) -> Any:
        if type(value) is not str:
            raise TypeError(f"expected argument of type 'char const *', got {type(value).__name__}")
        return value


INT = CType("int", -(2**31), 2**31 - 1)
UINT = CType("unsigned int", 0, 2**32 - 1)
UCHAR = CType("unsigned char", 0, 255)
DOUBLE, BOOL, STR = _Double("double"), _Bool("bool"), _Str("char const *")


class Of(CType):
    """An object of one of the wrapper's own classes."""

    def __init__(self, kind: type) -> None:
        super().__init__(f"{kind.__name__} *")
        self.kind = kind

    def take(self, value: Any) -> Any:
        if not isinstance(value, self.kind):
            raise TypeError(f"expected argument of type '{self.name}', got {type(value).__name__}")
        return value


class ListOf(CType):
    """A Python list whose entries all have one type."""

    def __init__(self, item: CType) -> None:
        super().__init__(f"list of {item.name}")
        self.item = item

    def take(self, value: Any) -> Any:
        if type(value) is not list:
            raise TypeError(f"expected a list, got {type(value).__name__}")
        return [self.item.take(entry) for entry in value]


class Opaque:
    """A C array as an attribute: a pointer without a use in Python."""


class Proxy:
    """A value class. Subclasses define its C fields and arrays; ``written`` contains the fields set by a caller."""

    FIELDS: dict[str, CType] = {}
    ARRAYS: dict[str, tuple[CType, int]] = {}
    CONTROL: Any = None

    def __init__(self) -> None:
        state = self.__dict__
        state["values"] = {name: _default(kind) for name, kind in self.FIELDS.items()}
        state["arrays"] = {name: [_default(kind)] * size for name, (kind, size) in self.ARRAYS.items()}
        state["written"] = set()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.FIELDS:
            self.values[name] = self.FIELDS[name].take(value)
            self.written.add(name)
            return
        self.CONTROL.faults.append(f"{type(self).__name__} has no field {name}")
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        if name in self.ARRAYS:
            return Opaque()
        raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")

    def plain(self) -> dict[str, Any]:
        """Fields and arrays as plain values, for records of calls."""
        found = {name: plain(value) for name, value in self.values.items()}
        return found | {name: [plain(item) for item in items] for name, items in self.arrays.items()}


def _default(kind: CType) -> Any:
    if isinstance(kind, Of):
        return kind.kind()
    return {"double": 0.0, "bool": False, "char const *": ""}.get(kind.name, 0)


def plain(value: Any) -> Any:
    """An argument in the form in which calls are recorded."""
    if isinstance(value, Proxy):
        return value.plain()
    return [plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def proxy(
    control: Any, name: str, fields: dict[str, CType], arrays: dict[str, tuple[CType, int]] | None = None
) -> type[Proxy]:
    """A value class with attributes for ``fields`` and methods Get and Set for ``arrays``."""
    members: dict[str, Any] = {"FIELDS": fields, "ARRAYS": arrays or {}, "CONTROL": control}
    for array, (kind, size) in (arrays or {}).items():
        capital = array[:1].upper() + array[1:]
        members[f"Get{capital}"] = _reader(array, size)
        members[f"Set{capital}"] = _writer(array, kind, size)
    made = type(name, (Proxy,), members)
    for field in fields:  # like a wrapper's class, with a property for each field
        setattr(made, field, property(lambda self, field=field: self.values[field]))
    return made


def _reader(array: str, size: int) -> Run:
    def read(self: Proxy, index: Any) -> Any:
        if not 0 <= INT.take(index) < size:
            raise IndexError(f"{array}[{index}]: memory of somebody else")
        return self.arrays[array][index]

    return read


def _writer(array: str, kind: CType, size: int) -> Run:
    def write(self: Proxy, index: Any, value: Any) -> None:
        if not 0 <= INT.take(index) < size:
            raise IndexError(f"{array}[{index}]: memory of somebody else")
        self.arrays[array][index] = kind.take(value)
        self.written.add(array)

    return write


def c_array(name: str, kind: CType) -> type:
    """``doubleArray`` and its like: a fixed length, and entries of one type."""

    class Array:
        def __init__(self, nelements: int) -> None:
            self.items = [0] * INT.take(nelements)

        def __getitem__(self, index: int) -> Any:
            return self.items[index]

        def __setitem__(self, index: int, value: Any) -> None:
            self.items[index] = kind.take(value)

    Array.__name__ = Array.__qualname__ = name
    return Array


def taken(name: str, overloads: Sequence[Sequence[CType]], arguments: tuple[Any, ...]) -> list[Any]:
    """Converts the arguments by the first overload that fits, or raises like the wrapper."""
    if len(overloads) == 1:
        if len(arguments) != len(overloads[0]):
            raise TypeError(f"{name}() takes {len(overloads[0])} positional arguments but {len(arguments)} were given")
        return [kind.take(value) for kind, value in zip(overloads[0], arguments, strict=True)]
    for kinds in overloads:
        if len(kinds) == len(arguments):
            try:
                return [kind.take(value) for kind, value in zip(kinds, arguments, strict=True)]
            except (TypeError, OverflowError):
                continue
    raise NotImplementedError(f"Wrong number or type of arguments for overloaded function '{name}'.")
