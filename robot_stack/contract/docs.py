"""``docs/interfaces.md`` from the contract's rows: ``python -m robot_stack.contract.docs`` writes it."""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from robot_stack.contract import topics
from robot_stack.contract.actions import ACTIONS
from robot_stack.contract.faults import FAULTS
from robot_stack.contract.model import EVERY_NODE, Action, Process, Service, System, Topic
from robot_stack.contract.processes import PROCESSES
from robot_stack.contract.services import SERVICES

PATH = Path(__file__).resolve().parents[2] / "docs" / "interfaces.md"

_SYSTEMS = {
    System.ROBOT: "Robot",
    System.WMX: "WMX layer",
    System.SIMULATION: "Simulation",
}
_HEAD = """\
# Interfaces

Generated from the rows of `robot_stack/contract/` by `python -m robot_stack.contract.docs`: change a row, run it,
commit both. `robot-stack topics` compares the same rows with a running system.

- Names, types and QoS hold for publisher and subscribers alike; history is always KEEP_LAST of the given depth.
- *Rate* is that of each publisher; *event* topics are sent on change. *Stale* is the age after which a subscriber
  treats its newest message as missing.
- *Wakes* are the subscribers that a message wakes at once; the others process it at their next tick.
- A row names exactly the nodes with an endpoint; one with an asterisk has it only in some situations or configurations.
- *every node* is every process of the table at the end. *{outside}* are tools and operators outside that table.
- Fields, units, frames and ranges are described in the message definitions: `custom_msgs/`, `wmx_ros2_message/`.
- The robot and the WMX layer share the names `/joint_states` and `/cmd_vel`; a profile runs one machine, never both.
"""


def render() -> str:
    """The whole document."""
    parts = [_HEAD.format(outside=", ".join(topics.OUTSIDE))]
    for system, title in _SYSTEMS.items():
        parts.append(f"## {title}: topics\n\n{_topics(topics.of_system(system))}")
        served = [row for row in SERVICES if row.system is system]
        if served:
            parts.append(f"## {title}: services\n\n{_endpoints(served)}")
        acted = [row for row in ACTIONS if row.system is system]
        if acted:
            parts.append(f"## {title}: actions\n\n{_actions(acted)}")
    parts.append(f"## Faults\n\n{_FAULTS_HEAD}\n\n{_faults()}")
    parts.append(f"## Processes\n\n{_PROCESSES_HEAD}\n\n{_processes(PROCESSES)}")
    return "\n".join(parts)


_FAULTS_HEAD = """\
The closed list of the safety monitor. Of all active faults, the most severe action applies; of several limits, the
lowest. Thresholds are parameters in `config/safety_monitor.yaml`; the numbers here are their defaults."""
_PROCESSES_HEAD = """\
One operating-system process per row; `config/profiles/` defines which run together. If a *critical* process ends, the
robot stops; if a *limiting* one ends, it drives slowly; the loss of an *optional* one is reported. A process without a
module is specified but not built."""


def _topics(rows: Sequence[Topic]) -> str:
    return _table(
        ("topic", "type", "QoS", "rate", "stale", "publishers", "subscribers", "wakes", "description"),
        (
            (
                f"`{row.name}`",
                f"`{row.type}`",
                row.qos.describe(),
                "event" if row.rate_hz is None else f"{row.rate_hz:g} Hz",
                "-" if row.stale_s is None else f"{row.stale_s:g} s",
                _nodes(row.publishers, row.sometimes),
                _nodes(row.subscribers, row.sometimes),
                _nodes(row.wakes),
                row.note,
            )
            for row in rows
        ),
    )


def _endpoints(rows: Iterable[Service]) -> str:
    cells = ((f"`{row.name}`", f"`{row.type}`", row.server, row.note) for row in rows)
    return _table(("name", "type", "server", "description"), cells)


def _actions(rows: Iterable[Action]) -> str:
    cells = ((f"`{row.name}`", f"`{row.type}`", row.server, _nodes(row.clients), row.note) for row in rows)
    return _table(("name", "type", "server", "clients", "description"), cells)


def _faults() -> str:
    return _table(
        ("code", "raised when", "action", "state", "clears"),
        (
            (
                f"`{row.code}`",
                row.raised_when,
                row.action.name,
                row.state.name,
                row.clears.value + (f" for {row.clear_after_s:g} s" if row.clear_after_s else ""),
            )
            for row in FAULTS
        ),
    )


def _processes(rows: Sequence[Process]) -> str:
    return _table(
        ("process", "machine", "criticality", "nodes", "module", "description"),
        (
            (
                f"`{row.name}`",
                row.system.value,
                row.criticality.value,
                ", ".join(row.nodes),
                f"`{row.module}`" if row.module else "not built",
                row.note,
            )
            for row in rows
        ),
    )


def _nodes(names: Iterable[str], sometimes: Collection[str] = ()) -> str:
    shown = {name: "every node" if name == EVERY_NODE else name for name in names}
    return ", ".join(f"{text}*" if name in sometimes else text for name, text in shown.items()) or "-"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def main() -> None:
    PATH.parent.mkdir(exist_ok=True)
    PATH.write_text(render(), encoding="utf-8")
    print(f"wrote {PATH}", file=sys.stderr)


if __name__ == "__main__":
    main()
