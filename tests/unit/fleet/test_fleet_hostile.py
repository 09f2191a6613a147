"""Hostile masters: whatever arrives, the agent goes on, its states are valid, and only released nodes are driven."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.cli.fleet_site import LONGEST_PACKET_BYTES
from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.link import Topic
from robot_stack.fleet.version import Version
from tests.unit.fleet.master import (
    HEADER,
    PARAMS,
    Bench,
    Data,
    action,
    error_types,
    in_version,
    node,
    node_ids,
    order,
    route,
    statuses,
)

each_version = pytest.mark.parametrize("version", list(Version))
FEW = settings(max_examples=60, deadline=None, derandomize=True)

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
topics = st.sampled_from([Topic.ORDER, Topic.INSTANT_ACTIONS, Topic.STATE, Topic.ZONE_SET])


def goes_on(bench: Bench) -> None:
    """The next good order is carried out."""
    bench.instant(action("cancelOrder", "end of the attack"))
    for _ in range(3):
        bench.tick()
    assert node_ids(bench.order(order(route("a", "b"), "a good one"))) == ["b"]
    assert bench.serve(2)["lastNodeId"] == "b"


@each_version
@FEW
@given(topics, st.binary(max_size=200) | json_values.map(lambda value: json.dumps(value).encode()))
def test_bytes_and_json(version: Version, topic: Topic, payload: bytes) -> None:
    bench = Bench(version)
    bench.send(topic, payload)
    goes_on(bench)


def _mutated(data: st.DataObject, value: Any) -> Any:
    """With one part replaced by something else."""
    if isinstance(value, dict) and value and data.draw(st.booleans()):
        key = data.draw(st.sampled_from(sorted(value)))
        return value | {key: _mutated(data, value[key])}
    if isinstance(value, list) and value and data.draw(st.booleans()):
        index = data.draw(st.integers(0, len(value) - 1))
        return [*value[:index], _mutated(data, value[index]), *value[index + 1 :]]
    return data.draw(json_values)


@each_version
@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.data())
def test_messages_with_one_wrong_part(version: Version, data: st.DataObject) -> None:
    bench = Bench(version)
    actions = [action("pick", stationName="chair_1"), action("drop"), action("wait", duration=1.0)]
    good: Data = order([node("a", 0, 0.0), node("b", 2, 2.0, *actions), node("c", 4, 4.0, released=False)])
    bench.send(Topic.ORDER, _mutated(data, in_version(Topic.ORDER, good, version)))
    kind = "initializePosition" if version is Version.V3 else "initPosition"
    position = action(kind, x=0.0, y=0.0, theta=0.0, mapId="yard", lastNodeId="n")
    message = HEADER | {"actions": [position, action("startPause"), action("cancelOrder")]}
    message = in_version(Topic.INSTANT_ACTIONS, message, version)
    bench.send(Topic.INSTANT_ACTIONS, _mutated(data, message))
    goes_on(bench)


updates = st.lists(
    st.tuples(
        st.sampled_from(["one", "two"]),
        st.integers(0, 4),  # orderUpdateId
        st.integers(0, 4),  # index of the first node
        st.integers(1, 5),  # number of nodes
        st.integers(0, 3),  # of them not released
        st.booleans(),  # the robot serves a waypoint after it
    ),
    max_size=12,
)


@each_version
@settings(max_examples=150, deadline=None, derandomize=True)
@given(updates)
def test_stale_updates_replays_and_mixed_orders(
    version: Version, messages: list[tuple[str, int, int, int, int, bool]]
) -> None:
    """The route handed over is that of the accepted base: in sequence, without a gap, each node once."""
    bench = Bench(version)
    released: dict[str, set[int]] = {}
    for order_id, update, first, count, horizon, serves in messages:
        names = [f"n{first + index}" for index in range(count)]
        nodes = route(*names, first=2 * first, horizon=min(horizon, count - 1), x=2.0 * first)
        state = bench.order(order(nodes, order_id, update))
        if (state["orderId"], state["orderUpdateId"]) == (order_id, update):
            released.setdefault(order_id, set()).update(one["sequenceId"] for one in nodes if one["released"])
        if serves:
            bench.serve()
    for name in bench.manager.added:
        sequence = [stop.node for stop in bench.manager.orders[name]]
        assert sequence == list(range(sequence[0], sequence[0] + 2 * len(sequence), 2))
        assert set(sequence) <= released[name.rsplit("_", 1)[1]]


@each_version
def test_a_flood_is_limited_in_each_tick_and_reported(version: Version) -> None:
    bench = Bench(version)
    for index in range(1000):
        bench.receive(order(route("a", "b"), f"order_{index}"))
    bench.tick()
    assert error_types(bench.state)
    for _ in range(20):
        bench.tick()
    assert len(bench.manager.added) == 1
    assert bench.named(ErrorType.OTHER_ORDER)[0] in error_types(bench.state)
    assert len(bench.state["errors"]) <= 20
    goes_on(bench)


@each_version
def test_a_huge_horizon_is_refused(version: Version) -> None:
    bench = Bench(version)
    state = bench.order(order(route(*(f"n{i}" for i in range(2000)), horizon=1990)))
    assert error_types(state) in (bench.named(ErrorType.MEMORY), bench.named(ErrorType.VALIDATION))
    assert bench.manager.added == []


@each_version
def test_actions_without_end_are_refused(version: Version) -> None:
    bench = Bench(version)
    waits = [
        action("wait", f"{n}.{i}", duration=0.0) for n in range(100) for i in range(PARAMS.limits.actions_per_node)
    ]
    per = PARAMS.limits.actions_per_node
    nodes = [node(f"n{n}", 2 * n, 2.0 * n, *waits[n * per : (n + 1) * per]) for n in range(100)]
    assert error_types(bench.order(order(nodes))) == bench.named(ErrorType.MEMORY)


def test_a_late_copy_of_a_past_order_is_not_driven() -> None:
    bench = Bench()
    first = order(route("a", "b"), "first")
    bench.order(first)
    bench.serve(2)
    bench.order(order(route("a", "c"), "second"))
    bench.serve(2)
    state = bench.order(first)
    assert (state["orderId"], error_types(state)) == ("second", ["orderUpdateError"])
    assert len(bench.manager.added) == 2
    bench.restart()
    assert bench.order(first)["orderId"] == "second"


def test_a_late_copy_of_an_instant_action_has_no_effect() -> None:
    bench = Bench()
    bench.order(order(route("a", "b"), "first"))
    bench.instant(action("cancelOrder", "cancel"))
    bench.order(order(route("a", "b"), "second"))
    state = bench.instant(action("cancelOrder", "cancel"))
    assert (node_ids(state), error_types(state)) == (["b"], [])
    assert bench.serve(2)["lastNodeId"] == "b"


def test_past_ids_are_limited_and_known_for_hundreds_of_orders() -> None:
    bench = Bench()
    bench.order(order(route("a"), "the first"))
    forgotten = tuple(f"{number:016}" for number in range(980))
    bench.kernel.record = bench.kernel.record.model_copy(update={"past_orders": forgotten})
    for number in range(30):
        bench.order(order(route("a"), f"order {number}"))
        bench.instant(*(action("stateRequest", f"{number}.{index}") for index in range(10)))
    state = bench.order(order(route("a"), "the first"))
    assert (state["orderId"], error_types(state)) == ("order 29", ["orderUpdateError"])
    assert (len(bench.kernel.record.past_orders), len(bench.kernel.record.past_actions)) == (1000, 200)


def test_a_flood_displaces_no_message_of_another_topic() -> None:
    bench = Bench()
    bench.order(order(route("a", "b")))
    cancel = json.dumps(HEADER | {"actions": [action("cancelOrder")]}).encode()
    bench.kernel.receive(Topic.INSTANT_ACTIONS, cancel)
    for _ in range(100):
        bench.kernel.receive(Topic.ORDER, b"{}")
    for _ in range(5):
        bench.tick()
    assert statuses(bench.state) == {"cancelOrder": "FINISHED"}


def test_state_and_journal_stay_short() -> None:
    """Longer ones would end the connection, at a broker with a limit, again and again."""
    bench = Bench()
    wide = "\U0001f9d1" * 127

    def part(update: int) -> Data:
        names = [f"{wide}{index % 10}" for index in range(50 * update, 50 * update + 51)]
        data = order(route(*names, first=100 * update, x=100.0 * update), wide, update)
        return data | {"edges": [edge | {"edgeId": f"{wide}e"} for edge in data["edges"]]}

    for update in range(10):
        bench.order(part(update))
    for index in range(60):
        bench.instant(action("x" * 100_000 + wide, f"{index:02}{wide[2:]}"))
    for _ in range(30):
        bench.order(order(route(wide, wide, x=2.0), wide + "other"))
        bench.instant(*(action(wide * 100, f"{index}") for index in range(17)))
    assert 1 < bench.state["orderUpdateId"] < 9
    assert len(json.dumps(bench.state, ensure_ascii=False).encode()) < 0.9 * LONGEST_PACKET_BYTES
    assert len(bench.disk.encode()) < 0.9 * LONGEST_PACKET_BYTES


def test_the_id_of_a_load_is_limited() -> None:
    bench = Bench()
    pick = action("pick", stationName="chair_1", loadId="x" * 129)
    assert error_types(bench.order(order([node("a", 0, 0.0), node("b", 2, 2.0, pick)]))) == ["orderError"]


def test_a_tick_reads_few_long_messages() -> None:
    """Else their checks would last longer than the supervisor waits for the agent."""
    bench = Bench()
    long = json.dumps(order(route("a", "b")) | {"padding": "x" * (PARAMS.limits.message_bytes // 2)}).encode()
    for _ in range(4):
        bench.kernel.receive(Topic.ORDER, long)
    bench.kernel.receive(Topic.INSTANT_ACTIONS, json.dumps(HEADER | {"actions": [action("stateRequest")]}).encode())
    bench.tick()
    assert statuses(bench.tick()) == {}
    assert statuses(bench.tick()) == {"stateRequest": "FINISHED"}
