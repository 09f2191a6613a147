"""Messages as bytes: what is refused, and by what error."""

from __future__ import annotations

import json
from typing import Any

import pytest
from vda5050 import model
from vda5050.serialization import decode as sdk_decode

from robot_stack.fleet import codec
from robot_stack.fleet.errors import ErrorType, Refused
from robot_stack.fleet.factsheet import factsheet
from robot_stack.fleet.headers import BLOCK, ConnectionMessages, Headers
from robot_stack.fleet.link import Topic
from robot_stack.fleet.version import Version
from tests.unit.fleet.master import HEADER, PARAMS, ROBOT, VEHICLE, Bench, action, order, route

GOOD = order(route("a", "b"))
TEXT = json.dumps(GOOD)
LIMIT = PARAMS.limits.message_bytes


def decode(payload: str | bytes, topic: Topic = Topic.ORDER) -> codec.Data:
    return codec.decode(topic, payload.encode() if isinstance(payload, str) else payload, LIMIT, Version.V2)


def test_a_good_order_is_read() -> None:
    assert decode(TEXT) == GOOD


@pytest.mark.parametrize(
    ("payload", "why"),
    [
        (b"", "JSON"),
        (b"\xff\xfe", "JSON"),
        ("[" * 100_000, "JSON"),
        (TEXT.replace('"x": 0.0', '"x": NaN'), "NaN"),
        (TEXT.replace('"x": 0.0', '"x": -Infinity'), "Infinity"),
        (TEXT.replace('"x": 0.0', '"x": 1e999'), "out of range"),
        (TEXT.replace('"x": 0.0', f'"x": {10**30}'), "out of range"),
        (TEXT.replace('"x": 0.0', '"x": ' + "9" * 5000), "JSON"),
        (TEXT.replace('"x": 0.0', '"x": 0.0, "x": 1.0'), "twice"),
        (TEXT.replace('"a"', '"\\ud800"', 1), "JSON"),
        (json.dumps(GOOD | {"nodes": {}}), "nodes"),
        (json.dumps(GOOD | {"orderUpdateId": -1}), "orderUpdateId"),
        (json.dumps(GOOD | {"orderUpdateId": True}), "orderUpdateId"),
        (json.dumps(GOOD | {"timestamp": "yesterday"}), "timestamp"),
        (json.dumps(GOOD | {"timestamp": "2026-02-30T00:00:00Z"}), "timestamp"),
        (json.dumps({key: value for key, value in GOOD.items() if key != "orderId"}), "orderId"),
        ("null", "null" and "None"),
        ("[]", "[]"),
        (TEXT.replace('"actions": []', '"actions": [{"actionType": "wait", "actionId": "w"}]', 1), "blockingType"),
        (json.dumps(GOOD | {"nested": json.loads("[" * 20 + "]" * 20)}), "nested"),
        (TEXT + " " * LIMIT, "bytes"),
    ],
)
def test_a_malformed_message_is_a_validation_error(payload: str | bytes, why: str) -> None:
    with pytest.raises(Refused, match=why.replace("[]", r"\[\]")) as refused:
        decode(payload)
    assert refused.value.error.type == ErrorType.VALIDATION
    assert ("topic", "order") in refused.value.error.references


def test_the_refused_order_is_named() -> None:
    with pytest.raises(Refused) as refused:
        decode(json.dumps(GOOD | {"edges": None}))
    assert dict(refused.value.error.references) == {
        "topic": "order",
        "headerId": "1",
        "orderId": "order_1",
        "orderUpdateId": "0",
    }


def test_an_error_stays_short() -> None:
    with pytest.raises(Refused) as refused:
        decode(json.dumps(GOOD | {"orderId": "x" * 10_000, "nodes": "y" * 10_000}))
    assert len(json.dumps(refused.value.error.data(Version.V2))) < 2000


def test_the_robot_sends_nothing_that_the_schema_forbids() -> None:
    with pytest.raises(ValueError, match="connectionState"):
        codec.encode(Topic.CONNECTION, HEADER | {"connectionState": "ASLEEP"}, Version.V2)


def test_a_paused_action_may_be_reported_as_the_specification_has_it() -> None:
    state = Bench().tick() | {"actionStates": [{"actionId": "a", "actionStatus": "PAUSED"}]}
    assert b"PAUSED" in codec.encode(Topic.STATE, state, Version.V2)


def test_timestamps_are_utc_in_ms() -> None:
    assert codec.timestamp(1.7e9 + 0.1239) == "2023-11-14T22:13:20.124Z"


def test_the_factsheet_follows_its_schema_and_the_sdk_reads_it() -> None:
    data = HEADER | factsheet(ROBOT, VEHICLE, PARAMS)
    sheet = sdk_decode(codec.encode(Topic.FACTSHEET, data, Version.V2), model.Factsheet)
    assert {one.action_type for one in sheet.protocol_features.agv_actions} >= {"pick", "drop", "cancelOrder"}


def test_the_sdk_reads_a_state_of_an_order_under_way() -> None:
    bench = Bench()
    nodes = route("a", "b", "c", horizon=1)
    nodes[1]["actions"] = [action("wait", duration=1.0)]
    state = bench.order(order(nodes))
    read = sdk_decode(json.dumps(state), model.State)
    assert [one.node_id for one in read.node_states] == ["b", "c"]
    assert read.action_states[0].action_id == "wait"


def test_header_ids_are_counted_for_each_topic() -> None:
    bench = Bench()
    bench.kernel.connected()
    for _ in range(60):
        bench.tick()
    for topic in (Topic.STATE, Topic.VISUALIZATION, Topic.FACTSHEET):
        numbers = [data["headerId"] for sent, data in bench.sent if sent is topic]
        assert numbers == list(range(len(numbers)))
        assert numbers


def test_no_header_id_comes_again_after_a_restart() -> None:
    bench = Bench()
    for _ in range(5):
        bench.tick()
        bench.restart()
        bench.kernel.connected()
    numbers = [data["headerId"] for topic, data in bench.sent if topic is Topic.STATE]
    assert len(set(numbers)) == len(numbers) == 5


def test_header_ids_of_a_long_run_are_reserved_in_time() -> None:
    headers = Headers(PARAMS.identity, Version.V2, {})
    for _ in range(3 * BLOCK):
        reserved = headers.reserve()["state"]
        assert headers.next(Topic.STATE, 0.0)["headerId"] < reserved


def test_the_connection_is_announced() -> None:
    messages = ConnectionMessages(Headers(PARAMS.identity, Version.V2, {}), lambda: 1.7e9)
    sent: list[Any] = [json.loads(make()) for make in (messages.broken, messages.online, messages.offline)]
    assert [one["connectionState"] for one in sent] == ["CONNECTIONBROKEN", "ONLINE", "OFFLINE"]
    assert [one["headerId"] for one in sent] == [0, 1, 2]
