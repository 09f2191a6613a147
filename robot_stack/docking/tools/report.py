"""A docking as numbers for programs and as lines for people."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from statistics import median
from typing import Any

from robot_stack.contract.states import DockingState
from robot_stack.core.docks import Docks
from robot_stack.docking.tools.trace import Safety, Spell, Trace, spells
from robot_stack.docking.tools.verdict import Finding, Limits, judge


def numbers(trace: Trace, limits: Limits, docks: Docks) -> dict[str, Any]:
    """All numbers of the report, in SI units; times in s since the docking's start, None if unknown."""
    verdict = judge(trace, limits)
    return {
        "start_s": trace.start_s,
        "duration_s": _round(trace.end_s - trace.start_s),
        "dock": _dock(trace, docks),
        "camera": trace.camera() or None,
        "begins_before_recording": trace.before == "",
        "ended_in": trace.after or None,
        "success": verdict.success,
        "verdict": verdict.text,
        "causes": [_finding(item) for item in verdict.causes],
        "other_findings": [_finding(item) for item in verdict.others],
        "log": [{"at_s": _round(at_s - trace.start_s), "text": f"{who}: {text}"} for at_s, who, text in trace.log],
        "tries": _tries(trace),
        "states": [_spell(trace, spell, "state") for spell in trace.states()],
        "errors": _errors(trace),
        "markers": _markers(trace),
        "safety": _safety(trace),
        "limits": _limits(trace),
        "speed": _speeds(trace),
        "effort_max_nm": _most(item.largest_nm for item in trace.efforts),
        "images": len(trace.shots),
    }


def lines(number: int, docking: dict[str, Any], start: str) -> list[str]:
    """``numbers`` for people. start: the date and time it began."""
    errors, speed = docking["errors"], docking["speed"]
    dock = docking["dock"] or "a dock whose markers were never detected"
    times = "1 try" if docking["tries"] == 1 else f"{docking['tries']} tries"
    shown = [
        f"docking {number}: {dock}, {start}, {docking['duration_s']:.1f} s, {times}",
        f"  verdict: {docking['verdict']}",
        *(f"  also: {item['text']}" for item in [*docking["causes"][1:], *docking["other_findings"]]),
        *(f"  t={item['at_s']:.1f} s, {item['text']}" for item in docking["log"]),
        "  states: " + ", ".join(f"{item['state']} {item['duration_s']:.1f} s" for item in docking["states"]),
        f"  errors: least {_mm(errors['least_m'])} and {_deg(errors['least_yaw_rad'])}, "
        f"last {_mm(errors['last_m'])} and {_deg(errors['last_yaw_rad'])}",
        f"  markers visible: {_seen(docking)}",
        *(
            f"  marker {item['id']}: {item['detections']} detections, quality median {item['quality_median']:.2f}, "
            f"least {item['quality_least']:.2f}"
            for item in docking["markers"]["each"]
        ),
        *(f"  safety: {item['code']} {_from_to(item)}" for item in docking["safety"]),
        *(
            f"  speed limit {item['linear_mps']:.2f} m/s {_from_to(item)}: {item['reason']}"
            for item in docking["limits"]
        ),
        f"  speed: commanded at most {_number(speed['commanded_max_mps'], 'm/s')}, "
        f"driven {_number(speed['driven_max_mps'], 'm/s')}; effort at most {_number(docking['effort_max_nm'], 'Nm')}",
    ]
    if docking["begins_before_recording"]:
        shown.insert(1, "  it began before the recording")
    return shown


def _dock(trace: Trace, docks: Docks) -> str | None:
    """The dock most of whose markers were seen."""
    owners = [found[0] for marker in trace.markers if (found := docks.of_marker(marker.marker_id)) is not None]
    return max(sorted(set(owners)), key=owners.count, default=None)


def _tries(trace: Trace) -> int:
    """Each way back to staging is another one."""
    states = [spell.value for spell in trace.states()]
    return 1 + states[1:].count(DockingState.APPROACH)


def _errors(trace: Trace) -> dict[str, float | None]:
    aiming = [item for item in trace.statuses if item.at_s <= trace.end_s]
    position = [item.error_m for item in aiming if math.isfinite(item.error_m)]
    yaw = [item.yaw_rad for item in aiming if math.isfinite(item.yaw_rad)]
    return {
        "least_m": min(position, default=None),
        "least_yaw_rad": min(map(abs, yaw), default=None),
        "last_m": position[-1] if position else None,
        "last_yaw_rad": yaw[-1] if yaw else None,
    }


def _markers(trace: Trace) -> dict[str, Any]:
    visible = [
        item.visible for item in trace.statuses if item.state != DockingState.APPROACH and item.at_s <= trace.end_s
    ]
    ids = sorted({marker.marker_id for marker in trace.markers})
    by_id = {number: [marker.quality for marker in trace.markers if marker.marker_id == number] for number in ids}
    return {
        "visible_median": median(visible) if visible else None,
        "visible_least": min(visible, default=None),
        "visible_most": max(visible, default=None),
        "blind_share": _round(sum(count == 0 for count in visible) / len(visible)) if visible else None,
        "each": [
            {
                "id": number,
                "detections": len(qualities),
                "quality_median": _round(median(qualities)),
                "quality_least": _round(min(qualities)),
            }
            for number, qualities in by_id.items()
        ],
    }


def _safety(trace: Trace) -> list[dict[str, Any]]:
    codes = sorted({code for item in trace.safety for code in item.faults})
    rows = [_active(trace, code, partial(_has_fault, code)) for code in codes]
    rows.append(_active(trace, "emergency stop", lambda item: item.emergency))
    return sorted((item for row in rows for item in row), key=lambda item: float(item["from_s"]))


def _has_fault(code: str, item: Safety) -> bool:
    return code in item.faults


def _active(trace: Trace, name: str, value: Callable[[Safety], bool]) -> list[dict[str, Any]]:
    found = spells(trace.safety, value, trace.end_s)
    return [_spell(trace, spell, "code") | {"code": name} for spell in found if spell.value and spell.duration_s > 0.0]


def _limits(trace: Trace) -> list[dict[str, Any]]:
    found = spells(trace.limits, lambda item: (item.linear_mps, item.angular_radps, item.reason), trace.end_s)
    return [
        _spell(trace, spell, "value")
        | {"value": None, "linear_mps": spell.value[0], "angular_radps": spell.value[1], "reason": spell.value[2]}
        for spell in found
        if spell.value[2] and spell.duration_s > 0.0
    ]


def _speeds(trace: Trace) -> dict[str, float | None]:
    return {
        "commanded_max_mps": _most(math.hypot(item.vx_mps, item.vy_mps) for item in trace.commanded),
        "driven_max_mps": _most(math.hypot(item.vx_mps, item.vy_mps) for item in trace.driven),
    }


def _most(values: Iterable[float]) -> float | None:
    return max((value for value in values if math.isfinite(value)), default=None)


def _spell(trace: Trace, spell: Spell, name: str) -> dict[str, Any]:
    # A condition from before the docking is shown from its start.
    from_s = max(0.0, spell.start_s - trace.start_s)
    to_s = spell.end_s - trace.start_s
    return {name: spell.value, "from_s": _round(from_s), "to_s": _round(to_s), "duration_s": _round(to_s - from_s)}


def _finding(item: Finding) -> dict[str, Any]:
    return {"from_s": _round(item.start_s), "to_s": _round(item.end_s), "text": item.text}


def _round(value: float) -> float:
    return round(value, 4)


def _seen(docking: dict[str, Any]) -> str:
    seen = docking["markers"]
    if seen["visible_most"] is None:
        return "never looked"
    return (
        f"{seen['visible_least']} to {seen['visible_most']}, median {seen['visible_median']:g}, "
        f"none {seen['blind_share']:.0%} of the time"
    )


def _from_to(item: dict[str, Any]) -> str:
    return f"from {item['from_s']:.1f} to {item['to_s']:.1f} s"


def _mm(value_m: float | None) -> str:
    return "unknown" if value_m is None else f"{1000.0 * value_m:.1f} mm"


def _deg(value_rad: float | None) -> str:
    return "unknown" if value_rad is None else f"{math.degrees(abs(value_rad)):.2f} deg"


def _number(value: float | None, unit: str) -> str:
    return "not recorded" if value is None else f"{value:.3g} {unit}"
