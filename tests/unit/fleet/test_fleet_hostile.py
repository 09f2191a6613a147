"""Hostile masters: whatever arrives, the agent goes on, its states are valid, and only released nodes are driven."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.link import Topic
from tests.unit.fleet.master import HEADER, PARAMS, Bench, Data, action, error_types, node, node_ids, order, route

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


@FEW
@given(topics, st.binary(max_size=200))
def test_bytes(topic: Topic, payload: bytes) -> None:
    bench = Bench()
    bench.send(topic, payload)
    goes_on(bench)


@FEW
@given(topics, json_values)
def test_json(topic: Topic, value: Any) -> None:
    bench = Bench()
    bench.send(topic, json.dumps(value).encode())
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


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.data())
def test_messages_with_one_wrong_part(data: st.DataObject) -> None:
    bench = Bench()
    actions = [action("pick", stationName="chair_1"), action("drop"), action("wait", duration=1.0)]
    good: Data = order([node("a", 0, 0.0), node("b", 2, 2.0, *actions), node("c", 4, 4.0, released=False)])
    bench.order(_mutated(data, good))
    position = action("initPosition", x=0.0, y=0.0, theta=0.0, mapId="yard", lastNodeId="n")
    message = HEADER | {"actions": [position, action("startPause"), action("cancelOrder")]}
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


@settings(max_examples=150, deadline=None, derandomize=True)
@given(updates)
def test_stale_updates_replays_and_mixed_orders(messages: list[tuple[str, int, int, int, int, bool]]) -> None:
    """The route handed over is that of the accepted base: in sequence, without a gap, each node once."""
    bench = Bench()
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


def test_a_flood_is_limited_in_each_tick_and_reported() -> None:
    bench = Bench()
    for index in range(1000):
        payload = json.dumps(order(route("a", "b"), f"order_{index}")).encode()
        bench.kernel.receive(Topic.ORDER, payload)
    bench.tick()
    assert error_types(bench.state)
    for _ in range(20):
        bench.tick()
    assert len(bench.manager.added) == 1
    assert ErrorType.ORDER in error_types(bench.state)
    assert len(bench.state["errors"]) <= 20
    goes_on(bench)


def test_a_huge_horizon_is_refused() -> None:
    bench = Bench()
    state = bench.order(order(route(*(f"n{i}" for i in range(2000)), horizon=1990)))
    assert error_types(state) in (["orderError"], ["validationError"])
    assert bench.manager.added == []


def test_actions_without_end_are_refused() -> None:
    bench = Bench()
    waits = [
        action("wait", f"{n}.{i}", duration=0.0) for n in range(100) for i in range(PARAMS.limits.actions_per_node)
    ]
    per = PARAMS.limits.actions_per_node
    nodes = [node(f"n{n}", 2 * n, 2.0 * n, *waits[n * per : (n + 1) * per]) for n in range(100)]
    assert error_types(bench.order(order(nodes))) == ["orderError"]
