"""Parameters of the broker: security, and no secret in a message."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from robot_stack.fleet.mqtt_params import BrokerParams


@pytest.mark.parametrize(
    ("url", "host", "port", "tls"),
    [
        ("mqtts://broker.example", "broker.example", 8883, True),
        ("mqtts://10.0.0.7:9000", "10.0.0.7", 9000, True),
        ("mqtt://localhost", "localhost", 1883, False),
        ("mqtt://[::1]:1884/", "::1", 1884, False),
    ],
)
def test_url(url: str, host: str, port: int, tls: bool) -> None:
    params = BrokerParams(url=url)
    assert (params.host, params.port, params.tls) == (host, port, tls)


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"url": "mqtt://broker.example"}, "use mqtts://, or set allow_plain"),
        ({"url": "mqtt://localhost.example"}, "use mqtts://"),
        ({"url": "http://localhost"}, "must read mqtt://host:port"),
        ({"url": "mqtts://host/topic"}, "must read mqtt://host:port"),
        ({"url": "mqtts://host:99999"}, "range"),
        ({"url": "mqtts://host", "certificate_file": "/c"}, "belong together"),
        ({"url": "mqtt://localhost", "ca_file": "/c"}, "need an url with mqtts://"),
        ({"url": "mqtts://host", "password_file": "/p"}, "needs user_name"),
        ({"url": "mqtts://host", "first_back_off_s": 5.0, "longest_back_off_s": 1.0}, "longest_back_off_s"),
        ({"url": "mqtts://host", "protocol": "3.1"}, "3.1.1"),
    ],
)
def test_wrong_fields_are_rejected(fields: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        BrokerParams(**fields)


def test_plain_connection_beyond_this_computer_must_be_allowed() -> None:
    assert not BrokerParams(url="mqtt://broker.example", allow_plain=True).tls


def test_password_in_the_url_is_rejected_without_repeating_it() -> None:
    with pytest.raises(ValidationError) as caught:
        BrokerParams(url="mqtts://robot:secret@host")
    assert "password_file" in str(caught.value.errors()[0]["msg"])
    assert "secret" not in caught.value.errors()[0]["msg"]
