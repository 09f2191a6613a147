"""MQTT clients with the parameters of the fleet's broker."""

from __future__ import annotations

import os
import ssl
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from paho.mqtt.client import MQTT_CLEAN_START_FIRST_ONLY, Client
from paho.mqtt.enums import CallbackAPIVersion, LogLevel, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from robot_stack.fleet.mqtt_params import BrokerParams

_PROTOCOLS: Final = {"3.1.1": MQTTProtocolVersion.MQTTv311, "5": MQTTProtocolVersion.MQTTv5}
_PACKET_OVERHEAD: Final = 1024  # topic, length and properties of a message
# Errors of TLS whose names do not say what is wrong.
_TLS_REASONS: Final = {
    "CERTIFICATE_REQUIRED": "the broker requires a client certificate",
    "UNKNOWN_CA": "the broker does not accept the authority of this client's certificate",
    "CERTIFICATE_EXPIRED": "the broker rejects this client's certificate as expired",
    "CERTIFICATE_REVOKED": "the broker rejects this client's certificate as revoked",
    "EOF_OCCURRED_IN_VIOLATION": "the broker ended it, as it does for a client certificate that it does not accept",
    "WRONG_VERSION_NUMBER": "no TLS at this port",
    "KEY_VALUES_MISMATCH": "the key does not belong to the certificate",
}


def tls_context(params: BrokerParams) -> ssl.SSLContext | None:
    """From the files as they are; None without TLS. Raises OSError that names the file."""
    if not params.tls:
        return None
    context = ssl.create_default_context()
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    if params.ca_file:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        _load(params.ca_file, lambda: context.load_verify_locations(params.ca_file))
    if params.certificate_file:
        # Without a password, the library would ask for one on the terminal.
        _load(
            f"{params.certificate_file} with {params.key_file}",
            lambda: context.load_cert_chain(params.certificate_file, params.key_file, password=b""),
        )
    return context


def _load(what: str, load: Callable[[], None]) -> None:
    try:
        load()
    except (OSError, ValueError) as error:  # ValueError: an encrypted key
        number = getattr(error, "errno", None)
        text = tls_reason(str(error)) if isinstance(error, ssl.SSLError) or not number else os.strerror(number)
        raise OSError(f"{what} cannot be used: {text}") from error


def tls_reason(text: str) -> str:
    """An error of TLS in words; other text unchanged."""
    return next((words for name, words in _TLS_REASONS.items() if name in text.upper().replace(" ", "_")), text)


def files_stamp(params: BrokerParams) -> tuple[tuple[int, int, int] | None, ...]:
    """Differs after a change of one of the files."""
    return tuple(
        _stamp(name)
        for name in (params.ca_file, params.certificate_file, params.key_file, params.password_file)
        if name
    )


def _stamp(name: str) -> tuple[int, int, int] | None:
    try:
        status = os.stat(name)
    except OSError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns


def mqtt_client(params: BrokerParams, client_id: str, *, persistent: bool, on_error: Callable[[str], None]) -> Client:
    """A client that is not connected yet. on_error: receives errors of the connection in words.

    Raises OSError if a file cannot be used.
    """
    v5 = params.protocol == "5"
    client = Client(
        CallbackAPIVersion.VERSION2,
        client_id,
        clean_session=None if v5 else not persistent,
        protocol=_PROTOCOLS[params.protocol],
        reconnect_on_failure=False,
    )
    client.connect_timeout = params.timeout_s
    if context := tls_context(params):
        client.tls_set_context(context)
    if params.user_name:
        client.username_pw_set(params.user_name, _password(params.password_file))

    def log(_client: Client, _userdata: Any, level: int, text: str) -> None:
        if level == LogLevel.MQTT_LOG_ERR:
            on_error(tls_reason(text))

    client.on_log = log
    return client


def connect(client: Client, params: BrokerParams, *, persistent: bool) -> None:
    """Opens the socket and requests the connection; ``on_connect`` receives the answer. Raises OSError."""
    properties, clean_start = None, MQTT_CLEAN_START_FIRST_ONLY  # the only value for 3.1.1
    if params.protocol == "5":
        properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
        properties.SessionExpiryInterval = params.session_s if persistent else 0
        properties.MaximumPacketSize = params.longest_message_bytes + _PACKET_OVERHEAD
        clean_start = not persistent
    try:
        client.connect(params.host, params.port, params.keep_alive_s, clean_start=clean_start, properties=properties)
    except ssl.SSLCertVerificationError as error:
        raise OSError(f"the broker's certificate is not trusted: {error.verify_message}") from error
    except ssl.SSLError as error:
        raise OSError(tls_reason(str(error))) from error


def _password(name: str) -> str | None:
    if not name:
        return None
    try:
        return Path(name).read_text(encoding="utf-8").split("\n", 1)[0].rstrip("\r")
    except OSError as error:
        raise OSError(f"{name} cannot be read: {error.strerror}") from error
