"""Fixtures of all tests. A test with nodes uses ``ros_domain``, or a fixture based on it, for its own domain."""

from __future__ import annotations

import os
import random
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants

from tests import skips
from tests.support.environment import restore_environment, stack_environment
from tests.support.processes import Start, started_processes

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


def _is_slow(path: Path) -> bool:
    return str(path.relative_to(_SLOW.parents[1])) in _SLOW.read_text(encoding="utf-8").split()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    return (config.getoption("fast") and _is_slow(collection_path)) or None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Slow modules first, so that no worker is left alone with one at the end."""
    slow = {path for path in {item.path for item in items} if _is_slow(path)}
    items.sort(key=lambda item: item.path not in slow)


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(skips.OnlyListedSkips(skips.load()))


@pytest.fixture(autouse=True)
def fixed_seeds() -> None:
    """Shared random generators start with the same seed in every run."""
    random.seed(0)
    np.random.seed(0)


@pytest.fixture(autouse=True)
def kept_surroundings() -> Iterator[None]:
    """A command that runs in this process leaves neither a DDS profile nor a signal handler to the next test."""
    variables, folder = dict(os.environ), os.getcwd()
    handlers = [(number, signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM)]
    yield
    restore_environment(variables)
    os.chdir(folder)
    for number, handler in handlers:
        signal.signal(number, handler)


@pytest.fixture(scope="session", autouse=True)
def own_data(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test reads the zones and missions that the user made on this computer."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path_factory.mktemp("data")))
        yield


@pytest.fixture
def ros_domain(tmp_path: Path) -> Iterator[int]:
    """A separate ROS domain and runtime folder for this test, in the environment of its processes."""
    with stack_environment(tmp_path) as domain:
        yield domain


@pytest.fixture
def start(ros_domain: int, tmp_path: Path) -> Iterator[Start]:
    """See ``started_processes``."""
    with started_processes(tmp_path) as start:
        yield start


@pytest.fixture
def peer(ros_domain: int) -> Iterator["Peer"]:  # noqa: F821, UP037 - imported late: rclpy reads the environment
    from tests.support.peer import Peer

    peer = Peer()
    yield peer
    peer.close()


# The same for all tests of a module that share their nodes. ``shared_folder`` contains state, data and logs.


@pytest.fixture(scope="module")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A ROS domain and runtime folder in the environment of the module's processes."""
    folder = tmp_path_factory.mktemp("shared")
    with stack_environment(folder):
        yield folder


@pytest.fixture(scope="module")
def shared_start(shared_folder: Path) -> Iterator[Start]:
    with started_processes(shared_folder) as start:
        yield start


@pytest.fixture(scope="module")
def shared_peer(shared_folder: Path) -> Iterator["Peer"]:  # noqa: F821, UP037
    from tests.support.peer import Peer

    peer = Peer()
    yield peer
    peer.close()
