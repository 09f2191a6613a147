"""The tables of the surface match the protocols of the port."""

from __future__ import annotations

import inspect
from typing import Any

import pytest

from robot_stack.wmx.api import AxisSelection, ErrorCode, Motion_PosCommand, port
from robot_stack.wmx.api.surface import SURFACE, Call, Commands, Plain, one_or_many
from robot_stack.wmx.simulated.wire import BadArgument, decode, encode

PROTOCOLS = {"axisControl": "AxisControl", "advMotion": "AdvMotion"}


def protocol(owner: str) -> Any:
    return getattr(port, PROTOCOLS.get(owner, owner[:1].upper() + owner[1:]))


def methods(owner: str) -> dict[str, inspect.Signature]:
    members = vars(protocol(owner)).items()
    return {name: inspect.signature(member) for name, member in members if name[:1].isupper() and callable(member)}


@pytest.mark.parametrize("owner", SURFACE)
def test_a_table_is_its_protocol(owner: str) -> None:
    signatures = methods(owner)
    assert set(signatures) - {"ErrorToString"} == set(SURFACE[owner])
    for name, call in SURFACE[owner].items():
        _, *parameters = signatures[name].parameters.values()
        optional = [one for one in parameters if one.default is not inspect.Parameter.empty]
        if any(isinstance(kind, Commands) for kind in call.takes):
            assert (len(parameters), len(optional)) == (2, 1), f"{name}: one command, or a count and a list"
        else:
            assert (len(parameters), len(optional)) == (len(call.takes), call.optional), name
        answer = str(signatures[name].return_annotation)
        assert answer.count(",") == (0 if call.plain else len(call.values) + call.echo), name


def test_zero_values() -> None:
    code = ErrorCode.DeviceIsNull
    assert Call().zero(code) == code
    assert Call(values=(int, str)).zero(code) == (code, 0, "")
    assert Call((int,), echo=True).zero(code, "block") == (code, "block")
    assert Call(values=(bool,), plain=True).zero(code) is False


def test_one_or_many() -> None:
    assert one_or_many("command") == ["command"]
    assert one_or_many(1, ["one", "two"]) == ["one"]
    assert [one_or_many(2), one_or_many(3, ["one"]), one_or_many(-1, [])] == [None, None, None]


@pytest.mark.parametrize(
    ("kind", "value", "sent"),
    [
        (Plain.AXIS, 3, [3]),
        (AxisSelection, AxisSelection.of(4, 2), [4, 2]),
        (Plain.TEXT, "x", "x"),
        (float, 0.5, 0.5),
        (list[int], [1, 2], [1, 2]),
        (Motion_PosCommand, Motion_PosCommand(1, 2.0), [1, 2.0, [0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]]),
    ],
)
def test_on_the_wire(kind: Any, value: Any, sent: Any) -> None:
    assert encode(kind, value) == sent
    received = decode(kind, sent)
    assert received == (sent if kind in (Plain.AXIS, AxisSelection) else value)


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (Plain.AXIS, 3),
        (Plain.INT, True),
        (Plain.INT, 1.0),
        (Plain.INT, 2**62 + 1),
        (Plain.DOUBLE, "1"),
        (Plain.DOUBLE, 10**400),
        (Plain.TEXT, 1),
        (bool, 1),
        (AxisSelection, [0] * 129),
        (Commands(Motion_PosCommand), [[1, 2.0]]),
        (Motion_PosCommand, {"axis": 1}),
        (list[int], [None]),
    ],
)
def test_argument_of_wrong_kind_is_rejected(kind: Any, value: Any) -> None:
    with pytest.raises(BadArgument):
        decode(kind, value)
