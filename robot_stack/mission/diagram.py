"""Draws the table of transitions: ``python -m robot_stack.mission.diagram > docs/mission_states.md``."""

from __future__ import annotations

from robot_stack.mission.states import TRANSITIONS, State, Trigger

_MEANING = {
    State.IDLE: "no mission",
    State.RUNNING: "driving to a waypoint; the only state in which goals are sent",
    State.WAITING: "standing at a waypoint for its waiting time, or at the end of an open route for its next part",
    State.DOCKING: "at a waypoint, the docking controller docks; shown as RUNNING in `/mission/status`, with the "
    "progress as the reason",
    State.UNDOCKING: "likewise, while it undocks",
    State.PAUSED: "standing until RESUME",
    State.STOPPED: "standing after an emergency stop, until its release, a reset and RESUME; "
    "shown as PAUSED in `/mission/status`, with the reason",
    State.COMPLETED: "the last waypoint was reached",
    State.ABORTED: "ended by ABORT; a passenger stays attached",
    State.FAILED: "ended by a failure, named by the reason",
}


def document() -> str:
    """The page: a diagram and the same as tables."""
    return "\n".join(
        [
            "# States of the mission manager",
            "",
            "Generated from `robot_stack/mission/states.py`; do not edit. To regenerate it:",
            "`python -m robot_stack.mission.diagram > docs/mission_states.md`.",
            "",
            "```mermaid",
            "stateDiagram-v2",
            "    [*] --> IDLE",
            *(f"    {row.source.value} --> {row.target.value}: {row.trigger.value}" for row in TRANSITIONS),
            "```",
            "",
            "| state | meaning |",
            "|---|---|",
            *(f"| {state.value} | {_MEANING[state]} |" for state in State),
            "",
            "| trigger | from | to |",
            "|---|---|---|",
            *(_trigger_row(trigger) for trigger in Trigger),
            "",
        ]
    )


def _trigger_row(trigger: Trigger) -> str:
    rows = [row for row in TRANSITIONS if row.trigger is trigger]
    targets = sorted({row.target.value for row in rows})
    return f"| {trigger.value} | {', '.join(row.source.value for row in rows)} | {', '.join(targets)} |"


if __name__ == "__main__":
    print(document(), end="")
