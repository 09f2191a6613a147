"""The robot's connection to the fleet's broker over MQTT, in a thread of its own."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from typing import Any, Final

from paho.mqtt.client import Client, ConnectFlags, MQTTMessage
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from robot_stack.fleet.link import Connected, Disconnected, LinkEvent, Received, Topic
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.fleet.nodes.mqtt_client import connect, files_stamp, mqtt_client, tls_context
from robot_stack.middleware.device_thread import DeviceLost, DeviceThread, reason

_RETAINED: Final = frozenset({Topic.CONNECTION, Topic.FACTSHEET})
_BLOCKED_POLL_S: Final = 0.05
_CLOSE_S: Final = 1.0


class MqttLink:
    """Connects at once and again for ever. ``online``, ``offline`` and ``will`` are called in the link's thread.

    client_id: identifies the session at the broker; the serial number, which no other client may use.
    prefix: topic levels before the last, e.g. ``uagv/v2/manufacturer/serial``. subscriptions: their last levels.
    online, offline, will: payloads for the topic ``connection``; the will is published by the broker after a loss.

    Received messages wait for ``receive``, at most ``queue_messages`` of each topic: beyond this, the oldest message of
    the same topic is dropped, because a newer order or action replaces or follows it. A flood of one topic thus
    displaces no message of another. ``dropped`` counts them.
    """

    def __init__(
        self,
        params: BrokerParams,
        client_id: str,
        prefix: str,
        online: Callable[[], bytes],
        offline: Callable[[], bytes],
        will: Callable[[], bytes],
        subscriptions: tuple[Topic, ...] = (Topic.ORDER, Topic.INSTANT_ACTIONS),
    ) -> None:
        self.where = params.url
        self._params, self._client_id, self._prefix = params, client_id, prefix
        self._online, self._offline, self._will = online, offline, will
        self._topics = {f"{prefix}/{topic}": topic for topic in subscriptions}
        self._back_off = BackOff(params.first_back_off_s, params.longest_back_off_s, client_id)
        self._lock = threading.Lock()
        self._inbox = Inbox(params.queue_messages)
        self._waiting: dict[Topic, bytes] = {}
        self._connected = False
        self._opening = False  # a message may arrive before the subscription is confirmed, but is seen after Connected
        self._shown = ""
        self._why = ""
        self._answers: set[str] = set()
        self._refused = ""
        self._unconfirmed: set[int] = set()
        self._thread = DeviceThread(self, self._back_off.next_s)

    @property
    def state(self) -> str:
        """Of the connection, in words."""
        return self._thread.state

    @property
    def dropped(self) -> Mapping[str, int]:
        """Numbers of dropped messages: ``flood``, ``too long``, ``retained``."""
        with self._lock:
            return dict(self._inbox.dropped)

    # --- in the node's thread ----------------------------------------------------------------------------------------

    def receive(self) -> tuple[LinkEvent, ...]:
        with self._lock:
            return () if self._opening else self._inbox.take()

    def send(self, topic: Topic, payload: bytes) -> None:
        with self._lock:
            self._waiting[topic] = payload
        self._thread.wake()

    def close(self) -> None:
        """Waits at most for the longest answer of the broker."""
        self._thread.close()

    # --- in the link's thread ----------------------------------------------------------------------------------------

    def use(self, thread: DeviceThread) -> None:
        try:
            while thread.running:
                self._session(thread)
        except Exception as error:
            self._lost(reason(error))
            raise

    def _session(self, thread: DeviceThread) -> None:
        """Returns for a new connection with changed files, or at the end."""
        stamp = files_stamp(self._params)
        client = self._client()
        connect(client, self._params, persistent=True)
        try:
            self._open(client, thread)
            thread.report_open()
            opened_s = checked_s = time.monotonic()
            while thread.running:
                self._publish_waiting(client)
                self._serve(client, thread, self._params.check_files_s)
                now_s = time.monotonic()
                if now_s - opened_s >= self._params.longest_back_off_s:
                    self._back_off.reset()
                if now_s - checked_s >= self._params.check_files_s:
                    checked_s = now_s
                    # A certificate is replaced in two files: until both fit, the connection stays.
                    if files_stamp(self._params) != stamp and self._usable():
                        break
            if not thread.running:
                self._say_goodbye(client, thread)
            client.disconnect()
            self._lost("reconnects with new certificates" if thread.running else "closed")
        finally:
            # Without a disconnection before, the broker publishes the last will.
            if (socket := client.socket()) is not None:
                socket.close()

    def _client(self) -> Client:
        self._why = self._refused = ""
        self._answers = set()
        client = mqtt_client(self._params, self._client_id, persistent=True, on_error=self._note)
        client.will_set(self._topic(Topic.CONNECTION), self._will(), qos=1, retain=True)
        client.on_connect = self._on_connect
        client.on_subscribe = self._on_subscribe
        client.on_message = self._on_message
        client.on_publish = self._on_publish
        client.on_disconnect = self._on_disconnect
        return client

    def _open(self, client: Client, thread: DeviceThread) -> None:
        self._await(client, thread, "connection")
        # With QoS 1, the broker keeps what a fleet manager sends with it while the robot is away. Messages with QoS 0,
        # as VDA 5050 has them, arrive with QoS 0.
        client.subscribe([(topic, 1) for topic in self._topics])
        self._await(client, thread, "subscription")
        client.publish(self._topic(Topic.CONNECTION), self._online(), qos=1, retain=True)
        with self._lock:
            self._opening = False

    def _await(self, client: Client, thread: DeviceThread, answer: str) -> None:
        end_s = time.monotonic() + self._params.timeout_s
        while answer not in self._answers:
            if not thread.running:
                return
            if time.monotonic() >= end_s:
                raise DeviceLost(f"does not answer the {answer}")
            self._serve(client, thread, _BLOCKED_POLL_S)

    def _serve(self, client: Client, thread: DeviceThread, duration_s: float) -> None:
        """Reads and writes once, after at most ``duration_s``."""
        if (socket := client.socket()) is None:
            raise self._loss()
        if client.want_write():
            client.loop_write()
        if thread.wait(_BLOCKED_POLL_S if client.want_write() else duration_s, socket):
            client.loop_read()
            # TLS may have decrypted more than one packet, which the operating system does not report.
            while (of_tls := client.socket()) is not None and getattr(of_tls, "pending", int)() > 0:
                client.loop_read()
        client.loop_misc()
        if self._refused or client.socket() is None:
            raise self._loss()

    def _loss(self) -> DeviceLost:
        return DeviceLost(self._refused or self._why or "lost the connection")

    def _publish_waiting(self, client: Client) -> None:
        # While the network accepts no data, the messages stay here, where a newer one replaces them.
        while not client.want_write():
            with self._lock:
                if not self._waiting:
                    return
                topic = next(iter(self._waiting))
                payload = self._waiting.pop(topic)
            qos = 1 if topic is Topic.CONNECTION else 0
            client.publish(self._topic(topic), payload, qos=qos, retain=topic in _RETAINED)

    def _say_goodbye(self, client: Client, thread: DeviceThread) -> None:
        self._unconfirmed = {client.publish(self._topic(Topic.CONNECTION), self._offline(), qos=1, retain=True).mid}
        end_s = time.monotonic() + _CLOSE_S
        while self._unconfirmed and time.monotonic() < end_s:
            self._serve(client, thread, _BLOCKED_POLL_S)

    def _usable(self) -> bool:
        try:
            tls_context(self._params)
        except OSError:
            return False
        return True

    def _topic(self, topic: Topic) -> str:
        return f"{self._prefix}/{topic}"

    def _note(self, text: str) -> None:
        self._why = self._why or f"lost the connection: {text}"

    def _lost(self, why: str) -> None:
        """Reports the loss of a connection; of connections that fail one after another, only new reasons."""
        with self._lock:
            if self._connected or why != self._shown:
                self._inbox.put(Disconnected(why))
            self._connected, self._opening, self._shown = False, False, why

    # --- callbacks of the client -------------------------------------------------------------------------------------

    def _on_connect(
        self, _client: Client, _data: Any, flags: ConnectFlags, code: ReasonCode, _properties: Properties | None
    ) -> None:
        if code.is_failure:
            self._refused = f"refuses the connection: {code}"
            return
        self._answers.add("connection")
        with self._lock:
            self._connected = self._opening = True
            self._inbox.put(Connected(flags.session_present))

    def _on_subscribe(
        self, _client: Client, _data: Any, _mid: int, codes: list[ReasonCode], _properties: Properties | None
    ) -> None:
        refused = [topic for topic, code in zip(self._topics, codes, strict=False) if code.is_failure]
        if refused:
            self._refused = f"refuses the subscription to {', '.join(refused)}"
        self._answers.add("subscription")

    def _on_message(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        topic = self._topics.get(message.topic)
        with self._lock:
            if topic is None:
                return  # of a subscription that an earlier configuration left in the session
            if message.retain:
                # From the broker's store, which sends it again at each connection: an order would be driven again.
                self._inbox.dropped["retained"] += 1
                return
            if len(message.payload) > self._params.longest_message_bytes:
                self._inbox.dropped["too long"] += 1
            else:
                self._inbox.put(Received(topic, bytes(message.payload)))

    def _on_publish(
        self, _client: Client, _data: Any, mid: int, code: ReasonCode, _properties: Properties | None
    ) -> None:
        # A broker of protocol 3.1.1 drops silently what its rules forbid.
        if code.is_failure:
            self._refused = f"refuses a message of {self._client_id}: {code}"
        self._unconfirmed.discard(mid)

    def _on_disconnect(
        self, _client: Client, _data: Any, _flags: Any, code: ReasonCode, _properties: Properties | None
    ) -> None:
        # Only a broker of protocol 5 gives a reason; otherwise the library has none.
        if not self._why and code.is_failure and code.getName() != "Unspecified error":
            self._why = f"lost the connection: {code}"


class Inbox:
    """Events in the order of arrival, at most ``limit`` of each kind: beyond this the oldest of the kind is dropped.

    A kind is the topic of a message, or the type of another event.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._events: deque[LinkEvent] = deque()
        self._counts: Counter[object] = Counter()
        self.dropped: Counter[str] = Counter()

    def put(self, event: LinkEvent) -> None:
        kind = _kind(event)
        if self._counts[kind] >= self._limit:
            self._events.remove(next(item for item in self._events if _kind(item) == kind))
            self._counts[kind] -= 1
            self.dropped["flood"] += isinstance(event, Received)
        self._events.append(event)
        self._counts[kind] += 1

    def take(self) -> tuple[LinkEvent, ...]:
        """All events; empties the inbox."""
        events = tuple(self._events)
        self._events.clear()
        self._counts.clear()
        return events


def _kind(event: LinkEvent) -> object:
    return event.topic if isinstance(event, Received) else type(event)


class BackOff:
    """Pauses that double from ``first_s`` to ``longest_s``, each shortened at random by up to a half.

    seed: of the random numbers; different for each robot, so that a fleet does not reconnect at the same instant.
    """

    def __init__(self, first_s: float, longest_s: float, seed: str) -> None:
        self._first_s, self._longest_s = first_s, longest_s
        self._pause_s = first_s
        self._random = random.Random(seed)

    def next_s(self) -> float:
        pause_s = self._pause_s * self._random.uniform(0.5, 1.0)
        self._pause_s = min(2.0 * self._pause_s, self._longest_s)
        return pause_s

    def reset(self) -> None:
        self._pause_s = self._first_s
