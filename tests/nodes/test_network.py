"""Who is not on this machine can neither command the robot nor hear it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import psutil
import pytest

from robot_stack.contract import topics
from robot_stack.ros import transport
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Peer

SCRIPTS = Path(__file__).parent / "scripts"
Start = Callable[..., NodeProcess]
_ROBOT, _STRANGER = "198.51.100.1", "198.51.100.2"  # RFC 5737: documentation
_FOR_S = 6.0  # 60 announcements
_FIRST_EPHEMERAL = 32768


def _addresses(process: NodeProcess, ports: range) -> set[str]:
    sockets = psutil.Process(process.pid).net_connections("udp")
    return {item.laddr.ip for item in sockets if item.laddr.port in ports}


def _wait_known(peer: Peer, name: str) -> None:
    wait_for(lambda: name in peer.node.get_node_names(), f"{name} in the graph")


@pytest.mark.parametrize("name", ["emergency_stop_button", "camera_driver"])
def test_the_sockets_of_a_process_are_bound_to_this_machine(start: Start, peer: Peer, name: str) -> None:
    process = start(name)
    _wait_known(peer, name)
    assert _addresses(process, range(65536)) == {"127.0.0.1"}


def test_a_process_that_takes_clouds_beside_listens_on_this_machine_alone(start: Start, peer: Peer) -> None:
    """The second participant, with shared memory, sends by sockets of its own that nobody reads."""
    process = start("safety_monitor")
    _wait_known(peer, "_safety_monitor_bulk")
    assert _addresses(process, range(_FIRST_EPHEMERAL)) == {"127.0.0.1"}


@contextmanager
def _another_host() -> Iterator[str]:
    """The name of a network namespace with a cable to this machine."""
    number = os.getpid()
    name, here, there = f"stranger{number}", f"rs{number}a", f"rs{number}b"

    def run(*words: str) -> None:
        subprocess.run(words, check=True, capture_output=True)

    run("ip", "netns", "add", name)
    try:
        run("ip", "link", "add", here, "type", "veth", "peer", "name", there, "netns", name)
        run("ip", "address", "add", f"{_ROBOT}/24", "dev", here)
        run("ip", "link", "set", here, "up")
        run("ip", "-n", name, "address", "add", f"{_STRANGER}/24", "dev", there)
        run("ip", "-n", name, "link", "set", there, "up")
        run("ip", "-n", name, "link", "set", "lo", "up")
        yield name
    finally:
        run("ip", "netns", "delete", name)  # the cable goes with it


@pytest.fixture(scope="module")
def another_host() -> Iterator[str]:
    try:
        with _another_host() as name:
            yield name
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no network namespaces here: {error}")


def _heard_by(host: str) -> str:
    """How many listeners to /emergency_stop and to /cmd_vel a stranger has found, and whether the reset."""
    words = [sys.executable, str(SCRIPTS / "stranger.py"), _ROBOT, str(_FOR_S)]
    done = subprocess.run(
        ["ip", "netns", "exec", host, *words], capture_output=True, text=True, check=True, timeout=60.0
    )
    return done.stdout.strip()


def test_a_stranger_on_the_network_reaches_nothing(another_host: str, start: Start, peer: Peer) -> None:
    for name in ("safety_monitor", "swerve_controller"):
        start(name)
        _wait_known(peer, name)
    heard = peer.listen(topics.EMERGENCY_STOP)
    assert _heard_by(another_host) == "heard by 0 0 0"
    assert not heard.items


def test_a_robot_that_chose_the_network_is_reached(
    another_host: str, start: Start, peer: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the stranger of the other test would prove nothing."""
    monkeypatch.setenv(transport.REACH, "SUBNET")
    monkeypatch.delenv(transport.PROFILE)
    start("safety_monitor")
    _wait_known(peer, "safety_monitor")
    assert _heard_by(another_host) == "heard by 1 1 1"
