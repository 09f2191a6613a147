"""The robot's connection, with a real broker: last will, session, loss, certificates, floods."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from robot_stack.cli.fleet_site import Files, Site
from robot_stack.fleet.link import Connected, Disconnected, LinkEvent, Received, Topic
from robot_stack.fleet.nodes.mqtt_link import BackOff, Inbox, MqttLink
from tests.support.fleet.broker import Peer, RunningBroker, running_broker
from tests.support.fleet.network import Network
from tests.support.waiting import wait_for

PREFIX = "uagv/v2/maker/A1"
FAST: dict[str, Any] = {"first_back_off_s": 0.05, "longest_back_off_s": 0.2, "check_files_s": 0.05}


class Robot:
    """A link whose events are collected."""

    def __init__(self, link: MqttLink) -> None:
        self.link = link
        self.events: list[LinkEvent] = []

    def wait_for(self, event: LinkEvent, after: int = 0) -> None:
        def arrived() -> bool:
            self.events += self.link.receive()
            return event in self.events[after:]

        wait_for(arrived, f"{event}, received {self.events}, {self.link.state}")

    def wait_for_loss(self, words: str, after: int = 0) -> None:
        def lost() -> bool:
            self.events += self.link.receive()
            return any(isinstance(item, Disconnected) and words in item.reason for item in self.events[after:])

        wait_for(lost, f"a loss with {words!r}, received {self.events}, {self.link.state}")


class Site1:
    """A broker with robots A1 and B2 and one fleet manager, and a network before it."""

    def __init__(self, broker: RunningBroker, stack: ExitStack) -> None:
        self.broker, self._stack = broker, stack
        self.files = broker.site.add_robot("A1")
        self.network = Network(broker.port)
        stack.callback(self.network.close)

    def master(self) -> Peer:
        peer = Peer(self.broker.params(self.broker.site.master()), "manager").connected()
        self._stack.callback(peer.close)
        return peer

    def robot(self, files: Files | None = None, **others: Any) -> Robot:
        url = f"mqtts://localhost:{self.network.port}"
        numbers = itertools.count()
        link = MqttLink(
            self.broker.params(files or self.files, url, **{**FAST, **others}),
            "A1",
            PREFIX,
            online=lambda: b"ONLINE %d" % next(numbers),
            offline=lambda: b"OFFLINE",
            will=lambda: b"CONNECTIONBROKEN",
        )
        self._stack.callback(link.close)
        return Robot(link)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site1]:
    with running_broker(tmp_path / "site") as broker, ExitStack() as stack:
        yield Site1(broker, stack)


def order(number: int) -> Received:
    return Received(Topic.ORDER, f"order {number}".encode())


@pytest.mark.parametrize("protocol", ["3.1.1", "5"])
def test_messages_pass_in_both_directions(site: Site1, protocol: str) -> None:
    master = site.master().subscribe()
    robot = site.robot(protocol=protocol)
    robot.wait_for(Connected(session_present=False))
    for topic in (Topic.STATE, Topic.VISUALIZATION, Topic.FACTSHEET):
        robot.link.send(topic, topic.encode())
        wait_for(lambda topic=topic: master.payloads(f"{PREFIX}/{topic}") == [topic], topic)
    wait_for(lambda: master.payloads(f"{PREFIX}/connection") == ["ONLINE 0"], "online")
    master.publish(f"{PREFIX}/order", "order 1")
    master.publish(f"{PREFIX}/instantActions", "stop", qos=0)
    robot.wait_for(order(1))
    robot.wait_for(Received(Topic.INSTANT_ACTIONS, b"stop"))
    assert "is open" in robot.link.state
    # Who comes later receives connection and factsheet, and no old state.
    late = Peer(site.broker.params(site.broker.site.master()), "late").connected().subscribe()
    wait_for(lambda: len(late.received) >= 2, "retained messages")
    retained = {(f"{PREFIX}/connection", "ONLINE 0", True), (f"{PREFIX}/factsheet", "factsheet", True)}
    assert set(late.received) == retained
    late.close()


def test_retained_orders_are_ignored(site: Site1) -> None:
    """The broker sends them again at each connection, after their order and others have long ended."""
    master = site.master()
    master.publish(f"{PREFIX}/order", "order 1", retain=True)
    robot = site.robot()
    robot.wait_for(Connected(session_present=False))
    master.publish(f"{PREFIX}/order", "order 2")
    robot.wait_for(order(2))
    assert [event for event in robot.events if isinstance(event, Received)] == [order(2)]
    assert robot.link.dropped == {"retained": 1}


def test_close_announces_it(site: Site1) -> None:
    master = site.master().subscribe(f"{PREFIX}/connection")
    robot = site.robot()
    robot.wait_for(Connected(session_present=False))
    robot.link.close()
    wait_for(lambda: len(master.payloads(f"{PREFIX}/connection")) >= 2, "farewell")
    assert master.payloads(f"{PREFIX}/connection") == ["ONLINE 0", "OFFLINE"]


@pytest.mark.parametrize("protocol", ["3.1.1", "5"])
def test_cut_connection_leaves_the_last_will_and_finds_its_messages(site: Site1, protocol: str) -> None:
    master = site.master().subscribe(f"{PREFIX}/connection")
    robot = site.robot(protocol=protocol)
    robot.wait_for(Connected(session_present=False))
    wait_for(lambda: master.payloads(f"{PREFIX}/connection") == ["ONLINE 0"], "online")
    site.network.cut()
    wait_for(lambda: master.payloads(f"{PREFIX}/connection") == ["ONLINE 0", "CONNECTIONBROKEN"], "last will")
    robot.wait_for_loss("lost the connection")
    master.publish(f"{PREFIX}/order", "order 1", qos=0)  # as VDA 5050 has it
    master.publish(f"{PREFIX}/order", "order 2", qos=1)
    robot.link.send(Topic.STATE, b"state 1")
    robot.link.send(Topic.STATE, b"state 2")
    master.subscribe(f"{PREFIX}/state")
    site.network.restore()
    robot.wait_for(Connected(session_present=True))
    robot.wait_for(order(2))
    assert [event for event in robot.events if isinstance(event, Received)] == [order(1), order(2)]
    wait_for(lambda: master.payloads(f"{PREFIX}/state"), "state")
    assert master.payloads(f"{PREFIX}/state") == ["state 2"], "only the newest waits"
    assert master.payloads(f"{PREFIX}/connection")[-1] == "ONLINE 1"


def test_killed_broker_is_found_again(site: Site1) -> None:
    robot = site.robot()
    robot.wait_for(Connected(session_present=False))
    site.broker.kill()
    robot.wait_for_loss("lost the connection")
    seen = len(robot.events)
    site.broker.start()
    robot.wait_for(Connected(session_present=False), after=seen)
    site.master().publish(f"{PREFIX}/order", "order 1")
    robot.wait_for(order(1))


def test_certificate_is_rotated_without_restart(site: Site1, tmp_path: Path) -> None:
    robot = site.robot()
    robot.wait_for(Connected(session_present=False))
    old = {path: path.read_bytes() for path in (site.files.certificate, site.files.key)}
    site.broker.site.add_robot("A1", again=True)
    robot.wait_for_loss("new certificates")
    robot.wait_for(Connected(session_present=True))
    assert site.files.key.read_bytes() != old[site.files.key]
    # A certificate of another authority is read, too, and rejected.
    seen = len(robot.events)
    stranger = Site(tmp_path / "stranger")
    stranger.prepare(1, local=False, names=["localhost"])
    foreign = stranger.add_robot("A1")
    good = site.files.certificate.read_bytes(), site.files.key.read_bytes()
    shutil.copy(foreign.certificate, site.files.certificate)
    shutil.copy(foreign.key, site.files.key)
    robot.wait_for_loss("does not accept", after=seen)
    seen = len(robot.events)
    site.files.certificate.write_bytes(good[0])
    site.files.key.write_bytes(good[1])
    robot.wait_for(Connected(session_present=True), after=seen)


def test_half_replaced_certificate_keeps_the_connection(site: Site1) -> None:
    looked: list[bool] = []
    robot = site.robot()
    robot.wait_for(Connected(session_present=False))
    usable = robot.link._usable
    robot.link._usable = lambda: looked.append(usable()) or looked[-1]  # type: ignore[method-assign]
    site.files.key.write_bytes(site.broker.site.master().key.read_bytes())  # does not belong to the certificate
    wait_for(lambda: len(looked) > 3, "looks at the files")
    assert not any(looked)
    assert robot.link.receive() == ()


def test_first_connection_fails_with_its_reason(site: Site1, tmp_path: Path) -> None:
    stranger = Site(tmp_path / "stranger")
    stranger.prepare(1, local=False, names=["localhost"])
    foreign = stranger.add_robot("A1")
    untrusting = Files(foreign.ca, site.files.certificate, site.files.key)
    site.robot(untrusting).wait_for_loss("the broker's certificate is not trusted")
    missing = Files(site.files.ca, tmp_path / "none.crt", site.files.key)
    site.robot(missing).wait_for_loss("none.crt")
    site.broker.kill()
    robot = site.robot()
    robot.wait_for_loss("")
    assert not any(isinstance(event, Connected) for event in robot.events)


def test_certificate_of_another_robot_is_reported_by_protocol_5(site: Site1) -> None:
    """With 3.1.1, the broker drops the messages silently."""
    robot = site.robot(site.broker.site.add_robot("B2"), protocol="5")
    robot.wait_for_loss("refuses a message of A1: Not authorized")


def test_flood_is_bounded_and_displaces_no_other_topic(site: Site1) -> None:
    master = site.master()
    robot = site.robot(queue_messages=8)
    robot.wait_for(Connected(session_present=False))
    master.publish(f"{PREFIX}/instantActions", "stop")
    for number in range(300):
        master.publish(f"{PREFIX}/order", f"order {number}")
        if number % 50 == 49:  # the broker's own queue for the robot has a limit, too
            wait_for(lambda sent=number + 1: robot.link.dropped.get("flood") == sent - 8, f"{number + 1} orders")
    expected = [Received(Topic.INSTANT_ACTIONS, b"stop"), *(order(number) for number in range(292, 300))]
    assert list(robot.link.receive()) == expected


@pytest.mark.parametrize(("protocol", "counted"), [("3.1.1", {"too long": 1}), ("5", {})])
def test_too_long_messages_are_dropped(site: Site1, protocol: str, counted: dict[str, int]) -> None:
    """With protocol 5, the broker does not even send them."""
    master = site.master()
    robot = site.robot(protocol=protocol, longest_message_bytes=1024)
    robot.wait_for(Connected(session_present=False))
    for payload in ("x" * 1024, "x" * 20_000, "order 1"):
        master.publish(f"{PREFIX}/order", payload)
    robot.wait_for(order(1))
    assert [len(event.payload) for event in robot.events if isinstance(event, Received)] == [1024, len(b"order 1")]
    assert robot.link.dropped == counted


def test_password_and_plain_connection(tmp_path: Path) -> None:
    """An existing broker may know users instead of certificates."""
    with running_broker(tmp_path / "site", local=True) as broker, ExitStack() as stack:
        password = tmp_path / "password"
        password.write_text("secret\n")
        wrong = {"user_name": "robot", "password_file": str(tmp_path / "none")}
        for others, check in (
            ({"user_name": "robot", "password_file": str(password)}, lambda r: r.wait_for(Connected(False))),
            (wrong, lambda r: r.wait_for_loss("none cannot be read")),
        ):
            link = MqttLink(
                broker.params(**FAST, **others), "A1", PREFIX, lambda: b"on", lambda: b"off", lambda: b"broken"
            )
            stack.callback(link.close)
            check(Robot(link))
            assert "secret" not in link.state


def test_back_off_doubles_with_jitter() -> None:
    def pauses(seed: str) -> list[float]:
        back_off = BackOff(1.0, 30.0, seed)
        return [back_off.next_s() for _ in range(8)]

    for pause_s, whole_s in zip(pauses("A1"), [1, 2, 4, 8, 16, 30, 30, 30], strict=True):
        assert 0.5 * whole_s <= pause_s <= whole_s
    assert pauses("A1") == pauses("A1") != pauses("B2")
    back_off = BackOff(1.0, 30.0, "A1")
    for _ in range(5):
        back_off.next_s()
    back_off.reset()
    assert back_off.next_s() <= 1.0


def test_inbox_bounds_each_kind() -> None:
    inbox = Inbox(2)
    for event in (
        Connected(False),
        order(1),
        Disconnected("a"),
        order(2),
        order(3),
        Received(Topic.INSTANT_ACTIONS, b""),
    ):
        inbox.put(event)
    assert inbox.take() == (
        Connected(False),
        Disconnected("a"),
        order(2),
        order(3),
        Received(Topic.INSTANT_ACTIONS, b""),
    )
    assert inbox.dropped == {"flood": 1}
    assert inbox.take() == ()
    for event in (order(4), order(5)):
        inbox.put(event)
    assert inbox.take() == (order(4), order(5))
