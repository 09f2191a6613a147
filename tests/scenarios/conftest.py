"""One stack per module, put right before every test: a start takes longer than most stories."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.support.domains import held_domain

if TYPE_CHECKING:
    from tests.support.stack import StackUnderTest


@pytest.fixture(scope="module")
def module_stack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StackUnderTest]:
    folder = tmp_path_factory.mktemp("stack")
    with held_domain() as domain, pytest.MonkeyPatch.context() as monkeypatch:
        runtime = Path(f"/dev/shm/robot_stack_test-{domain}")
        shutil.rmtree(runtime, ignore_errors=True)
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        monkeypatch.setenv("ROS_LOG_DIR", str(folder / "ros_log"))
        monkeypatch.setenv("XDG_STATE_HOME", str(folder / "state"))
        monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(runtime))
        from robot_stack.ros import transport
        from tests.support.stack import StackUnderTest

        transport.apply()
        stack = StackUnderTest(folder / "logs", "sim_world.world=flat")
        yield stack
        stack.close()
        shutil.rmtree(runtime, ignore_errors=True)


@pytest.fixture
def stack(module_stack: StackUnderTest) -> StackUnderTest:
    module_stack.make_ready()
    return module_stack
