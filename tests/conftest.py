"""Fixtures of all tests. A test with nodes uses ``ros_domain``, or a fixture based on it, for its own domain."""

from __future__ import annotations

import random
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants

from tests import skips
from tests.support.domains import held_domain
from tests.support.processes import NodeProcess, node_command

# Every run is identical, because a random failure would only be repeated until it passes. Only launch_scripts/explore
# searches for new counterexamples: it selects its profile and a seed, and stores nothing for the next run. A slow
# machine is no counterexample.
settings.register_profile("repeat", derandomize=True, deadline=None)
settings.register_profile("explore", max_examples=500, deadline=None, print_blob=True, database=None)
settings.load_profile("repeat")
# Hypothesis draws from the constants of all loaded modules of the project. Which are loaded depends on the tests that
# ran before in the same process, and so would the examples.
assert callable(providers._get_local_constants)
providers._get_local_constants = Constants


# A shell that runs the tests in the background ignores SIGINT. Child processes would inherit this and ignore the
# interrupts under test.
signal.signal(signal.SIGINT, signal.default_int_handler)


_SLOW = Path(__file__).with_name("slow.txt")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fast", action="store_true", help=f"leave out the modules that are listed in {_SLOW.name}")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    if not config.getoption("fast"):
        return None
    return str(collection_path.relative_to(_SLOW.parents[1])) in _SLOW.read_text(encoding="utf-8").split() or None


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(skips.OnlyListedSkips(skips.load()))


@pytest.fixture(autouse=True)
def fixed_seeds() -> None:
    """Shared random generators start with the same seed in every run."""
    random.seed(0)
    np.random.seed(0)


@pytest.fixture(scope="session", autouse=True)
def own_data(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test reads the zones and missions that the user made on this computer."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path_factory.mktemp("data")))
        yield


@pytest.fixture
def ros_domain(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[int]:
    """A separate ROS domain and runtime folder for this test, in the environment of its processes."""
    from robot_stack.ros import transport

    with held_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path / "ros_log"))
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
        monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
        runtime = Path(f"/dev/shm/robot_stack_test-{domain}")
        shutil.rmtree(runtime, ignore_errors=True)
        monkeypatch.setenv("ROBOT_STACK_RUNTIME_DIR", str(runtime))
        transport.apply(bulk=True)
        yield domain
        shutil.rmtree(runtime, ignore_errors=True)


@pytest.fixture
def start(ros_domain: int, tmp_path: Path) -> Iterator[Callable[..., NodeProcess]]:
    """``start(name, *ros_args)`` starts a contract process, ``start(command=[...])`` any; the test's end stops them
    all."""
    started: list[NodeProcess] = []

    def start_process(name: str = "process", *ros_args: str, command: list[str] | None = None) -> NodeProcess:
        log = tmp_path / f"{len(started)}-{name}.log"
        started.append(NodeProcess(command or node_command(name, *ros_args), log))
        return started[-1]

    yield start_process
    for process in reversed(started):
        process.stop()


@pytest.fixture
def peer(ros_domain: int) -> Iterator["Peer"]:  # noqa: F821, UP037 - imported late: rclpy reads the environment
    from tests.support.peer import Peer

    peer = Peer()
    yield peer
    peer.close()
