"""Tests on the deterministic scheduler: one process, virtual time, no DDS. The result does not depend on the load."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from pathlib import Path

import pytest

from tests.simulated import shared
from tests.simulated.bench import Bench, open_bench

_REPORT = pytest.StashKey[pytest.TestReport]()


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No test reads or writes the state of the user running it."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


@pytest.fixture
def bench() -> Iterator[Bench]:
    with open_bench() as made:
        yield made


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """A test with a shared begin runs in a fork."""
    marker = pyfuncitem.get_closest_marker("shared")
    if marker is None or shared.is_forked():
        return None
    report = pyfuncitem.stash[_REPORT] = shared.run_forked(pyfuncitem, *marker.args)
    if report.failed:
        raise shared.FailedInFork
    return True


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    made = yield
    report = item.stash.get(_REPORT, None)
    if report is None or call.when != "call" or shared.is_forked():
        return made
    report.duration = made.duration
    return report


def pytest_sessionfinish() -> None:
    shared.close_all()
