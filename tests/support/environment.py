"""The environment of a test's processes: a separate ROS domain, runtime folder and state folder."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.domains import held_domain
from tests.support.processes import ROOT


def restore_environment(variables: Mapping[str, str]) -> None:
    for name in os.environ.keys() - variables.keys():
        del os.environ[name]
    os.environ.update(dict(variables.items() - os.environ.items()))


@contextmanager
def own_config(folder: Path, **missions: str) -> Iterator[Path]:
    """A copy of the configuration in ``folder``, active within the context. missions: texts of additional missions."""
    config = shutil.copytree(ROOT / "config", folder / "config")
    for name, text in missions.items():
        (config / "missions" / f"{name}.yaml").write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("ROBOT_STACK_CONFIG", str(config))
        yield config


@contextmanager
def stack_environment(folder: Path) -> Iterator[int]:
    """Yields the ROS domain; active within the context. ``folder`` contains logs and state."""
    with held_domain() as domain, pytest.MonkeyPatch.context() as monkeypatch:
        runtime = Path(f"/dev/shm/robot_stack_test-{domain}")
        shutil.rmtree(runtime, ignore_errors=True)
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_LOG_DIR", str(folder / "ros_log"))
        monkeypatch.setenv("XDG_STATE_HOME", str(folder / "state"))
        monkeypatch.setenv("XDG_DATA_HOME", str(folder / "data"))
        monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(runtime))
        from robot_stack.ros import transport

        # Not from the environment: an earlier test may have left the profile of another configuration folder in it.
        settings = {transport.REACH: "LOCALHOST"}
        transport.apply(settings, bulk=True)
        for name, value in settings.items():
            monkeypatch.setenv(name, value)
        yield domain
        shutil.rmtree(runtime, ignore_errors=True)
