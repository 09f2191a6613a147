"""Writes the bridge's C++ tables from the port's: ``python -m robot_stack.wmx.bridge.generate``.

Requests, records, status rows, numbers by name and the entries of a parameter file have one description, in Python.
The compiler checks it against the vendor's headers: a call, a class or a field that they lack does not compile. Only
numbers of enumerations and fields of the status that are not needed may be missing, as in the vendor adapter.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from enum import IntEnum
from pathlib import Path
from textwrap import wrap
from typing import Any, Final

from robot_stack.wmx import api
from robot_stack.wmx.api.errors import CoreMotionErrorCode, ErrorCode
from robot_stack.wmx.api.surface import BLOCKS, ENGINE_BLOCK, SURFACE, Call, Commands, Plain
from robot_stack.wmx.api.values import MAX_AXES, AxisSelection
from robot_stack.wmx.axes import N_FLAGS, N_REALS, Flag, Real
from robot_stack.wmx.simulated import parameter_layout
from robot_stack.wmx.simulated.protocol import LARGEST_FRAME, SOCKET_FILE
from robot_stack.wmx.simulated.status_memory import LAYOUT, MAGIC, STATUS_FILE
from robot_stack.wmx.simulated.wire import request_name
from robot_stack.wmx.vendor.names import ERROR_ENUMS, STRANGER
from robot_stack.wmx.vendor.snapshots import FLAGS, NEEDED, REALS

FOLDER: Final = Path(__file__).parent
BY_HAND: Final = frozenset({"SetDeviceName", "GetDeviceName", "GetAllDevices", "StopCommunication", "ScanNetwork"})
"""Calls that the bridge implements itself: their C++ form differs from the port's, or between versions."""

_OBJECTS: Final = {"WMX3Api": "s.api.", "CoreMotion": "s.core.", "advMotion": "s.advanced.advMotion->", "Io": "s.io."}
_RENAMED: Final = {"StartVel_TimedVel": "StartVel"}
"""Overloads of C++ that the port names apart."""
_RESULTS: Final = {"GetAxisPolarity": ("char",), "GetSplineBufferPoints": ("unsigned",)}
_NARROW: Final = {"SetAxisPolarity": "narrow<signed char>(a[1])"}
"""Types of the vendor's header that differ from the port's."""
_NOT_FINITE: Final = {"SetCommandPos": CoreMotionErrorCode.PositionArgumentOutOfRange}
"""Codes for NaN and the infinities; ArgumentOutOfRange for other calls."""
_RECORDS: Final = (
    api.Profile,
    api.Motion_PosCommand,
    api.Velocity_VelCommand,
    api.Velocity_TimedVelCommand,
    *BLOCKS.values(),
    api.Config_EmergencyStopParam,
    api.Config_AxisParam,
)
_INSERTED: Final = 2
"""In the stand-in's enumerations, the number of an entry that the port does not have: those from there on differ."""


def cpp(name: str) -> str:
    """The C++ name of a class that the vendor's Python module exports."""
    return name.replace("_", "::")


def _entry(name: str) -> str:
    return "None" if name == "PyNone" else name


def _header(what: str) -> list[str]:
    return [f"// {what}", "// Written by robot_stack/wmx/bridge/generate.py. Do not edit.", ""]


def _enums() -> list[type[IntEnum]]:
    found = [kind for kind in vars(api).values() if isinstance(kind, type) and issubclass(kind, IntEnum)]
    return sorted((kind for kind in found if kind not in ERROR_ENUMS), key=lambda kind: kind.__name__)


def constants() -> str:
    """tables.hpp: numbers of the protocol, codes, and the entries of a parameter file. It needs no vendor's header."""
    lines = _header(
        "Numbers of the protocol, the codes, and the entries of a parameter file with the vendor's defaults."
    )
    lines += ["#pragma once", "", "#include <cstddef>", "#include <cstdint>", "", "namespace tables {", ""]
    lines += [f"constexpr std::size_t N_REALS = {N_REALS}, N_FLAGS = {N_FLAGS}, MAX_AXES = {MAX_AXES};"]
    lines += [f"constexpr std::int64_t MAGIC = {MAGIC}, LAYOUT = {LAYOUT};"]
    lines += [f"constexpr std::size_t LARGEST_FRAME = {LARGEST_FRAME};"]
    lines += [f'constexpr char SOCKET_FILE[] = "{SOCKET_FILE}", STATUS_FILE[] = "{STATUS_FILE}";', ""]
    lines += ["struct Entry {", "    const char* path;", "    double normal;", "    bool whole;", "};", ""]
    for name, entries in (
        ("GLOBAL_ENTRIES", parameter_layout.GLOBAL_ENTRIES),
        ("AXIS_ENTRIES", parameter_layout.AXIS_ENTRIES),
    ):
        lines += [f"inline constexpr Entry {name}[] = {{"]
        lines += [f'    {{"{path}", {float(n)!r}, {_truth(isinstance(n, int))}}},' for path, n in entries.items()]
        lines += ["};", ""]
    lines += ["}  // namespace tables", "", "// The port's numbers of the codes.", "namespace codes {", ""]
    lines += [f"constexpr int {_entry(one.name)} = {int(one)};" for kind in ERROR_ENUMS for one in kind]
    return "\n".join([*lines, "", "}  // namespace codes", ""])


def _truth(value: bool) -> str:
    return "true" if value else "false"


def numbers() -> str:
    """vendor.hpp: numbers by name, records and status fields; included after the vendor's headers."""
    lines = _header("Numbers by name, records field by field, and rows of the status.")
    lines += [
        "#pragma once",
        "",
        "namespace vendor {",
        "",
        f"constexpr int STRANGER = {STRANGER}, ABSENT = -{STRANGER};",
        "",
        "struct Pair {",
        "    int ours, theirs;",
        "};",
        "",
        "// theirs is ABSENT for a name that this version of the vendor's headers lacks.",
        "#define NAMED(kind, name, number) \\",
        "    []<class K>(K*) constexpr -> Pair { \\",
        "        if constexpr (requires { K::name; }) return {number, static_cast<int>(K::name)}; \\",
        "        else return {number, ABSENT}; \\",
        "    }(static_cast<kind*>(nullptr))",
        "",
        "template <class T>",
        "inline constexpr Pair NAMES[] = {{0, 0}};",
        "",
    ]
    for kind in _enums():
        name = cpp(kind.__name__)
        lines += ["template <>", f"inline constexpr Pair NAMES<{name}::T>[] = {{"]
        lines += [f"    NAMED({name}, {_entry(one.name)}, {int(one)})," for one in kind]
        lines += ["};", ""]
    lines += ["struct Errors {};", "template <>", "inline constexpr Pair NAMES<Errors>[] = {"]
    lines += [f"    NAMED({kind.__name__}, {_entry(one.name)}, {int(one)})," for kind in ERROR_ENUMS for one in kind]
    lines += ["};", "", "#undef NAMED", ""]
    for record in _RECORDS:
        lines += ["template <class V>", f"void visit({cpp(record.__name__)}& r, V&& v) {{"]
        lines += [f"    v(r.{item.name});" for item in fields(record)]
        lines += ["}", ""]
    lines += ["// Fields that a version lacks are left out; those that the robot needs must exist."]
    lines += ["template <class Axis, class V>", "void visit_status(Axis& a, V&& v) {"]
    rows: list[tuple[str, Mapping[Any, str]]] = [("flag", FLAGS), ("real", REALS)]
    for what, table in rows:
        taken: set[str] = set()
        for row, name in table.items():
            guard = "" if name in NEEDED else f"if constexpr (requires {{ a.{name}; }}) "
            lines += [f"    {guard}v.{what}({int(row)}, a.{name}, {_truth(name in taken)});"]
            taken.add(name)
    lines += ["}", ""]
    lines += [f"constexpr int SERVO_OFFLINE = {int(Flag.SERVO_OFFLINE)}, COMMAND_MODE = {int(Flag.COMMAND_MODE)};"]
    lines += [f"constexpr int OP_STATE = {int(Flag.OP_STATE)}, POS_CMD = {int(Real.POS_CMD)};"]
    lines += [f"constexpr int ACTUAL_POS = {int(Real.ACTUAL_POS)}, FOLLOWING_ERROR = {int(Real.FOLLOWING_ERROR)};", ""]
    return "\n".join([*lines, "}  // namespace vendor", ""])


def requests() -> str:
    """requests.hpp: the requests that are one call of the vendor's library each."""
    lines = _header("Requests that are one call of the vendor's library each.")
    lines += ["#pragma once", "", "inline const std::unordered_map<std::string_view, Request> REQUESTS = {"]
    lines += list(_requests())
    return "\n".join([*lines, "};", ""])


def _requests() -> Iterator[str]:
    seen: set[str] = set()
    for owner, table in SURFACE.items():
        for name, call in table.items():
            request = request_name(owner, name)
            if call.own or name in BY_HAND or request in seen:
                continue
            seen.add(request)
            setter = name.startswith("Set") and name.removeprefix("Set") in (*BLOCKS, ENGINE_BLOCK)
            unfit = CoreMotionErrorCode.ParameterSettingsInvalid if setter else ErrorCode(call.unfit)
            body = _block(name, call) if setter else _plain(owner, name, call)
            given, out = " a" if call.takes else "", " out" if call.values else ""
            yield f'    {{"{request}",'
            yield f"     {{{len(call.takes)}, {int(unfit)}, [](Session& s, const List&{given}, List&{out}) {{"
            yield f"          return {body};"
            yield "      }}},"


def _block(name: str, call: Call) -> str:
    """The engine's block is read, changed and written: the vendor's other fields stay."""
    block, axis = name.removeprefix("Set"), "whole(a[0]), " if len(call.takes) > 1 else ""
    get, put = f"s.core.config->Get{block}({axis}p)", f"s.core.config->Set{block}({axis}p)"
    kind = cpp(f"Config_{block}")
    steps = [f"[&](auto* p) {{ return {step}; }}" for step in (get, put)]
    return ",\n                 ".join([f"change<{kind}>(a[{len(call.takes) - 1}]", *steps]) + ")"


def _plain(owner: str, name: str, call: Call) -> str:
    method = _OBJECTS.get(owner, f"s.core.{owner}->") + _RENAMED.get(name, name.removesuffix("_AxisSel"))
    first = call.takes[0] if call.takes else None
    given = [_argument(kind, index, _NOT_FINITE.get(name)) for index, kind in enumerate(call.takes)]
    if name in _NARROW:
        given[-1] = _NARROW[name]
    if isinstance(first, Commands):
        return f"commands<{cpp(first.kind.__name__)}>(a[0], [&](auto... c) {{ return {method}(c...); }})"
    if first is Plain.AXIS or first is AxisSelection:
        return f"on_axes(a[0], [&](auto axes) {{ return {method}({', '.join(['axes', *given[1:]])}); }})"
    if call.values:
        kinds = ", ".join(_RESULTS.get(name, tuple(_result(kind) for kind in call.values)))
        return f"answer<{kinds}>(out, [&](auto*... p) {{ return {method}({', '.join([*given, 'p...'])}); }})"
    return f"{method}({', '.join(given)})"


def _argument(kind: Any, index: int, not_finite: int | None) -> str:
    if kind is Plain.DOUBLE:
        return f"finite(a[{index}], {int(not_finite or ErrorCode.ArgumentOutOfRange)})"
    if isinstance(kind, type) and issubclass(kind, IntEnum):
        return f"named<{cpp(kind.__name__)}::T>(a[{index}])"
    readers = {Plain.INT: "whole", Plain.UINT: "natural", Plain.UCHAR: "narrow<unsigned char>"}
    return f"{readers.get(kind, '')}(a[{index}])" if kind in readers else ""


def _result(kind: Any) -> str:
    return {float: "double", int: "int"}.get(kind) or cpp(kind.__name__)


def enumerations() -> str:
    """enumerations.hpp: the stand-in's, with an entry inserted into each, so that their numbers are not the port's."""
    lines = _header("Enumerations of the stand-in, all but the error codes' zero with other numbers than the port's.")
    lines += ["#pragma once", ""]
    nested: dict[str, list[str]] = {"": [], "Config": []}
    for kind in _enums():
        owner, _, name = kind.__name__.rpartition("_")
        entries = [*((one.name, _shifted(int(one))) for one in kind), ("EntryOfAnotherVersion", _INSERTED)]
        nested[owner] += _class(name, "T ", entries)
    for kind in ERROR_ENUMS:
        base = "" if kind is ErrorCode else " : ErrorCode"
        nested[""] += _class(kind.__name__ + base, "", [(one.name, int(one) + (int(one) > 0)) for one in kind])
    lines += ["namespace wmx3Api {", "", *nested[""], "", "struct ConfigEnumerations {"]
    lines += [f"    {line}" for line in nested["Config"]]
    return "\n".join([*lines, "};", "", "}  // namespace wmx3Api", ""])


def _class(name: str, enum: str, entries: list[tuple[str, int]]) -> list[str]:
    text = ", ".join(f"{_entry(one)} = {number}" for one, number in entries)
    return [f"struct {name} {{", f"    enum {enum}{{", *(f"        {line}" for line in wrap(text, 110)), "    };", "};"]


def _shifted(number: int) -> int:
    return number + (number >= _INSERTED)


FILES: Final = {
    "generated/tables.hpp": constants,
    "generated/vendor.hpp": numbers,
    "generated/requests.hpp": requests,
    "standin/enumerations.hpp": enumerations,
}


def main() -> None:
    for name, text in FILES.items():
        (FOLDER / name).write_text(text(), encoding="utf-8")


if __name__ == "__main__":
    main()
