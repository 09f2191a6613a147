"""The environment of a stack that several tests share: its own ROS domain, runtime folder and state folder."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.domains import held_domain


@contextmanager
def stack_environment(folder: Path) -> Iterator[None]:
    """In force while the context lasts. ``folder`` takes logs and state."""
    with held_domain() as domain, pytest.MonkeyPatch.context() as monkeypatch:
        runtime = Path(f"/dev/shm/robot_stack_test-{domain}")
        shutil.rmtree(runtime, ignore_errors=True)
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        monkeypatch.setenv("ROS_LOG_DIR", str(folder / "ros_log"))
        monkeypatch.setenv("XDG_STATE_HOME", str(folder / "state"))
        monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(runtime))
        from robot_stack.ros import transport

        transport.apply(bulk=True)
        yield
        shutil.rmtree(runtime, ignore_errors=True)
