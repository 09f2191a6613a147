"""The faults of the arm, one row each, for ``/sim/inject_arm_fault``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from sim.arm.drives import ArmDrives
from sim.arm.params import ArmParams
from sim.plant.fault_table import FaultKind

DEFAULT_ALARM_CODE = 0x4210  # CiA 402: excess temperature of the device
ENCODER_ALARM_CODE = 0x7305  # CiA 402: incremental sensor 1 fault
JOINTS = ("joint1", "joint2", "joint3", "joint4", "joint5", "joint6")
_ONLY = ("",)
_LARGEST_PAYLOAD_KG = 10.0


class FaultyArm(Protocol):
    """The target of faults."""

    @property
    def bus(self) -> ArmDrives: ...
    @property
    def params(self) -> ArmParams: ...
    def set_payload(self, mass_kg: float) -> None: ...


def _drive_alarm(arm: FaultyArm, target: str, value: float | None) -> str:
    code = int(value or 0)
    arm.bus.set_alarm(JOINTS.index(target), code)
    return f"drive of {target} reports alarm 0x{code:04X}"


def _bus_loss(arm: FaultyArm, target: str, value: float | None) -> str:
    arm.bus.set_bus(value is None)
    return "the fieldbus is cut"


def _encoder_freeze(arm: FaultyArm, target: str, value: float | None) -> str:
    arm.bus.set_encoder_frozen(JOINTS.index(target), value is not None)
    return f"encoder of {target} repeats its last count"


def _encoder_loss(arm: FaultyArm, target: str, value: float | None) -> str:
    axis = JOINTS.index(target)
    arm.bus.set_encoder_frozen(axis, value is not None)
    arm.bus.set_alarm(axis, 0 if value is None else ENCODER_ALARM_CODE)
    return f"encoder of {target} is lost, its drive reports alarm 0x{ENCODER_ALARM_CODE:04X}"


def _joint_blocked(arm: FaultyArm, target: str, value: float | None) -> str:
    arm.bus.set_blocked(JOINTS.index(target), value is not None)
    return f"{target} does not turn"


def _payload(arm: FaultyArm, target: str, value: float | None) -> str:
    mass_kg = arm.params.payload_kg if value is None else value
    arm.set_payload(mass_kg)
    return f"{mass_kg:g} kg between the fingertips"


def _row(
    change: Callable[[FaultyArm, str, float | None], str],
    what: str,
    targets: tuple[str, ...] = _ONLY,
    value: tuple[str, float, float, float] = ("none", 0.0, 0.0, 0.0),
) -> FaultKind:
    name, low, high, default = value
    return FaultKind(change.__name__.lstrip("_"), what, targets, name, change, low, high, default)


FAULT_KINDS: tuple[FaultKind, ...] = (
    _row(
        _drive_alarm,
        "a fault inside a joint's drive; its alarm stays until the engine clears it",
        JOINTS,
        ("alarm code", 1.0, 65535.0, float(DEFAULT_ALARM_CODE)),
    ),
    _row(_bus_loss, "no telegram passes between engine and drives"),
    _row(_encoder_freeze, "an encoder repeats its last count", JOINTS),
    _row(_encoder_loss, "an encoder is lost and its drive reports an alarm", JOINTS),
    _row(_joint_blocked, "a joint is jammed", JOINTS),
    _row(_payload, "no fault: a mass between the fingertips", _ONLY, ("kg", 0.0, _LARGEST_PAYLOAD_KG, 3.0)),
)
