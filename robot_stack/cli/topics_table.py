"""The output of ``robot-stack topics``."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Group

from robot_stack.cli.tables import Column, notes, table
from robot_stack.system_monitor.topic_check import Finding

_COLUMNS: tuple[Column, ...] = (
    ("topic", "left"),
    ("rate", "right"),
    ("age", "right"),
    ("publishers", "left"),
    ("", "left"),
)
_STYLES = {"ok": "", "quiet": "", "not run": "dim", "wrong": "red"}


def topics_table(profile: str, findings: Sequence[Finding], unknown: Sequence[str]) -> Group:
    """The contract's topics, and below them the deviations. unknown: topics outside the contract."""
    shown = table(f"topics, profile {profile}", _COLUMNS)
    for finding in findings:
        shown.add_row(*_cells(finding), style=_STYLES[finding.verdict.value])
    wrong = [(finding.row.name, "; ".join(finding.problems)) for finding in findings if finding.problems]
    strangers = [(name, "not in the contract") for name in unknown]
    count = f"{len(wrong)} topics differ from the contract" if wrong else "as in the contract"
    return Group(shown, notes([*wrong, *strangers], "red"), count)


def _cells(finding: Finding) -> list[str]:
    publishers = sorted({endpoint.node for endpoint in finding.seen.publishers})
    age_s = finding.seen.traffic.age_s
    return [
        finding.row.name,
        _rate(finding),
        "-" if age_s is None else f"{age_s:.2f} s",
        "\n".join(publishers) if len(publishers) < 3 else f"{len(publishers)} nodes",
        finding.verdict.value,
    ]


def _rate(finding: Finding) -> str:
    """The measured rate and the contract's."""
    measured = "-" if finding.seen.traffic.age_s is None else f"{finding.seen.traffic.rate_hz:.1f}"
    return "event" if finding.expected_hz is None else f"{measured} of {finding.expected_hz:g} Hz"
