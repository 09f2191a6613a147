"""Requests and responses between nodes, the basis of services and actions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from robot_stack.middleware.interfaces import interface_class
from robot_stack.ros.serialization import deserialize_message, serialize_message
from sim.scheduler.events import NEVER
from sim.scheduler.network import Network
from sim.scheduler.parts import SimPort

# Takes the request, what sends the response, and the client's node. Both are immutable: nodes share no state.
Handler = Callable[[Any, Callable[[Any], None], "SimPort"], None]


class Channel:
    """Calls between two nodes, in order. A call is a function that runs in the receiver's loop."""

    __slots__ = ("_delays", "_last_ns", "_network")

    def __init__(self, network: Network, name: str, sender: str, receiver: str) -> None:
        self._network = network
        self._delays = network.call_delays(name, sender, receiver)
        self._last_ns = 0

    def depart(self, call: tuple[SimPort, Callable[[], None]]) -> None:
        events = self._network.events
        self._last_ns = max(events.now_ns + self._delays.draw(), self._last_ns)
        receiver, function = call
        events.push(self._last_ns, receiver.order, receiver.wake_for, function)


@dataclass(slots=True)
class _Server:
    port: SimPort
    handler: Handler
    visible_ns: int
    gone_ns: int = NEVER


class Calls:
    """All servers by name."""

    def __init__(self, network: Network) -> None:
        self._network = network
        self._servers: dict[str, list[_Server]] = {}
        self._channels: dict[tuple[str, str, str], Channel] = {}
        self._goals = 0

    def serve(self, port: SimPort, name: str, handler: Handler) -> None:
        self._servers.setdefault(name, []).append(_Server(port, handler, port.life.appears_ns()))

    def next_goal(self) -> int:
        """Counts the goals of all action clients."""
        self._goals += 1
        return self._goals

    def ready(self, name: str) -> bool:
        """True if a server is known. A killed server remains known until its lease ends."""
        return bool(self._known(name))

    def call(self, port: SimPort, name: str, request: Any, done: Callable[[Any], None]) -> None:
        """The request leaves at the end of the wake-up, to the servers that are known then; lost without any."""
        port.life.send(self._depart, (port, name, request, done))

    def send(self, sender: SimPort, name: str, receiver: SimPort, function: Callable[[], None]) -> None:
        """Runs ``function`` in the receiver's loop."""
        sender.life.send(self._channel(name, sender, receiver).depart, (receiver, function))

    def leave(self, port: SimPort, at_ns: int) -> None:
        for servers in self._servers.values():
            for server in servers:
                if server.port is port:
                    server.gone_ns = at_ns

    def _known(self, name: str) -> list[_Server]:
        now_ns = self._network.events.now_ns
        servers = [item for item in self._servers.get(name, ()) if now_ns < item.gone_ns]
        if name in self._servers:
            self._servers[name] = servers
        return [item for item in servers if item.visible_ns <= now_ns]

    def _depart(self, call: tuple[SimPort, str, Any, Callable[[Any], None]]) -> None:
        client, name, request, done = call
        for server in self._known(name):
            self._channel(name, client, server.port).depart(
                (server.port, lambda server=server: self._handle(server, client, name, request, done))  # type: ignore[misc]
            )

    def _handle(self, server: _Server, client: SimPort, name: str, request: Any, done: Callable[[Any], None]) -> None:
        def answer(response: Any) -> None:
            self.send(server.port, f"{name}/response", client, lambda: done(response))

        server.handler(request, answer, client)

    def _channel(self, name: str, sender: SimPort, receiver: SimPort) -> Channel:
        key = name, sender.name, receiver.name
        channel = self._channels.get(key)
        if channel is None:
            channel = self._channels[key] = Channel(self._network, *key)
        return channel


def serve(
    calls: Calls,
    port: SimPort,
    type_name: str,
    name: str,
    callback: Callable[[Any, Any, Callable[[Any], None]], None],
) -> None:
    """See ``robot_stack.middleware.port.Port.serve``."""
    service = interface_class(type_name)

    def handle(request: bytes, answer: Callable[[Any], None], _: SimPort) -> None:
        callback(
            deserialize_message(request, service.Request),
            service.Response(),
            lambda response: answer(bytes(serialize_message(response))),
        )

    calls.serve(port, name, handle)


class SimClient:
    """See ``robot_stack.middleware.port.ServiceClient``."""

    def __init__(self, calls: Calls, port: SimPort, type_name: str, name: str) -> None:
        self._calls, self._port, self._name = calls, port, name
        self._service = interface_class(type_name)

    def service_is_ready(self) -> bool:
        return self._calls.ready(self._name)

    def call(self, request: Any, done: Callable[[Any], None]) -> None:
        def on_response(data: bytes) -> None:
            done(deserialize_message(data, self._service.Response))

        self._calls.call(self._port, self._name, bytes(serialize_message(request)), on_response)
