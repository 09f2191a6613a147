"""The broker of ``fleet up``: what its rules allow a robot, with a real broker."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from robot_stack.cli import fleet_site
from robot_stack.cli.errors import CommandError
from robot_stack.cli.fleet_site import MASTER, Site, default_folder, mosquitto
from tests.support.fleet.broker import Peer, RunningBroker, running_broker
from tests.support.waiting import wait_for

A, B = "uagv/v2/maker/A1", "uagv/v2/maker/B2"


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningBroker]:
    with running_broker(tmp_path_factory.mktemp("fleet") / "site") as running:
        for serial in ("A1", "B2"):
            running.site.add_robot(serial)
        yield running


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as opened:
        yield opened


def robot(broker: RunningBroker, stack: ExitStack, serial: str, client_id: str = "", **others: Any) -> Peer:
    peer = Peer(broker.params(broker.site.robot(serial)), client_id or serial, **others).connected()
    stack.callback(peer.close)
    return peer


def master(broker: RunningBroker, stack: ExitStack, client_id: str = "manager") -> Peer:
    peer = Peer(broker.params(broker.site.master()), client_id).connected()
    stack.callback(peer.close)
    return peer


ALLOWED = [f"{A}/{topic}" for topic in ("state", "visualization", "connection", "factsheet")]
FORBIDDEN = [
    *(f"{B}/{topic}" for topic in ("state", "visualization", "connection", "factsheet", "order", "instantActions")),
    *(f"{A}/{topic}" for topic in ("order", "instantActions", "zoneSet", "responses", "else")),
    "uagv/v2/A1/state",
    "uagv/v2/maker/A1/state/more",
    "else",
]


def test_robot_publishes_for_itself_alone(broker: RunningBroker, stack: ExitStack) -> None:
    reader, other, sender = master(broker, stack).subscribe(), robot(broker, stack, "B2"), robot(broker, stack, "A1")
    other.subscribe()
    for topic in [*FORBIDDEN, *ALLOWED]:  # in this order: when the last has arrived, the others would have
        sender.publish(topic, topic)
    wait_for(lambda: reader.payloads(ALLOWED[-1]), "own messages")
    assert [topic for topic, _, _ in reader.received] == ALLOWED
    assert other.received == []


def test_robot_reads_its_own_orders_alone(broker: RunningBroker, stack: ExitStack) -> None:
    sender, spy, addressee = master(broker, stack), robot(broker, stack, "A1"), robot(broker, stack, "B2")
    for peer, topics in ((spy, ("#", f"{B}/order", "+/+/+/+/instantActions")), (addressee, (f"{B}/+",))):
        for topic in topics:
            peer.subscribe(topic)
    for topic in (f"{B}/order", f"{B}/instantActions", f"{A}/order"):
        sender.publish(topic, topic)
    wait_for(lambda: spy.payloads(f"{A}/order"), "its own order")
    wait_for(lambda: len(addressee.received) >= 2, "the other's orders")
    assert {topic for topic, _, _ in spy.received} == {f"{A}/order"}
    assert [topic for topic, _, _ in addressee.received] == [f"{B}/order", f"{B}/instantActions"]


def test_robot_cannot_take_the_session_of_another(broker: RunningBroker, stack: ExitStack) -> None:
    victim = robot(broker, stack, "B2")
    victim.subscribe(f"{B}/order")
    thief = robot(broker, stack, "A1", client_id="B2")
    master(broker, stack).publish(f"{B}/order", "order")
    wait_for(lambda: victim.payloads(f"{B}/order") == ["order"], "order of the connected robot")
    assert thief.received == []


def test_last_will_for_another_robot_is_not_published(broker: RunningBroker, stack: ExitStack) -> None:
    reader = master(broker, stack).subscribe("+/+/+/+/connection")
    Peer(broker.params(broker.site.robot("A1")), "A1", will=(f"{B}/connection", "forged")).connected().cut()
    Peer(broker.params(broker.site.robot("A1")), "A1", will=(f"{A}/connection", "broken")).connected().cut()
    wait_for(lambda: "broken" in reader.payloads(f"{A}/connection"), "its own last will")
    assert "forged" not in reader.payloads(f"{B}/connection")


def test_manager_publishes_no_state(broker: RunningBroker, stack: ExitStack) -> None:
    reader, sender = master(broker, stack, "reader").subscribe(), master(broker, stack, "sender")
    for topic in (f"{A}/state", f"{A}/connection", f"{A}/order"):
        sender.publish(topic, "by the manager")
    wait_for(lambda: reader.payloads(f"{A}/order"), "order")
    assert f"{A}/state" not in [topic for topic, _, _ in reader.received]
    assert "by the manager" not in reader.payloads(f"{A}/connection")


def test_ports_accept_their_own_kind_of_certificate(broker: RunningBroker, tmp_path: Path) -> None:
    """A robot's certificate that names the manager would otherwise give a robot the manager's rights."""
    site = broker.site
    stranger = Site(tmp_path / "stranger")
    stranger.prepare(1, local=False, names=["localhost"])
    stranger.add_robot("A1")
    foreign = stranger.robot("A1")
    for files, url in (
        (site.robot("A1"), site.master_url()),
        (site.master(), site.robot_url()),
        (type(foreign)(site.robot("A1").ca, foreign.certificate, foreign.key), site.robot_url()),
    ):
        with ExitStack() as stack:
            peer = Peer(broker.params(files, url), "A1")
            stack.callback(peer.close)
            wait_for(lambda peer=peer: peer.errors, f"rejection of {files.certificate} at {url}")
            assert "does not accept" in peer.errors[0]


def test_files_are_private(broker: RunningBroker) -> None:
    for path in broker.site.folder.rglob("*"):
        if path.name != "log":
            mode = stat.S_IMODE(path.stat().st_mode)
            assert mode & 0o077 == 0 or path.is_dir(), path
    assert stat.S_IMODE(broker.site.folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("serial", ["", "a/b", "+", "#", "ä", "a b", "..", "x" * 65, MASTER + "/x"])
def test_wrong_serial_numbers_are_rejected(broker: RunningBroker, serial: str) -> None:
    with pytest.raises(CommandError, match="no serial number of VDA 5050"):
        broker.site.add_robot(serial)


def test_robot_named_as_the_manager_has_no_rights_of_it(broker: RunningBroker, stack: ExitStack) -> None:
    with pytest.raises(CommandError, match="reserved"):
        broker.site.add_robot(MASTER)


def test_used_and_unknown_serial_numbers(broker: RunningBroker) -> None:
    with pytest.raises(CommandError, match="rotate A1"):
        broker.site.add_robot("A1")
    with pytest.raises(CommandError, match="there are: A1, B2"):
        broker.site.add_robot("C3", again=True)


def test_authorities_stay_at_a_restart(tmp_path: Path) -> None:
    site = Site(tmp_path / "site")
    with pytest.raises(CommandError, match="fleet up"):
        site.add_robot("A1")
    site.prepare(9000, local=False, names=["host.example"])
    before = {path: path.read_bytes() for path in (site.folder / "authorities").rglob("ca.*")}
    site.prepare(9001, local=False, names=["host.example"])
    assert {path: path.read_bytes() for path in before} == before
    assert len(before) == 6
    assert (site.robot_url(), site.master_url()) == ("mqtts://host.example:9001", "mqtts://localhost:9002")


def test_revoked_certificate_is_rejected_after_a_restart(tmp_path: Path, stack: ExitStack) -> None:
    with running_broker(tmp_path / "site") as own:
        with pytest.raises(CommandError, match="no certificate"):
            own.site.revoke("A1")
        old = own.site.add_robot("A1")
        stolen = type(old)(*(tmp_path / path.name for path in (old.ca, old.certificate, old.key)))
        for path, copy in ((old.ca, stolen.ca), (old.certificate, stolen.certificate), (old.key, stolen.key)):
            copy.write_bytes(path.read_bytes())
        own.site.revoke("A1")
        own.site.add_robot("A1", again=True)
        robot(own, stack, "A1")
        own.kill()
        own.start()
        robot(own, stack, "A1")
        thief = Peer(own.params(stolen, own.site.robot_url()), "A1")
        stack.callback(thief.close)
        wait_for(lambda: thief.errors, "rejection of the revoked certificate")
        # Which of them arrives depends on how far the handshake was.
        assert any(words in thief.errors[0] for words in ("does not accept", "as revoked")), thief.errors


def test_default_folder() -> None:
    assert default_folder({"XDG_DATA_HOME": "/data"}) == Path("/data/robot_stack/fleet")
    assert default_folder({}) == Path.home() / ".local/share/robot_stack/fleet"


def test_missing_mosquitto(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(fleet_site, "_PLACES", ())
    with pytest.raises(CommandError, match="apt install mosquitto"):
        mosquitto()
