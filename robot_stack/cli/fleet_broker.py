"""A fleet manager's connection to the broker, for the commands of ``robot-stack fleet``."""

from __future__ import annotations

import json
import queue
import secrets
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, Self

from paho.mqtt.client import Client, ConnectFlags, MQTTMessage
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode
from pydantic import ValidationError

from robot_stack.cli.errors import WRONG_USE, CommandError
from robot_stack.cli.fleet_robots import PUBLISHED, Robot, robot_of
from robot_stack.cli.fleet_site import Files, Site
from robot_stack.fleet.link import Topic
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.fleet.nodes.mqtt_client import connect, mqtt_client

_DEEPEST: Final = 32  # levels of a message; VDA 5050 has fewer than 10
_QUEUE: Final = 10_000  # messages; the broker repeats the state of each robot


def broker_params(site: Site, url: str | None, certificates: Path | None) -> BrokerParams:
    """url, certificates: by default those of the broker on this computer. Raises CommandError."""
    url = url or site.master_url()
    files = None
    if url.startswith("mqtts:"):
        folder = certificates or site.master().certificate.parent
        files = Files(folder / "ca.crt", folder / "client.crt", folder / "client.key")
        if missing := [str(path) for path in (files.ca, files.certificate, files.key) if not path.is_file()]:
            raise CommandError(f"there is no {missing[0]}: --certificates names a folder with a fleet manager's files")
    try:
        return BrokerParams(
            url=url,
            ca_file=str(files.ca) if files else "",
            certificate_file=str(files.certificate) if files else "",
            key_file=str(files.key) if files else "",
        )
    except ValidationError as error:
        raise CommandError(f"--broker: {error.errors()[0]['msg'].removeprefix('Value error, ')}", WRONG_USE) from None


class Fleet:
    """The robots of one broker; a context manager. Raises CommandError if the broker cannot be used."""

    def __init__(self, params: BrokerParams) -> None:
        self._params = params
        self.robots: dict[str, Robot] = {}
        self._events: queue.Queue[MQTTMessage | str] = queue.Queue(_QUEUE)
        self._why = ""

    def __enter__(self) -> Self:
        client_id = f"robot-stack-fleet-{secrets.token_hex(6)}"
        try:
            self._client = mqtt_client(self._params, client_id, persistent=False, on_error=self._note)
            self._client.on_connect = self._on_connect
            self._client.on_message = self._on_message
            self._client.on_disconnect = self._on_disconnect
            connect(self._client, self._params, persistent=False)
        except OSError as error:
            raise CommandError(f"no connection to the broker {self._params.url}: {error.strerror or error}") from None
        self._client.loop_start()
        try:
            self._wait_for_connection()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._client.disconnect()
        self._client.loop_stop()

    def updates(self, duration_s: float | None) -> Iterator[tuple[Robot, Topic]]:
        """Robots with the topic of their newest message, as these arrive, for ``duration_s``; None: for ever."""
        end_s = None if duration_s is None else time.monotonic() + duration_s
        while True:
            left_s = 3600.0 if end_s is None else end_s - time.monotonic()
            try:
                event = self._events.get(timeout=max(left_s, 0.0)) if left_s > 0.0 else self._events.get_nowait()
            except queue.Empty:
                if end_s is None:
                    continue
                return
            if isinstance(event, str):
                raise CommandError(f"the broker {self._params.url} {event}")
            if (found := self._update(event)) is not None:
                yield found

    def find(self, name: str, duration_s: float) -> Robot:
        """A robot by ``serial`` or ``manufacturer/serial``, once online, or known after ``duration_s``.

        The broker keeps what a robot has published by another version of the protocol before: the one online counts.
        Raises CommandError with the known ones.
        """

        def named() -> list[Robot]:
            return [
                item for item in self.robots.values() if name in (item.serial, f"{item.manufacturer}/{item.serial}")
            ]

        def online() -> list[Robot]:
            return [robot for robot in named() if robot.connection == "ONLINE"]

        for _ in self.updates(duration_s):
            if online():
                break
        match online() or named():
            case [robot]:
                return robot
            case []:
                known = ", ".join(sorted(robot.serial for robot in self.robots.values())) or "none"
                raise CommandError(f"the broker knows no robot {name!r}; robots that have connected: {known}")
            case several:
                raise CommandError(f"{name} is ambiguous: {', '.join(r.prefix for r in several)}")

    def send(self, robot: Robot, topic: Topic, data: Mapping[str, Any]) -> None:
        sent = self._client.publish(f"{robot.prefix}/{topic}", json.dumps(data), qos=0)
        sent.wait_for_publish(self._params.timeout_s)

    def _update(self, message: MQTTMessage) -> tuple[Robot, Topic] | None:
        found = robot_of(message.topic)
        if found is None or len(message.payload) > self._params.longest_message_bytes:
            return None
        prefix, topic = found
        try:
            data = json.loads(message.payload)
        except (ValueError, RecursionError):
            return None
        if not isinstance(data, dict) or not _flat(data):
            return None
        robot = self.robots.setdefault(prefix, Robot(prefix))
        robot.messages[topic] = data
        return robot, topic

    def _wait_for_connection(self) -> None:
        try:
            first = self._events.get(timeout=self._params.timeout_s)
        except queue.Empty:
            first = "does not answer"
        if first != "connected":
            raise CommandError(f"the broker {self._params.url} {first}")

    # --- in the client's thread --------------------------------------------------------------------------------------

    def _note(self, why: str) -> None:
        self._why = self._why or why

    def _put(self, event: MQTTMessage | str) -> None:
        try:
            self._events.put_nowait(event)
        except queue.Full:
            if isinstance(event, str):  # nothing more follows
                self._events.get_nowait()
                self._events.put_nowait(event)

    def _on_connect(
        self, client: Client, _data: Any, _flags: ConnectFlags, code: ReasonCode, _properties: Properties | None
    ) -> None:
        if code.is_failure:
            self._put(f"refuses the connection: {code}")
            return
        self._put("connected")
        client.subscribe([(f"+/+/+/+/{topic}", 1 if topic is Topic.CONNECTION else 0) for topic in PUBLISHED])

    def _on_message(self, _client: Client, _data: Any, message: MQTTMessage) -> None:
        self._put(message)

    def _on_disconnect(
        self, _client: Client, _data: Any, _flags: Any, code: ReasonCode, _properties: Properties | None
    ) -> None:
        if code.is_failure:
            self._put(f"lost the connection: {self._why or str(code)}")


def _flat(root: Any) -> bool:
    """False if nested so deep that comparing or printing it could exhaust the stack."""
    level = [root]
    for _ in range(_DEEPEST):
        inner = [value.values() if isinstance(value, dict) else value for value in level]
        level = [item for values in inner for item in values if isinstance(item, dict | list)]
        if not level:
            return True
    return False
