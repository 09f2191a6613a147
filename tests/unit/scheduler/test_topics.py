"""Messages: latency, order, queues, discovery, latched topics."""

from __future__ import annotations

import pytest
from std_msgs.msg import Int32

from robot_stack.contract import topics
from tests.unit.scheduler.rig import LATCHED, constant, params, rig, row


def test_a_row_has_its_own_latency_and_bulk_another() -> None:
    latency = {"small": constant(1.0), "bulk": constant(5.0), "call": constant(2.0), "rows": {"/slow": constant(40.0)}}
    slow, bulk = row("/slow"), row("/bulk", bulk=True)
    with rig(given=params(latency=latency)) as stage:
        stage.talker(slow, "a")
        stage.talker(bulk, "b")
        taken = stage.listener(slow, "on_slow"), stage.listener(bulk, "on_bulk")
        stage.say(300.0, 1, slow, "a")
        stage.say(300.0, 2, bulk, "b")
        stage.scheduler.run(1.0)
    assert taken == ([(340.0, 1)], [(305.0, 2)])


def test_messages_keep_their_order_although_latencies_differ() -> None:
    topic = row(depth=1000)
    wide = {"small": {"median_ms": 1.0, "p99_ms": 50.0}, "bulk": constant(5.0), "call": constant(2.0), "rows": {}}
    with rig(given=params(latency=wide)) as stage:
        stage.talker(topic)
        taken = stage.listener(topic)
        for number in range(300):
            stage.say(300.0 + 0.5 * number, number, topic)
        stage.scheduler.run(2.0)
    assert [value for _, value in taken] == list(range(300))


def test_a_queue_of_one_keeps_the_newest_while_its_node_is_busy() -> None:
    topic = row()
    with rig(given=params(compute={"default": constant(50.0), "names": {}})) as stage:
        stage.talker(topic)
        taken, deep = stage.listener(topic, depth=1), stage.listener(topic, "deep", depth=3)
        for number in range(6):
            stage.say(300.0 + number, number, topic)
        stage.scheduler.run(1.0)
    assert taken == [(301.0, 0), (351.0, 5)]  # the others arrived during its 50 ms of computation
    assert deep == [(301.0, 0), (351.0, 3), (351.0, 4), (351.0, 5)]


def test_late_subscriber_receives_latched_but_not_volatile_messages() -> None:
    latched, volatile = row("/latched", durability=LATCHED, depth=2), row("/volatile")
    with rig() as stage:
        stage.talker(latched, "a")
        stage.talker(volatile, "b")
        for number in range(4):
            stage.say(300.0 + number, number, latched, "a")
            stage.say(300.0 + number, number, volatile, "b")
        kept = stage.listener(latched, "late", at_s=1.0)
        lost = stage.listener(volatile, "late_too", at_s=1.0)
        stage.scheduler.run(2.0)
    # start 10, construction 50, discovery 100, latency 1 ms
    assert kept == [(1161.0, 2), (1161.0, 3)]
    assert lost == []


def test_messages_published_before_discovery_are_lost() -> None:
    topic = row()
    with rig() as stage:
        taken = stage.listener(topic)
        stage.talker(topic)
        for at_ms in (61.0, 150.0, 160.0, 161.0):  # constructed at 60 ms, discovered at 160 ms
            stage.say(at_ms, round(at_ms), topic)
        counts: list[int] = []
        for at_ms in (150, 170):
            stage.scheduler.at(
                at_ms * 1_000_000, lambda: counts.append(stage.publisher(topic).get_subscription_count())
            )
        stage.scheduler.run(1.0)
    assert [value for _, value in taken] == [161]
    assert counts == [0, 1]


def test_subscribers_share_no_state_with_publisher_or_each_other() -> None:
    topic, got = row(), []
    message = Int32(data=1)
    with rig() as stage:
        stage.talker(topic)
        for name in ("one", "two"):
            stage.node(
                name,
                lambda port: port.subscribe(topic, topic.name, lambda m, _: got.append(m), 1, wakes=True, raw=False),
            )
        stage.scheduler.run(0.3)
        stage.publisher(topic).publish(message)
        message.data = 2
        stage.scheduler.run(0.4)
    assert [item.data for item in got] == [1, 1]
    assert got[0] is not got[1]


def test_bytes_may_be_published_and_received_as_they_are() -> None:
    topic, got, data = row(), [], bytes([0, 1, 0, 0, 5, 0, 0, 0])
    with rig() as stage:
        stage.talker(topic)
        taken = stage.listener(topic)
        stage.node("raw", lambda port: port.listen(topic, lambda *item: got.append(item), raw=True, wakes=True))
        stage.scheduler.run(0.3)
        stage.publisher(topic).publish(data)
        stage.scheduler.run(0.4)
        start_ns = stage.scheduler.clock_start_ns
    assert [value for _, value in taken] == [5]
    assert got == [(data, start_ns + 301_000_000, start_ns + 300_000_000)]


def test_a_cloud_comes_as_a_view_on_the_bytes() -> None:
    from sensor_msgs.msg import PointCloud2

    from robot_stack.middleware.wire import CloudView

    got = []
    with rig() as stage:
        stage.node("driver", lambda port: got.append(port.advertise(topics.LIDAR_POINTS, "/points")))
        stage.node(
            "reader",
            lambda port: port.subscribe(
                topics.LIDAR_POINTS, "/points", lambda m, _: got.append(m), 1, wakes=True, raw=False
            ),
        )
        stage.scheduler.run(0.3)
        got[0].publish(PointCloud2(height=1, width=4, data=bytes(range(4))))
        stage.scheduler.run(0.4)
    assert isinstance(got[1], CloudView)
    assert got[1].data.tolist() == [0, 1, 2, 3]


def test_the_time_of_reception_is_that_of_the_arrival() -> None:
    """A message that does not wake its node waits in the queue; its age counts from its arrival."""
    topic, ages = row(), []

    def build(port) -> None:
        port.subscribe(
            topic, topic.name, lambda _, at_s: ages.append(port.steady_s() - at_s), 1, wakes=False, raw=False
        )
        port.add_timer(0.1, lambda: None)

    with rig() as stage:
        stage.talker(topic)
        stage.node("slow", build)
        stage.say(329.0, 1, topic)  # arrives at 330, taken at the tick at 410, as the schedule starts at 10 ms
        stage.scheduler.run(1.0)
    assert ages == [pytest.approx(0.08)]


def test_a_subscription_that_ended_gets_nothing_and_is_not_counted() -> None:
    topic = row()
    taken, subscriptions = [], []

    def build(port) -> None:
        subscriptions.append(
            port.subscribe(topic, topic.name, lambda m, _: taken.append(m.data), 5, wakes=True, raw=False)
        )

    with rig() as stage:
        stage.talker(topic)
        stage.node("listener", build)
        stage.scheduler.run(0.3)
        stage.publisher(topic).publish(Int32(data=1))
        stage.scheduler.run(0.4)
        stage.publisher(topic).publish(Int32(data=2))
        subscriptions[0].end()  # the second is on its way
        stage.scheduler.run(0.5)
        assert stage.publisher(topic).get_subscription_count() == 0
    assert taken == [1]


def test_the_graph_shows_endpoints_once_they_are_discovered() -> None:
    topic, seen = row(), []
    with rig() as stage:
        stage.talker(topic)
        stage.listener(topic)
        for at_ms in (100, 200):
            stage.scheduler.at(
                at_ms * 1_000_000,
                lambda: seen.append(
                    (
                        stage.port("listener").publisher_nodes(topic.name),
                        stage.port("talker").count_subscribers(topic.name),
                        stage.port("listener").count_subscribers(topic.name),
                        stage.port("listener").node_names(),
                    )
                ),
            )
        stage.scheduler.run(0.3)
    assert seen == [([], 0, 1, ["listener"]), (["talker"], 1, 1, ["talker", "listener"])]
