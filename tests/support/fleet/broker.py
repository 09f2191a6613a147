"""A real broker for one test, with a port and a folder of its own."""

from __future__ import annotations

import functools
import os
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from robot_stack.cli.errors import CommandError
from robot_stack.cli.fleet_site import Files, Site, mosquitto
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.fleet.nodes.mqtt_client import connect, mqtt_client
from tests.support.waiting import wait_for


class RunningBroker:
    """mosquitto as ``robot-stack fleet up`` starts it."""

    def __init__(self, folder: Path, *, local: bool = False) -> None:
        self.site, self.port = Site(folder), free_ports()
        self._local = local
        self._process: subprocess.Popen[bytes] | None = None
        self._file = self.site.prepare(self.port, local=local, names=["localhost"])
        self.start()

    def start(self) -> None:
        with open(self.site.folder / "log", "ab") as log:
            self._process = subprocess.Popen([mosquitto(), "-c", str(self._file)], stderr=log)
        for port in (self.port,) if self._local else (self.port, self.port + 1):
            wait_for(functools.partial(self._listens, port), f"broker at port {port}")

    def kill(self) -> None:
        """As a loss of power ends it."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None

    def params(self, files: Files | None = None, url: str | None = None, **others: Any) -> BrokerParams:
        """files: of a client, with TLS; url: by default the port of that kind of client."""
        if files is None:
            return BrokerParams(url=url or self.site.robot_url(), **others)
        is_master = files.key.parent.parent.name == "masters"
        return BrokerParams(
            url=url or (self.site.master_url() if is_master else self.site.robot_url()),
            ca_file=str(files.ca),
            certificate_file=str(files.certificate),
            key_file=str(files.key),
            **others,
        )

    def _listens(self, port: int) -> bool:
        assert self._process is not None
        assert self._process.poll() is None, (self.site.folder / "log").read_text()
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def running_broker(folder: Path, *, local: bool = False) -> Iterator[RunningBroker]:
    require_mosquitto()
    broker = RunningBroker(folder, local=local)
    try:
        yield broker
    finally:
        broker.kill()


def require_mosquitto() -> None:
    try:
        mosquitto()
    except CommandError:
        pytest.skip("no mosquitto on this machine")


class Peer:
    """A plain client of another kind than the robot's connection: publishes anything, keeps what it receives."""

    def __init__(self, params: BrokerParams, client_id: str, *, will: tuple[str, str] | None = None) -> None:
        self.received: list[tuple[str, str, bool]] = []
        self.errors: list[str] = []
        self._granted: list[int] = []
        self._connected: list[bool] = []
        self._client = mqtt_client(params, client_id, persistent=False, on_error=self.errors.append)
        self._client.on_connect = lambda _client, _data, _flags, code, _properties: self._connected.append(
            not code.is_failure
        )
        self._client.on_message = lambda _client, _data, message: self.received.append(
            (message.topic, message.payload.decode(), message.retain)
        )
        self._client.on_subscribe = lambda _client, _data, mid, _codes, _properties: self._granted.append(mid)
        if will:
            self._client.will_set(*will, qos=1, retain=True)
        connect(self._client, params, persistent=False)
        self._client.loop_start()

    def connected(self) -> Peer:
        assert wait_for(lambda: self._connected, "answer to the connection") == [True]
        return self

    def subscribe(self, topic: str = "#") -> Peer:
        mid = self._client.subscribe(topic, 1)[1]
        wait_for(lambda: mid in self._granted, f"subscription to {topic}")
        return self

    def publish(self, topic: str, payload: str, *, qos: int = 1, retain: bool = False) -> None:
        self._client.publish(topic, payload, qos, retain).wait_for_publish(30.0)

    def payloads(self, topic: str) -> list[str]:
        return [payload for name, payload, _ in self.received if name == topic]

    def cut(self) -> None:
        """Without a farewell: the broker publishes the last will."""
        self._client.loop_stop()
        found = self._client.socket()
        assert found is not None
        found.close()

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


def free_ports() -> int:
    """The first of two successive free ports, below those that the operating system assigns."""
    # Test processes have successive numbers: each begins far from the others, which may not listen yet.
    first = 20_000 + 64 * (os.getpid() % 125)
    for port in range(first, first + 4000, 2):
        try:
            with socket.socket() as one, socket.socket() as two:
                one.bind(("127.0.0.1", port))
                two.bind(("127.0.0.1", port + 1))
        except OSError:
            continue
        return port
    raise RuntimeError("no free ports")
