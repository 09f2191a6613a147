"""The live view with real publishers and a plain websocket client."""

from __future__ import annotations

import json
import random
import re
import signal
import socket
import struct
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Bool
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from custom_msgs.msg import EHMIStatus
from robot_stack.contract import topics
from robot_stack.contract.display import Display
from robot_stack.contract.model import System, Topic
from robot_stack.view.channels import MODEL, offered
from tests.support.peer import Peer
from tests.support.processes import NodeProcess, Start
from tests.support.waiting import wait_for

COMMAND = [sys.executable, "-m", "robot_stack.cli", "view"]
_MESSAGE = 1


class Viewer:
    """One client. Messages are (channel's topic, bytes)."""

    def __init__(self, port: int) -> None:
        self._open = ExitStack()
        address, subprotocol = f"ws://127.0.0.1:{port}", Subprotocol("foxglove.sdk.v1")
        self._link = self._open.enter_context(
            connect(address, subprotocols=[subprotocol], max_size=2**26, open_timeout=30)
        )
        self.channels: dict[str, dict[str, Any]] = {}
        self.messages: list[tuple[str, bytes]] = []
        self.statuses: list[dict[str, Any]] = []
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        wait_for(lambda: len(self.channels) > len(offered(System.ROBOT)), "every channel")

    def _read(self) -> None:
        try:
            for item in self._link:
                self._take(item)
        except ConnectionClosed:
            pass

    def _take(self, item: str | bytes) -> None:
        if isinstance(item, bytes):
            opcode, subscription, _ = struct.unpack_from("<BIQ", item)
            assert opcode == _MESSAGE
            self.messages.append((self._topic(subscription), item[13:]))
            return
        message = json.loads(item)
        if message["op"] == "advertise":
            self.channels |= {channel["topic"]: channel for channel in message["channels"]}
        elif message["op"] == "status":
            self.statuses.append(message)

    def _topic(self, channel: int) -> str:
        return next(topic for topic, item in self.channels.items() if item["id"] == channel)

    def look(self, topic: str) -> None:
        """Subscribes to a topic; the subscription id equals the channel's id."""
        number = self.channels[topic]["id"]
        self.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": number, "channelId": number}]}))

    def look_away(self, topic: str) -> None:
        self.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [self.channels[topic]["id"]]}))

    def send(self, item: str | bytes) -> None:
        self._link.send(item)

    def received(self, topic: str) -> list[bytes]:
        return [data for name, data in self.messages if name == topic]

    def close(self) -> None:
        self._open.close()
        self._thread.join(10.0)

    def vanish(self) -> None:
        """Drops the connection like a killed browser."""
        self._link.socket.shutdown(socket.SHUT_RDWR)
        self._thread.join(10.0)


@pytest.fixture
def view(start: Start) -> NodeProcess:
    process = start("view", command=[*COMMAND, "--port", "0"])
    process.wait_output("Ctrl-C ends it")
    return process


@pytest.fixture
def viewer(view: NodeProcess) -> Iterator[Callable[[], Viewer]]:
    """``viewer()`` connects one."""
    made: list[Viewer] = []

    def join() -> Viewer:
        made.append(Viewer(port_of(view)))
        return made[-1]

    yield join
    for each in made:
        each.close()


def port_of(process: NodeProcess) -> int:
    found = re.search(r"ws://127\.0\.0\.1:(\d+)", process.output())
    assert found is not None
    return int(found.group(1))


def subscribers(peer: Peer, row: Topic) -> int:
    return int(peer.publisher(row).get_subscription_count())


def odometry(number: int) -> bytes:
    """The serialised message. Serialised once, because padding bytes between fields are undefined."""
    message = Odometry(child_frame_id=f"base_link {number}")
    message.pose.pose.position.x = 0.1 * number
    message.pose.covariance[35] = 1e-3 * number
    return bytes(serialize_message(message))


YES, NO = (bytes(serialize_message(Bool(data=value))) for value in (True, False))


def test_channels_carry_the_contract_and_schemas_that_others_can_read(viewer: Callable[[], Viewer]) -> None:
    channels = viewer().channels
    assert set(channels) == {*offered(System.ROBOT), MODEL}
    for row in offered(System.ROBOT).values():
        channel = channels[row.name]
        assert (channel["encoding"], channel["schemaEncoding"], channel["schemaName"]) == ("cdr", "ros2msg", row.type)
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(channel["schema"], row.type))  # an independent reader
        assert row.type in store.types
    assert channels[MODEL]["schemaName"] == "foxglove.SceneUpdate"


def test_messages_arrive_unchanged_and_only_while_watched(peer: Peer, viewer: Callable[[], Viewer]) -> None:
    row = topics.ODOM
    one = viewer()
    peer.publisher(row)
    assert subscribers(peer, row) == 0
    one.look(row.name)
    peer.wait_matched(row)
    sent = [odometry(number) for number in range(1000)]
    coming = iter(sent)
    peer.repeat(row, lambda: next(coming), 20.0)
    wait_for(lambda: len(one.received(row.name)) >= 5, "five messages")
    received = one.received(row.name)
    first = sent.index(received[0])
    assert received == sent[first : first + len(received)]
    one.look_away(row.name)
    wait_for(lambda: subscribers(peer, row) == 0, "the subscription's end")


def test_images_are_transmitted_unchanged(peer: Peer, viewer: Callable[[], Viewer]) -> None:
    row = topics.FRONT_IMAGE
    data = random.Random(1).randbytes(1280 * 720)
    image = bytes(serialize_message(Image(height=720, width=1280, encoding="mono8", step=1280, data=data)))
    one = viewer()
    one.look(row.name)
    peer.wait_matched(row)
    peer.repeat(row, lambda: image, 5.0)
    wait_for(lambda: one.received(row.name), "an image")
    assert one.received(row.name)[0] == image


def test_viewers_share_a_subscription_and_the_latched_message(peer: Peer, viewer: Callable[[], Viewer]) -> None:
    row = topics.PASSENGER_ATTACHED
    peer.publish(row, YES)
    one, two = viewer(), viewer()
    for watched in (row, topics.ODOM):
        one.look(watched.name)
        peer.wait_matched(watched)
    wait_for(lambda: one.received(row.name), "the latched message")
    two.look(row.name)
    wait_for(lambda: two.received(row.name), "the latched message for who came later")
    assert set(one.received(row.name)) == set(two.received(row.name)) == {YES}
    one.vanish()  # its own subscriptions end, the shared one stays
    wait_for(lambda: subscribers(peer, topics.ODOM) == 0, "the end of the vanished viewer's subscription")
    peer.publish(row, NO)
    wait_for(lambda: NO in two.received(row.name), "the next message")
    two.close()
    wait_for(lambda: subscribers(peer, row) == 0, "the subscription's end with its last viewer")


def test_the_model_follows_joints_passenger_and_external_display(peer: Peer, viewer: Callable[[], Viewer]) -> None:
    one = viewer()
    one.look(MODEL)
    peer.wait_matched(topics.JOINT_STATES)
    peer.wait_matched(topics.PASSENGER_ATTACHED)
    assert one.channels["/joint_states"]  # advertised, but not subscribed
    states = JointState(name=["fl_drive", "fl_steer"], position=[0.0, 0.5])
    peer.repeat(topics.JOINT_STATES, lambda: states, 20.0)
    wait_for(lambda: one.received(MODEL), "a model")
    assert b"fl_wheel" in one.received(MODEL)[-1]
    assert b"wheelchair" not in one.received(MODEL)[-1]
    assert one.received("/joint_states") == []
    peer.publish(topics.PASSENGER_ATTACHED, Bool(data=True))
    wait_for(lambda: b"wheelchair" in one.received(MODEL)[-1], "the wheelchair")
    status = EHMIStatus(linked=True, acknowledged_state=Display.EMERGENCY_STOP)
    peer.repeat(topics.EHMI_STATUS, lambda: status, 5.0)
    wait_for(lambda: b"Emergency stop" in one.received(MODEL)[-1], "what the external display shows")
    status.linked = False
    wait_for(lambda: b"no answer" in one.received(MODEL)[-1], "the lost display")
    one.look_away(MODEL)
    wait_for(lambda: subscribers(peer, topics.JOINT_STATES) == 0, "the end of /joint_states")


HOSTILE = (
    b"",
    b"\xff\x00garbage",
    b"\x01" + b"\x00" * 12 + b"a message for the graph",
    "",
    "no json",
    "[]",
    '{"op": "subscribe"}',
    '{"op": "subscribe", "subscriptions": [{"id": -1, "channelId": "x"}]}',
    '{"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 999999999}]}',
    '{"op": "unsubscribe", "subscriptionIds": [77, 78]}',
    '{"op": "advertise", "channels": [{"id": 1, "topic": "/emergency_stop", "encoding": "cdr", "schemaName": "x"}]}',
    '{"op": "setParameters", "parameters": [{"name": "port", "value": 1}]}',
    '{"op": "fetchAsset", "uri": "file:///etc/passwd", "requestId": 1}',
    "{" * 10_000,
    "\x00" * 100_000,
)


def test_garbage_changes_nothing(peer: Peer, view: NodeProcess, viewer: Callable[[], Viewer]) -> None:
    """A hostile client beside a normal one: nothing reaches the graph, and the other client is not disturbed."""
    stop, row, odometry_1 = peer.listen(topics.EMERGENCY_STOP), topics.ODOM, odometry(1)
    peer.publisher(row)
    looking = viewer()
    looking.look(row.name)
    peer.wait_matched(row)
    draw = random.Random(1)
    hostile = viewer()
    wild = [draw.randbytes(draw.randrange(200)) for _ in range(200)]
    for item in (*HOSTILE, *wild, *(data.decode("latin-1") for data in wild)):
        try:
            hostile.send(item)
        except ConnectionClosed:  # the server may close the connection
            hostile = viewer()
    raw_requests(port_of(view))
    peer.repeat(row, lambda: odometry_1, 20.0)  # best effort: the first may be lost
    wait_for(lambda: looking.received(row.name), "the message of the other viewer")
    assert set(looking.received(row.name)) == {odometry_1}
    assert subscribers(peer, row) == 1
    assert peer.node.count_publishers(topics.EMERGENCY_STOP.name) == 0
    assert stop.messages == []
    assert view.running()


def raw_requests(port: int) -> None:
    """Requests that are not a websocket handshake."""
    for request in (b"GET /../../etc/passwd HTTP/1.1\r\nHost: x\r\n\r\n", b"\x16\x03\x01\x00\xff", b"\r\n" * 1000):
        with socket.create_connection(("127.0.0.1", port), timeout=10.0) as link:
            link.sendall(request)


def test_interrupt_ends_view_without_viewers(view: NodeProcess) -> None:
    view.signal(signal.SIGINT)
    assert view.wait() == 0


def test_sigterm_ends_it_under_a_viewer(peer: Peer, view: NodeProcess, viewer: Callable[[], Viewer]) -> None:
    viewer().look(topics.ODOM.name)
    peer.wait_matched(topics.ODOM)
    view.signal(signal.SIGTERM)
    assert view.wait() == 0


def test_occupied_port_is_reported(view: NodeProcess, start: Start) -> None:
    port = port_of(view)
    second = start("second", command=[*COMMAND, "--port", str(port)])
    assert second.wait() == 1
    assert f"error: port {port} of 127.0.0.1 is not available: " in second.output()
    assert "`robot-stack view --port`" in second.output()
