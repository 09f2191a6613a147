"""Explains in words how a docking ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from robot_stack.contract.frames import FRONT_CAMERA, REAR_CAMERA
from robot_stack.contract.states import ALIGNING, SERVOED, DockingState
from robot_stack.docking.tools.collector import DETECTOR
from robot_stack.docking.tools.trace import Spell, Status, Trace, silences, spells

_NAMES = {FRONT_CAMERA: "front camera", REAR_CAMERA: "rear camera", DETECTOR: "marker detector"}
_CAMERA_TIMEOUT = "CAMERA_TIMEOUT"


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits for findings: the docking controller's limits and the contract's ages.

    aligned_*: the errors at which a docking is done. lost_s: without a marker. jump_m: of the error between two states.
    at_end_s: a finding that lasted until this long before the end can be a cause.
    """

    aligned_m: float
    aligned_rad: float
    lost_s: float
    silent_s: float
    jump_m: float
    at_end_s: float = 1.0


@dataclass(frozen=True, slots=True)
class Finding:
    """A deviation; times in s since the docking's start."""

    start_s: float
    end_s: float
    text: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """text: one sentence. causes: findings at the end, likeliest first. others: earlier findings."""

    success: bool
    text: str
    causes: tuple[Finding, ...]
    others: tuple[Finding, ...]


def judge(trace: Trace, limits: Limits) -> Verdict:
    """The verdict on one docking."""
    found = [finding for rule in _RULES for finding in rule(trace, limits)]
    length_s = trace.end_s - trace.start_s
    at_end = tuple(item for item in found if item.end_s >= length_s - limits.at_end_s)
    before = tuple(sorted((item for item in found if item not in at_end), key=lambda item: item.start_s))
    if trace.after == DockingState.DOCKED:
        return Verdict(True, _success(trace), (), (*before, *at_end))
    causes = at_end or tuple(_stuck(trace, limits))
    reason = causes[0].text if causes else "the recording contains no reason"
    return Verdict(False, f"{_end_in_words(trace)}: {reason}", causes, before)


def _success(trace: Trace) -> str:
    confirmed = ", passenger attached" if trace.latched else ""
    return f"docked after {trace.end_s - trace.start_s:.1f} s with {_errors(trace.statuses)}{confirmed}"


def _end_in_words(trace: Trace) -> str:
    states = trace.states()
    last = states[-1].value if states else trace.before or "nowhere"
    length_s = trace.end_s - trace.start_s
    if trace.after == DockingState.FAILED:
        return f"failed in {last} after {length_s:.1f} s"
    if trace.after == DockingState.IDLE:
        return f"ended in {last} after {length_s:.1f} s without failing (cancelled, or no more was asked for)"
    return f"the recording ends in {last} after {length_s:.1f} s"


def _errors(statuses: Sequence[Status]) -> str:
    known = [item for item in statuses if math.isfinite(item.error_m) and math.isfinite(item.yaw_rad)]
    if not known:
        return "errors unknown"
    return f"{1000.0 * known[-1].error_m:.1f} mm and {math.degrees(abs(known[-1].yaw_rad)):.2f} deg"


def _since(trace: Trace, spell: Spell, text: str) -> Finding:
    start_s, end_s = max(0.0, spell.start_s - trace.start_s), spell.end_s - trace.start_s
    return Finding(start_s, end_s, f"{text} for {end_s - start_s:.1f} s from t={start_s:.1f} s")


# --- rules, the likeliest cause first --------------------------------------------------------------------------------


def _emergency(trace: Trace, _: Limits) -> list[Finding]:
    found = spells(trace.safety, lambda item: (item.emergency, item.faults), trace.end_s)
    stops = [spell for spell in found if spell.value[0]]
    return [
        _since(trace, spell, f"emergency stop ({', '.join(spell.value[1]) or 'no fault named'})") for spell in stops
    ]


def _silent_sources(trace: Trace, limits: Limits) -> list[Finding]:
    camera = trace.camera()
    found = []
    for source, times in sorted(trace.seen.items(), key=lambda item: item[0] == DETECTOR):
        # The camera that is not used may be off.
        if source not in (camera or source, DETECTOR):
            continue
        quiet = silences(times, trace.start_s, trace.end_s, limits.silent_s)
        found += [_since(trace, spell, f"{_NAMES.get(source, source)} silent") for spell in quiet]
    return found


def _camera_fault(trace: Trace, _: Limits) -> list[Finding]:
    found = spells(trace.safety, lambda item: _CAMERA_TIMEOUT in item.faults, trace.end_s)
    return [_since(trace, spell, f"{_CAMERA_TIMEOUT} active") for spell in found if spell.value]


def _stopped(trace: Trace, _: Limits) -> list[Finding]:
    found = spells(trace.limits, lambda item: (item.linear_mps <= 0.0, item.reason), trace.end_s)
    stops = [spell for spell in found if spell.value[0] and spell.duration_s > 0.0]
    return [_since(trace, spell, f"safety stop {spell.value[1] or 'without a reason'}") for spell in stops]


def _unlatched(trace: Trace, _: Limits) -> list[Finding]:
    """DOCKED that was left for another try or for good: the latch did not close, or opened again."""
    states = [*trace.states(), Spell(trace.end_s, trace.end_s, trace.after)]
    return [
        _since(trace, spell, f"the latch did not confirm: {DockingState.DOCKED}")
        for spell, after in pairwise(states)
        if spell.value == DockingState.DOCKED and after.value != DockingState.DOCKED
    ]


def _moved(trace: Trace, limits: Limits) -> list[Finding]:
    """The error jumped while the robot was aligning: the dock moved, or another pose was accepted."""
    found = []
    for before, after in pairwise(trace.statuses):
        jump_m = after.error_m - before.error_m
        if before.state in SERVOED and after.at_s - before.at_s < limits.silent_s and jump_m > limits.jump_m:
            at_s = after.at_s - trace.start_s
            text = f"the dock moved, or its pose jumped: error +{1000.0 * jump_m:.0f} mm at t={at_s:.1f} s"
            found.append(Finding(at_s, at_s, text))
    return found


def _lost(trace: Trace, limits: Limits) -> list[Finding]:
    """No marker in the image in states that need one."""
    before_end = [item for item in trace.statuses if item.at_s < trace.end_s]
    blind = spells(before_end, lambda item: item.visible == 0 and item.state in ALIGNING, trace.end_s)
    ever = any(item.visible for item in trace.statuses)
    text = "markers lost" if ever else "no marker was found"
    return [_since(trace, spell, text) for spell in blind if spell.value and spell.duration_s > limits.lost_s]


def _no_camera(trace: Trace, _: Limits) -> list[Finding]:
    if trace.markers or any(camera in trace.seen for camera in (FRONT_CAMERA, REAR_CAMERA)):
        return []
    return [Finding(0.0, trace.end_s - trace.start_s, "no camera is in the recording")]


def _silent_controller(trace: Trace, limits: Limits) -> list[Finding]:
    quiet = silences([item.at_s for item in trace.statuses], trace.start_s, trace.end_s, limits.silent_s)
    return [_since(trace, spell, "docking controller silent") for spell in quiet]


_RULES: tuple[Callable[[Trace, Limits], list[Finding]], ...] = (
    _emergency,
    _silent_sources,
    _camera_fault,
    _stopped,
    _unlatched,
    _moved,
    _lost,
    _no_camera,
    _silent_controller,
)


def _stuck(trace: Trace, limits: Limits) -> list[Finding]:
    """No fault was found: the last state did not reach its aim."""
    states = trace.states()
    if not states:
        return []
    last, start_s, end_s = states[-1], states[-1].start_s - trace.start_s, trace.end_s - trace.start_s
    inside = [item for item in trace.statuses if last.start_s <= item.at_s < trace.end_s]
    if last.value == DockingState.APPROACH:
        return [_since(trace, last, "the staging pose was not reached")]
    known = [item for item in inside if math.isfinite(item.error_m) and math.isfinite(item.yaw_rad)]
    if last.value not in SERVOED or not known:
        return []
    if known[-1].error_m < limits.aligned_m and abs(known[-1].yaw_rad) < limits.aligned_rad:
        return [Finding(start_s, end_s, f"aligned with {_errors(known)}, but not for long enough")]
    best_mm, best_deg = 1000.0 * min(i.error_m for i in known), math.degrees(min(abs(i.yaw_rad) for i in known))
    needed = f"{1000.0 * limits.aligned_m:g} mm and {math.degrees(limits.aligned_rad):.1f} deg"
    text = f"error did not converge: {_errors(known)}, best {best_mm:.1f} mm and {best_deg:.2f} deg, needed {needed}"
    return [Finding(start_s, end_s, text)]
