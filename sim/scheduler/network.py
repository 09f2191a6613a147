"""Topics without DDS: endpoints with discovery, messages with latency.

A message is serialised once, when it is published. Each subscriber gets a copy of its own, made when the node takes it,
so that an overwritten message costs nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from robot_stack.contract.model import Durability, Topic
from robot_stack.middleware.wire import READERS, UnknownEncoding
from robot_stack.ros.serialization import serialize_message
from sim.scheduler.decoding import decoder
from sim.scheduler.events import NEVER, EventQueue
from sim.scheduler.observers import Observer
from sim.scheduler.params import LatencyParams, Spread
from sim.scheduler.parts import SimPort
from sim.scheduler.rules import MessageRule, Transfer
from sim.scheduler.streams import Delays, Streams


class Packet(NamedTuple):
    """A message on its way. sent_ns: virtual time at which it left."""

    data: bytes
    sent_ns: int


class Watchers:
    """The observers by what they override."""

    def __init__(self) -> None:
        self.publish: list[Callable[[int, str, str, bytes], None]] = []
        self.deliver: list[Callable[[int, str, str, bytes], None]] = []
        self.exception: list[Callable[[int, str, str], None]] = []
        self.life_change: list[Callable[[int, str, Any], None]] = []

    def add(self, observer: Observer) -> None:
        kind = type(observer)
        if kind.on_publish is not Observer.on_publish:
            self.publish.append(observer.on_publish)
        if kind.on_deliver is not Observer.on_deliver:
            self.deliver.append(observer.on_deliver)
        if kind.on_exception is not Observer.on_exception:
            self.exception.append(observer.on_exception)
        if kind.on_life_change is not Observer.on_life_change:
            self.life_change.append(observer.on_life_change)


class SimPublisher:
    """See ``robot_stack.middleware.port.Publisher``. visible_ns, gone_ns: begin and end of its visibility to others."""

    __slots__ = ("_history", "_network", "gone_ns", "links", "port", "row", "topic_name", "visible_ns")

    def __init__(self, network: Network, port: SimPort, row: Topic, name: str, visible_ns: int) -> None:
        self._network = network
        self.port = port
        self.row = row
        self.topic_name = name
        self.visible_ns = visible_ns
        self.gone_ns = NEVER
        self.links: list[Link] = []
        kept = row.qos.depth if row.qos.durability is Durability.TRANSIENT_LOCAL else 0
        self._history: deque[Packet] = deque(maxlen=kept)

    def publish(self, message: Any) -> None:
        """Serialises at once; the message leaves at the end of the present wake-up."""
        data = message if type(message) is bytes else _serialised(message)
        self.port.life.send(self._depart, data)

    def get_subscription_count(self) -> int:
        return len(self.links)

    def _depart(self, data: bytes) -> None:
        network = self._network
        now_ns = network.events.now_ns
        for watch in network.watchers.publish:
            watch(now_ns, self.port.name, self.topic_name, data)
        network.published += 1
        packet = Packet(data, now_ns)
        self._history.append(packet)
        for link in self.links:
            link.send(packet)

    def match(self, link: Link) -> None:
        """Messages go to this subscriber from now on; a late joiner gets the retained ones."""
        self.links.append(link)
        for packet in self._history:
            link.send(packet)


class SimSubscription:
    """See ``robot_stack.middleware.port.Subscription``.

    take: gives a node one message: the packet, and the virtual time in ns at which it arrived.
    """

    __slots__ = (
        "_network",
        "_pending",
        "_queue",
        "_take_one",
        "ended",
        "gone_ns",
        "index",
        "port",
        "row",
        "topic_name",
        "visible_ns",
        "wakes",
    )

    def __init__(
        self,
        network: Network,
        port: SimPort,
        row: Topic,
        name: str,
        visible_ns: int,
        take_one: Callable[[Packet, int], None],
        depth: int,
        *,
        wakes: bool,
    ) -> None:
        self._network = network
        self._take_one = take_one
        self._queue: deque[tuple[Packet, int]] = deque(maxlen=depth)
        self._pending = False
        self.port = port
        self.row = row
        self.topic_name = name
        self.visible_ns = visible_ns
        self.gone_ns = NEVER
        self.wakes = wakes
        self.index = port.next_index()
        self.ended = False

    def end(self) -> None:
        if not self.ended:
            self.ended = True
            self._queue.clear()
            self._network.leave_in_order(self.port, (), (self,))

    def arrive(self, packet: Packet) -> None:
        """A full queue loses its oldest message, as KEEP_LAST does."""
        port = self.port
        if self.ended or not port.open:
            return
        network = self._network
        now_ns = network.events.now_ns
        network.delivered += 1
        for watch in network.watchers.deliver:
            watch(now_ns, port.name, self.topic_name, packet.data)
        self._queue.append((packet, now_ns))
        if not self._pending:
            self._pending = True
            (port.ready if self.wakes else port.waiting).append(self)
        if self.wakes:
            port.life.request_wake(now_ns)

    def take(self) -> None:
        """Everything that has arrived, oldest first."""
        self._pending = False
        queue, take_one = self._queue, self._take_one
        while queue:
            packet, arrived_ns = queue.popleft()
            take_one(packet, arrived_ns)


class Link:
    """From one publisher to one subscriber: its latency, its order, its faults."""

    __slots__ = ("_delays", "_last_ns", "_network", "_rules", "_version", "publisher", "subscription")

    def __init__(self, network: Network, publisher: SimPublisher, subscription: SimSubscription) -> None:
        self._network = network
        self.publisher = publisher
        self.subscription = subscription
        self._delays: Delays | None = None
        self._last_ns = 0
        self._rules: list[MessageRule] = []
        self._version = -1

    def send(self, packet: Packet) -> None:
        network = self._network
        delays = self._delays
        if delays is None:  # most links carry nothing for long
            delays = self._delays = network.link_delays(self)
        if self._version != network.rules_version:
            self._rules, self._version = network.rules_of(self), network.rules_version
        delay_ns = delays.draw()
        if self._rules:
            self._send_through_rules(packet, delay_ns)
            return
        at_ns = network.events.now_ns + delay_ns
        if at_ns < self._last_ns:
            at_ns = self._last_ns
        self._last_ns = at_ns
        subscription = self.subscription
        network.events.push(at_ns, subscription.port.order, subscription.arrive, packet)

    def _send_through_rules(self, packet: Packet, delay_ns: int) -> None:
        network, subscription = self._network, self.subscription
        now_ns = network.events.now_ns
        transfers = [Transfer(packet.data, delay_ns)]
        for rule in self._rules:
            if rule.from_ns <= now_ns < rule.until_ns and rule.applies(network.streams):
                transfers = rule.change(transfers, self.publisher.row, network.streams)
        for transfer in transfers:
            at_ns = now_ns + transfer.delay_ns
            if transfer.in_order:
                at_ns = self._last_ns = max(at_ns, self._last_ns)
            changed = packet if transfer.data is packet.data else Packet(transfer.data, packet.sent_ns)
            network.events.push(at_ns, subscription.port.order, subscription.arrive, changed)


class Network:
    """All topics."""

    def __init__(
        self, events: EventQueue, streams: Streams, latency: LatencyParams, leave: Spread, watchers: Watchers
    ) -> None:
        self.events = events
        self.streams = streams
        self.watchers = watchers
        self.published = self.delivered = 0
        self.rules: list[MessageRule] = []
        self.rules_version = 0
        self._latency = latency
        self._leave = leave
        self._publishers: dict[str, list[SimPublisher]] = {}
        self._subscriptions: dict[str, list[SimSubscription]] = {}

    # --- faults ------------------------------------------------------------------------------------------------------

    def add_rule(self, rule: MessageRule) -> None:
        """A fault of messages from now on. Raises ValueError if there is one of its name."""
        if any(item.name == rule.name for item in self.rules):
            raise ValueError(f"there is a message rule {rule.name!r} already")
        self.rules = [*self.rules, rule]
        self.rules_version += 1

    def remove_rule(self, name: str) -> None:
        self.rules = [item for item in self.rules if item.name != name]
        self.rules_version += 1

    def rules_of(self, link: Link) -> list[MessageRule]:
        names = link.publisher.topic_name, link.publisher.port.name, link.subscription.port.name
        return [item for item in self.rules if item.matches(*names)]

    # --- endpoints ---------------------------------------------------------------------------------------------------

    def advertise(self, port: SimPort, row: Topic, name: str) -> SimPublisher:
        publisher = SimPublisher(self, port, row, name, port.life.appears_ns())
        self._publishers.setdefault(name, []).append(publisher)
        for subscription in self._subscriptions.get(name, []):
            self._discover(publisher, subscription)
        return publisher

    def subscribe(
        self,
        port: SimPort,
        row: Topic,
        name: str,
        callback: Callable[[Any, Packet, int], None],
        depth: int,
        *,
        wakes: bool,
        raw: bool,
    ) -> SimSubscription:
        """callback: the message, its packet, and the virtual time in ns at which it arrived."""
        read = _identity if raw else reader(row.type)

        def take_one(packet: Packet, arrived_ns: int) -> None:
            callback(read(packet.data), packet, arrived_ns)

        visible_ns = port.life.appears_ns()
        subscription = SimSubscription(self, port, row, name, visible_ns, take_one, depth, wakes=wakes)
        self._subscriptions.setdefault(name, []).append(subscription)
        for publisher in self._publishers.get(name, []):
            self._discover(publisher, subscription)
        return subscription

    def publishers(self, name: str) -> Sequence[SimPublisher]:
        return self._publishers.get(name, ())

    def subscriptions(self, name: str) -> Sequence[SimSubscription]:
        return self._subscriptions.get(name, ())

    def leave(self, port: SimPort, at_ns: int) -> None:
        """The endpoints of a node become invisible to others at that time."""
        publishers = [item for items in self._publishers.values() for item in items if item.port is port]
        subscriptions = [item for items in self._subscriptions.values() for item in items if item.port is port]
        self._leave_at(at_ns, port, publishers, subscriptions)

    def leave_in_order(
        self, port: SimPort, publishers: Sequence[SimPublisher], subscriptions: Sequence[SimSubscription]
    ) -> None:
        delay_ns = self.streams.delays(f"leave/{port.name}", self._leave).draw()
        self._leave_at(self.events.now_ns + delay_ns, port, publishers, subscriptions)

    def link_delays(self, link: Link) -> Delays:
        row, name = link.publisher.row, link.publisher.topic_name
        spread = self._latency.rows.get(row.name) or (self._latency.bulk if row.bulk else self._latency.small)
        ends = f"{link.publisher.port.name}/{link.subscription.port.name}"
        return self.streams.delays(f"latency{name}/{ends}", spread)

    def call_delays(self, name: str, sender: str, receiver: str) -> Delays:
        return self.streams.delays(f"call{name}/{sender}/{receiver}", self._latency.call)

    def _discover(self, publisher: SimPublisher, subscription: SimSubscription) -> None:
        if publisher.row.type != subscription.row.type or publisher.gone_ns != NEVER or subscription.gone_ns != NEVER:
            return
        at_ns = max(publisher.visible_ns, subscription.visible_ns, self.events.now_ns)
        self.events.push(at_ns, publisher.port.order, self._match, Link(self, publisher, subscription))

    def _match(self, link: Link) -> None:
        if link.publisher.port.open and link.subscription.port.open and not link.subscription.ended:
            link.publisher.match(link)

    def _leave_at(
        self, at_ns: int, port: SimPort, publishers: Sequence[SimPublisher], subscriptions: Sequence[SimSubscription]
    ) -> None:
        for publisher in publishers:
            publisher.gone_ns = min(at_ns, publisher.gone_ns)
        for subscription in subscriptions:
            subscription.gone_ns = min(at_ns, subscription.gone_ns)
        self.events.push(at_ns, port.order, self._forget, tuple(publishers), tuple(subscriptions))

    def _forget(self, publishers: Sequence[SimPublisher], subscriptions: Sequence[SimSubscription]) -> None:
        for publisher in publishers:
            name = publisher.topic_name
            self._publishers[name] = [item for item in self._publishers[name] if item is not publisher]
        for subscription in subscriptions:
            name = subscription.topic_name
            self._subscriptions[name] = [item for item in self._subscriptions[name] if item is not subscription]
            for publisher in self._publishers.get(name, ()):
                publisher.links = [item for item in publisher.links if item.subscription is not subscription]


def reader(type_name: str) -> Callable[[bytes], Any]:
    """The decoder of a message; clouds and images become views."""
    decode, view = decoder(type_name), READERS.get(type_name)
    if view is None:
        return decode

    def read(data: bytes) -> Any:
        try:
            return view(data)
        except UnknownEncoding:  # left to the middleware, which reports the error
            return decode(data)

    return read


def _identity(data: bytes) -> bytes:
    return data


def _serialised(message: Any) -> bytes:
    return bytes(message) if isinstance(message, (bytearray, memoryview)) else bytes(serialize_message(message))
