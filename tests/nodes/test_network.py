"""Neither another computer nor another user of this computer can command the robot or read its topics."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import psutil
import pytest

from robot_stack.contract import topics
from robot_stack.ros import transport
from tests.support.other_host import OtherHost, other_host
from tests.support.processes import NodeProcess, Start, node_command
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Peer

SCRIPTS = Path(__file__).parent / "scripts"
_FOR_S = 6.0  # 60 announcements
_LONGEST_S = 60.0  # ends with the discovery
_FIRST_EPHEMERAL = 32768
_RULES = Path(__file__).parents[2] / "launch_scripts" / "robot-stack.nft"
_ROBOT_UID, _SCREEN_UID, _OTHER_UID = "4711", "4712", "65534"
_PAGE = 8460


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
    """The second participant, with shared memory, sends through its own sockets, which receive nothing."""
    process = start("safety_monitor")
    _wait_known(peer, "_safety_monitor_bulk")
    assert _addresses(process, range(_FIRST_EPHEMERAL)) == {"127.0.0.1"}


@pytest.fixture(scope="module")
def another_host() -> Iterator[OtherHost]:
    yield from _host()


def _host(*shaping: str) -> Iterator[OtherHost]:
    try:
        with other_host(shaping) as host:
            yield host
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no network namespaces here: {error}")


def _discovered_by(host: OtherHost, for_s: float) -> str:
    """Number of subscribers to /emergency_stop and to /cmd_vel found from the host, and 1 if the reset was found."""
    return _in_namespace(host.name, sys.executable, str(SCRIPTS / "stranger.py"), host.address, str(for_s))


def _in_namespace(name: str, *words: str) -> str:
    done = subprocess.run(
        ["ip", "netns", "exec", name, *words], capture_output=True, text=True, check=True, timeout=120.0
    )
    return done.stdout.strip()


def test_a_stranger_on_the_network_reaches_nothing(another_host: OtherHost, start: Start, peer: Peer) -> None:
    for name in ("safety_monitor", "swerve_controller"):
        start(name)
        _wait_known(peer, name)
    received = peer.listen(topics.EMERGENCY_STOP)
    assert _discovered_by(another_host, _FOR_S) == "discovered by 0 0 0"
    assert not received.items


def test_a_robot_that_chose_the_network_is_reached(
    another_host: OtherHost, start: Start, peer: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Validates the foreign participant of the other test."""
    monkeypatch.setenv(transport.REACH, "SUBNET")
    monkeypatch.delenv(transport.PROFILE)
    start("safety_monitor")
    _wait_known(peer, "safety_monitor")
    assert _discovered_by(another_host, _LONGEST_S) == "discovered by 1 1 1"


@pytest.fixture
def slow_host() -> Iterator[OtherHost]:
    """Its link needs 8 min for what the test publishes."""
    yield from _host("tbf", "rate", "1mbit", "burst", "32kb", "limit", "2mb")


def test_a_slow_link_to_another_computer_holds_no_publisher(
    slow_host: OtherHost, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(transport.REACH, "SUBNET")
    monkeypatch.delenv(transport.PROFILE, raising=False)
    command = [sys.executable, str(SCRIPTS / "slow_link.py")]
    with subprocess.Popen(["ip", "netns", "exec", slow_host.name, *command, "receive"]) as subscriber:
        try:
            done = subprocess.run([*command, "send"], capture_output=True, text=True, check=True, timeout=120.0)
        finally:
            subscriber.kill()
    assert done.stdout == "sent\n"


@pytest.fixture
def own_network(ros_domain: int) -> Iterator[str]:
    """Name of a network namespace with the service's rules for this test's ROS domain."""
    if shutil.which("nft") is None:
        pytest.skip("no nft on this machine: install the package nftables")
    name = f"robot{os.getpid()}"
    first = 7400 + 250 * ros_domain
    users = {"robot": _ROBOT_UID, "screen": _SCREEN_UID}
    defined = {**users, "ports": f"{first}-{first + 249}", "pages": f"{_PAGE}-{_PAGE + 19}"}
    rules = [word for key, value in defined.items() for word in ("-D", f"{key}={value}")] + ["-f", str(_RULES)]
    try:
        subprocess.run(["ip", "netns", "add", name], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no network namespaces here: {error}")
    try:
        _in_namespace(name, "ip", "link", "set", "lo", "up")
        _in_namespace(name, "nft", *rules)
        yield name
    finally:
        subprocess.run(["ip", "netns", "delete", name], check=True)


def _as_user(network: str, uid: str, *words: str) -> str:
    """Output of a program run as a user on the robot's computer. The capability permits reading this Python's files."""
    user = ["setpriv", f"--reuid={uid}", f"--regid={uid}", "--clear-groups"]
    rights = ["--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"]
    return _in_namespace(network, *user, *rights, sys.executable, *words)


def _discovered_by_user(network: str, uid: str, for_s: float) -> str:
    return _as_user(network, uid, str(SCRIPTS / "stranger.py"), "127.0.0.1", str(for_s))


def test_another_user_of_this_machine_reaches_nothing(own_network: str) -> None:
    words = ["ip", "netns", "exec", own_network, *node_command("safety_monitor")]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as monitor:
        try:
            assert _discovered_by_user(own_network, _ROBOT_UID, _LONGEST_S) == "discovered by 1 1 1"
            assert _discovered_by_user(own_network, _OTHER_UID, _FOR_S) == "discovered by 0 0 0"
        finally:
            monitor.terminate()


_SERVE = (
    f"import socket; s = socket.create_server(('127.0.0.1', {_PAGE})); print('up', flush=True); s.accept(); input()"
)
_CONNECT = f"""
import socket
try:
    socket.create_connection(("127.0.0.1", {_PAGE}), 5.0)
    print("connected")
except OSError as error:
    print(error.strerror)
"""


def test_only_the_screens_user_opens_the_touch_screen(own_network: str) -> None:
    """A program can send any Origin header, and rides start without a PIN."""
    words = ["ip", "netns", "exec", own_network, sys.executable, "-c", _SERVE]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        assert server.stdout.readline() == "up\n"
        try:
            assert _as_user(own_network, _OTHER_UID, "-c", _CONNECT) == "Connection refused"
            assert _as_user(own_network, _SCREEN_UID, "-c", _CONNECT) == "connected"
        finally:
            server.terminate()
