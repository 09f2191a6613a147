"""estop and reset: the two keys of the emergency stop.

They use the supervisor, whose node is already discovered; without a supervisor, a new node, which takes up to a few
seconds to discover the others.
"""

from __future__ import annotations

import contextlib
import time
from typing import Annotated

import typer

from robot_stack.cli.errors import CommandError
from robot_stack.contract.model import System
from robot_stack.supervisor.control import NotRunning, ask

Timeout = Annotated[float, typer.Option("--timeout", help="Seconds to wait for the answer.")]
Clear = Annotated[
    list[str] | None,
    typer.Option("--clear", metavar="SOURCE", help="A source that is gone or unknown: its press is cleared first."),
]
_CLEAR_HINT = "; a source that is gone or unknown is cleared by name: robot-stack reset --clear NAME"
# Timeout of the supervisor.
_SUPERVISOR_S = 0.5
_POLL_S = 0.02
# The safety monitor requires a settled release before it grants a reset.
_RESET_TRIES = 8
_RESET_PAUSE_S = 0.1


def estop(timeout_s: Timeout = 5.0) -> None:
    """Emergency stop, now. Returns when the safety monitor shows it; exit code 1 if it does not.

    A machine of the motion-engine layer has no safety monitor: there it returns when the stop is sent.
    """
    begun_s = time.monotonic()
    shown = _stop_by_supervisor(begun_s + timeout_s)
    if shown is None:
        print("emergency stop, sent; this machine has no safety monitor to confirm it; `robot-stack reset` releases it")
        return
    if not shown:
        from robot_stack.cli.nodes.operator_commands import emergency_stop

        shown = emergency_stop(timeout_s) is not None
    if not shown:
        raise CommandError("the stop was sent, but the safety monitor did not confirm it: use the button")
    print(f"emergency stop, confirmed after {time.monotonic() - begun_s:.2f} s; `robot-stack reset` releases it")


def reset(timeout_s: Timeout = 5.0, clear: Clear = None) -> None:
    """Release the emergency stop. The safety monitor refuses while a source is pressed or the robot moves.

    The robot stays at rest: motion needs a new command after the release.
    """
    answer = None
    if clear:
        _release_by_supervisor()
    else:
        answer = _reset_by_supervisor()
    # A press of this tool outlives its process. The reset of a new node clears it first.
    if answer is None or not answer[0]:
        from robot_stack.cli.nodes.operator_commands import reset as ask_for_reset

        answer = ask_for_reset(timeout_s, clear or ())
    granted, reason = answer
    if not granted:
        raise CommandError(reason + _CLEAR_HINT)
    print(reason or "released")


def _stop_by_supervisor(end_s: float) -> bool | None:
    """True if the supervisor sent the stop and the safety monitor reported an emergency; None without a monitor."""
    try:
        sent = ask("estop", timeout_s=_SUPERVISOR_S)
        if not sent["ok"] or not sent["listeners"]:
            return False
        if _without_monitor():
            return None
        while time.monotonic() < end_s:
            safety = ask("safety", timeout_s=_SUPERVISOR_S)["safety"]
            if safety and safety["received"] > sent["received"] and safety["emergency"]:
                return True
            time.sleep(_POLL_S)
    except (NotRunning, TimeoutError):
        pass
    return False


def _release_by_supervisor() -> None:
    """Releases the supervisor's own press, if possible; clearing others uses a new node for the reset."""
    with contextlib.suppress(NotRunning, TimeoutError):
        ask("release", timeout_s=_SUPERVISOR_S)


def _reset_by_supervisor() -> tuple[bool, str] | None:
    """(granted, reason), or None if the supervisor cannot call the reset."""
    try:
        if not ask("release", timeout_s=_SUPERVISOR_S)["ok"]:
            return None
        if _without_monitor():
            return True, "released; this machine has no safety monitor that would have to agree"
        answer = ask("reset")
        for _ in range(_RESET_TRIES - 1):
            if not answer["ok"] or answer["granted"]:
                break
            time.sleep(_RESET_PAUSE_S)
            answer = ask("reset")
    except (NotRunning, TimeoutError):
        return None
    return (bool(answer["granted"]), str(answer["reason"])) if answer["ok"] else None


def _without_monitor() -> bool:
    """True if a machine of the motion-engine layer runs without a safety monitor."""
    status = ask("status", timeout_s=_SUPERVISOR_S)
    named = [*status["missing"], *(item["name"] for item in status["processes"])]
    return bool(status["machine"] == System.WMX.value and "safety_monitor" not in named)
