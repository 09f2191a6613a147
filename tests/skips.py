"""A test may be skipped only for a reason listed in ``skips.yaml``: any other skip fails.

Otherwise a test that is skipped on every machine would look like one that passes.
"""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

import pytest
import yaml
from pydantic import BaseModel, ConfigDict, TypeAdapter

_FILE = Path(__file__).with_suffix(".yaml")


class Skip(BaseModel):
    """``test`` and ``reason`` are prefixes of the test's id and reason. ``runs``: where the test runs instead."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    test: str
    reason: str
    runs: str

    def allows(self, test: str, reason: str) -> bool:
        return test.startswith(self.test) and reason.startswith(self.reason)


def load(file: Path = _FILE) -> list[Skip]:
    return TypeAdapter(list[Skip]).validate_python(yaml.safe_load(file.read_text(encoding="utf-8")))


def _judge(report: pytest.TestReport | pytest.CollectReport, rows: list[Skip]) -> None:
    if not report.skipped or hasattr(report, "wasxfail"):
        return
    assert isinstance(report.longrepr, tuple)
    reason = report.longrepr[2].removeprefix("Skipped: ")
    if not any(row.allows(report.nodeid, reason) for row in rows):
        report.outcome = "failed"
        report.longrepr = f"{report.nodeid} is skipped, and no row of {_FILE.name} allows it: {reason}"


class OnlyListedSkips:
    """Plugin that applies the rows of ``skips.yaml``."""

    def __init__(self, rows: list[Skip]) -> None:
        self._rows = rows

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_makereport(self) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        report = yield
        _judge(report, self._rows)
        return report

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_make_collect_report(self) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
        report = yield
        _judge(report, self._rows)
        return report
