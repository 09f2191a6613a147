"""Parameters of the connection to the fleet's MQTT broker."""

from __future__ import annotations

import ipaddress
from typing import Annotated, Final, Literal, Self
from urllib.parse import urlsplit

from pydantic import Field, field_validator, model_validator

from robot_stack.core.config import Config, Positive

_PORTS: Final = {"mqtt": 1883, "mqtts": 8883}


class BrokerParams(Config):
    """Paths are absolute; an empty path or name is left out. The files are read at each connection.

    url: ``mqtt://host:port`` or ``mqtts://host:port``; by default port 1883 or 8883. It has no user and no password.
    protocol: of MQTT. VDA 5050 requires 3.1.1; with 5, the broker also keeps longer messages away from the robot.
    allow_plain: allows ``mqtt://`` to another host, where everyone on the way can read and change orders.
    ca_file: certificates that may sign the broker's; by default those of the operating system.
    certificate_file, key_file: the client's own. user_name, password_file: as an alternative; first line of the file.
    keep_alive_s: the broker publishes the last will after 1.5 times this silence.
    timeout_s: of the connection and of each answer of the broker.
    first_back_off_s, longest_back_off_s: pause after a failed connection, doubled after each further one.
    session_s: time for which a broker of protocol 5 keeps subscriptions and messages; with 3.1.1 the broker decides.
    check_files_s: period in which changes of the files are detected.
    queue_messages: limit of received messages, for each topic, that the node has not taken.
    longest_message_bytes: of a received message; longer ones are dropped unread.
    """

    url: str
    protocol: Literal["3.1.1", "5"] = "3.1.1"
    allow_plain: bool = False
    ca_file: str = ""
    certificate_file: str = ""
    key_file: str = ""
    user_name: str = ""
    password_file: str = ""
    keep_alive_s: Annotated[int, Field(ge=5, le=600)] = 15
    timeout_s: Annotated[float, Field(gt=0.0, le=30.0)] = 5.0
    first_back_off_s: Positive = 1.0
    longest_back_off_s: Positive = 30.0
    session_s: Annotated[int, Field(ge=0, le=2**31)] = 3600
    check_files_s: Positive = 2.0
    queue_messages: Annotated[int, Field(ge=1, le=10_000)] = 32
    longest_message_bytes: Annotated[int, Field(ge=1024, le=2**26)] = 1_048_576

    @property
    def tls(self) -> bool:
        return self.url.startswith("mqtts://")

    @property
    def host(self) -> str:
        return urlsplit(self.url).hostname or ""

    @property
    def port(self) -> int:
        parts = urlsplit(self.url)
        return parts.port or _PORTS[parts.scheme]

    @field_validator("url")
    @classmethod
    def _complete_url(cls, url: str) -> str:
        # The message must not repeat a password that was put into the URL.
        parts = urlsplit(url)
        if "@" in url:
            raise ValueError("must not contain a user name or password: use user_name and password_file")
        if parts.scheme not in _PORTS or not parts.hostname or parts.path.strip("/") or parts.query or parts.fragment:
            raise ValueError("must read mqtt://host:port or mqtts://host:port")
        _ = parts.port  # raises ValueError
        return url

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not self.tls and not self.allow_plain and not _is_local(self.host):
            raise ValueError(f"url: {self.host} is another host: use mqtts://, or set allow_plain")
        if not self.tls and (self.ca_file or self.certificate_file or self.key_file):
            raise ValueError("ca_file, certificate_file and key_file need an url with mqtts://")
        if bool(self.certificate_file) != bool(self.key_file):
            raise ValueError("certificate_file and key_file belong together")
        if self.password_file and not self.user_name:
            raise ValueError("password_file needs user_name")
        if self.longest_back_off_s < self.first_back_off_s:
            raise ValueError("longest_back_off_s must not be less than first_back_off_s")
        return self


def _is_local(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
