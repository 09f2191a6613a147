"""The battery's state from its frames, while they are fresh."""

from __future__ import annotations

from typing import TypeVar

from robot_stack.drivers.battery import Health, PackParams, Reading, flow, implausible
from robot_stack.drivers.counters import Counters
from robot_stack.drivers.pylontech.frames import (
    Charge,
    Frame,
    FrameRefused,
    Limits,
    Manufacturer,
    Measured,
    Protection,
    Requests,
    decode,
)

TAKEN, REFUSED, OTHERS = "frames", "frames refused", "frames of others"
FrameT = TypeVar("FrameT", bound=Frame)


# Alarms of the battery, most severe first.
_HEALTH = {
    "system error": Health.FAILURE,
    "over temperature": Health.HOT,
    "over voltage": Health.OVER_VOLTAGE,
    "under voltage": Health.EMPTY,
    "under temperature": Health.COLD,
    "discharge over current": Health.FAILURE,
    "charge over current": Health.FAILURE,
}


class Pack:
    """Call for every frame. Times are plain steady seconds."""

    def __init__(self, params: PackParams) -> None:
        self._params = params
        self._newest: dict[type, tuple[float, Frame]] = {}
        self.refusal = ""
        self.counters = Counters(TAKEN, REFUSED, OTHERS)

    def received(self, number: int, data: bytes, now_s: float) -> Frame | None:
        """The frame if it is the battery's and plausible. After a rejected one, the last frame becomes stale."""
        try:
            frame = decode(number, data)
            if isinstance(frame, Measured):
                self._check(frame)
        except FrameRefused as refusal:
            self.counters.add(REFUSED)
            self.refusal = str(refusal)
            return None
        self.counters.add(OTHERS if frame is None else TAKEN)
        if frame is not None:
            self._newest[type(frame)] = now_s, frame
        return frame

    def reading(self, now_s: float) -> Reading | None:
        """None if charge or measurement is missing or stale: see ``problem``."""
        measured, charge = self._fresh(Measured, now_s), self._fresh(Charge, now_s)
        if measured is None or charge is None:
            return None
        return Reading(
            self._newest[Measured][0],
            measured.voltage_v,
            measured.current_a,
            charge.charge,
            self._params.capacity_ah * charge.health,
            measured.temperature_c,
            flow(measured.current_a, charge.charge, self._params.idle_current_a),
            self._health(now_s),
        )

    def problem(self, now_s: float) -> str:
        """Why there is no reading, or the battery's alarms; empty without a problem."""
        missing = [
            name
            for kind, name in ((Measured, "0x356 (voltage, current)"), (Charge, "0x355 (charge)"))
            if self._fresh(kind, now_s) is None
        ]
        if missing:
            why = f", the last was refused: {self.refusal}" if self.refusal else ""
            return f"no frame {' and '.join(missing)} for {self._params.stale_s:g} s{why}"
        protection, requests = self._fresh(Protection, now_s), self._fresh(Requests, now_s)
        if protection is not None and protection.protections:
            return f"the battery reports active protections: {', '.join(protection.protections)}"
        if requests is not None and not requests.may_discharge:
            return "the battery does not allow discharging"
        return ""

    def values(self, now_s: float) -> dict[str, str]:
        """For /diagnostics."""
        protection, requests = self._fresh(Protection, now_s), self._fresh(Requests, now_s)
        limits, made = self._fresh(Limits, now_s), self._newest.get(Manufacturer)
        return {
            "manufacturer": made[1].name if made and isinstance(made[1], Manufacturer) else "not received",
            "protections": _listed(protection.protections) if protection is not None else "not received",
            "alarms": _listed(protection.alarms) if protection is not None else "not received",
            "asks to be charged": "not received" if requests is None else "yes" if requests.must_charge else "no",
            "may be charged": "not received"
            if limits is None
            else _allowed(limits.charge_current_a, requests, "charge"),
            "may be discharged": (
                "not received" if limits is None else _allowed(limits.discharge_current_a, requests, "discharge")
            ),
            **self.counters.values(),
        }

    def _fresh(self, kind: type[FrameT], now_s: float) -> FrameT | None:
        time_s, frame = self._newest.get(kind, (0.0, None))
        return frame if isinstance(frame, kind) and now_s - time_s <= self._params.stale_s else None

    def _check(self, frame: Measured) -> None:
        why = implausible(frame.voltage_v, frame.current_a, frame.temperature_c, self._params)
        if why:
            raise FrameRefused(why)

    def _health(self, now_s: float) -> Health:
        protection = self._fresh(Protection, now_s)
        if protection is None:
            return Health.UNKNOWN
        complaints = {*protection.protections, *protection.alarms}
        return next((health for name, health in _HEALTH.items() if name in complaints), Health.GOOD)


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(names) or "none"


def _allowed(current_a: float, requests: Requests | None, what: str) -> str:
    allowed = requests is None or (requests.may_charge if what == "charge" else requests.may_discharge)
    return f"with {current_a:g} A" if allowed else "no"
