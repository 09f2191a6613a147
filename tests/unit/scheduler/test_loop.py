"""When a node wakes, which messages it takes, and how long it is busy."""

from __future__ import annotations

import pytest
from std_msgs.msg import Int32

from sim.scheduler.events import EventQueue
from tests.unit.scheduler.rig import constant, params, rig, row


def test_events_come_by_time_then_order_then_sequence() -> None:
    queue, seen = EventQueue(), []
    for time_ns, order, name in ((5, 2, "c"), (5, 1, "b"), (5, 2, "d"), (1, 9, "a")):
        queue.push(time_ns, order, seen.append, name)
    assert not queue.run(5)
    assert seen == ["a", "b", "c", "d"]
    with pytest.raises(ValueError, match="in the past"):
        queue.push(4, 0, seen.append, "e")


def test_a_run_ends_at_its_time_by_its_condition_or_when_it_is_stopped() -> None:
    with rig() as stage:
        scheduler, seen = stage.scheduler, []
        scheduler.every(100_000_000, lambda: seen.append(scheduler.now_s))
        assert not scheduler.run(0.25)
        assert (scheduler.now_s, seen) == (0.25, [0.0, 0.1, 0.2])
        assert scheduler.run(1.0, lambda: len(seen) == 5)
        assert scheduler.now_s == 0.4
        scheduler.at(450_000_000, scheduler.stop)
        assert not scheduler.run(1.0)
        assert scheduler.now_s == 0.45


def test_timers_come_at_exact_periods() -> None:
    times = []
    with rig() as stage:
        stage.node("node", lambda port: port.add_timer(0.05, lambda: times.append(stage.scheduler.now_ns)))
        stage.scheduler.run(10.01)
    # The schedule starts with the construction at 10 ms, whose 50 ms end exactly at the first tick. Timers use floating
    # point, hence a few nanoseconds.
    assert [round(item, -3) for item in times] == [60_000_000 + 50_000_000 * k for k in range(199)]


def test_a_tick_that_is_missed_is_not_made_up_for() -> None:
    times = []
    with rig(given=params(compute={"default": constant(120.0), "names": {}})) as stage:
        stage.node("node", lambda port: port.add_timer(0.05, lambda: times.append(round(1e3 * stage.scheduler.now_s))))
        stage.scheduler.run(0.5)
    assert times == [60, 180, 300, 420]


def test_message_without_wake_up_is_delivered_at_next_tick() -> None:
    topic, seen = row(), []

    def build(port) -> None:
        port.subscribe(topic, topic.name, lambda m, _: seen.append(m.data), 5, wakes=False, raw=False)
        port.add_timer(0.1, lambda: seen.append("tick"))

    with rig() as stage:
        stage.talker(topic)
        stage.node("node", build)
        stage.scheduler.run(0.25)
        del seen[:]
        stage.say(260.0, 1, topic)
        stage.say(265.0, 2, topic)
        stage.scheduler.run(0.30)
        assert seen == []
        stage.scheduler.run(0.31)
    assert seen == [1, 2, "tick"]


def test_a_wake_up_takes_urgent_messages_then_the_others_then_calls_then_timers() -> None:
    urgent, lazy, seen = row("/urgent"), row("/lazy"), []

    def build(port) -> None:
        port.subscribe(lazy, "/lazy", lambda m, _: seen.append("lazy"), 5, wakes=False, raw=False)
        port.subscribe(urgent, "/urgent", on_urgent, 5, wakes=True, raw=False)
        port.add_timer(0.1, lambda: seen.append("tick"))

        def later() -> None:
            port.call_soon(lambda: seen.append("soon"), wakes=False)

        stage.scheduler.at(305_000_000, later)

    def on_urgent(message: Int32, _: float) -> None:
        seen.append("urgent")

    with rig(given=params(latency={**params().latency.model_dump(), "rows": {"/urgent": constant(10.0)}})) as stage:
        stage.talker(urgent, "a")
        stage.talker(lazy, "b")
        stage.node("node", build)
        stage.scheduler.run(0.29)
        del seen[:]
        stage.say(300.0, 1, urgent, "a")  # arrives at 310 ms, with the tick
        stage.say(301.0, 1, lazy, "b")
        stage.scheduler.run(0.32)
    assert seen == ["urgent", "lazy", "soon", "tick"]


def test_messages_of_a_wake_up_leave_at_its_end_and_stamps_are_of_its_begin() -> None:
    topic, stamps = row(), []

    def build(port) -> None:
        publisher = port.advertise(topic, topic.name)

        def tick() -> None:
            stamps.append((port.now_ns() - stage.scheduler.clock_start_ns) // 1_000_000)
            publisher.publish(Int32(data=len(stamps)))

        port.add_timer(0.1, tick)

    with rig() as stage:
        stage.node("node", build)
        taken = stage.listener(topic)
        stage.scheduler.run(0.35)
    assert stamps == [110, 210, 310]
    assert taken == [(214.0, 2), (314.0, 3)]  # 3 ms of computing, 1 ms of latency; first sent before discovery


def test_a_call_from_outside_wakes_the_loop() -> None:
    seen = []
    with rig() as stage:
        stage.node("node")
        stage.scheduler.run(0.3)
        port = stage.port("node")
        port.call_soon(lambda: seen.append("asleep"), wakes=False)
        stage.scheduler.run(0.4)
        assert seen == []
        port.call_soon(lambda: seen.append("awake"))
        stage.scheduler.run(0.5)
    assert seen == ["asleep", "awake"]


def test_a_timer_that_is_added_outside_the_loop_is_kept() -> None:
    seen = []
    with rig() as stage:
        stage.node("node")
        stage.scheduler.run(0.305)
        timer = stage.port("node").add_timer(0.1, lambda: seen.append(round(1e3 * stage.scheduler.now_s)))
        stage.scheduler.run(0.55)
        timer.destroy()
        stage.scheduler.run(1.0)
    assert seen == [310, 410, 510]


def test_nodes_of_one_process_are_busy_together() -> None:
    topic = row()
    with rig(given=params(compute={"default": constant(3.0), "names": {"slow": constant(200.0)}})) as stage:
        from tests.unit.scheduler.rig import Bare

        taken = []

        def fast(port) -> None:
            port.subscribe(
                topic,
                topic.name,
                lambda m, _: taken.append(round(1e3 * stage.scheduler.now_s)),
                5,
                wakes=True,
                raw=False,
            )

        stage.talker(topic)
        stage.scheduler.spawn("two", lambda: Bare("fast", fast), lambda: Bare("slow", lambda _: None))
        stage.scheduler.run(0.4)
        life = stage.scheduler.processes["two"].life
        stage.scheduler.at(400_000_000, life.ports[1].call_soon, lambda: None)
        stage.say(410.0, 1, topic)
        stage.scheduler.run(1.0)
    assert taken == [600]


def test_clocks() -> None:
    with rig() as stage:
        stage.node("node")
        stage.scheduler.run(1.0)
        port = stage.port("node")
        before = port.now_ns(), port.monotonic_s(), port.steady_s(), port.system_s()
        assert before[0] == stage.scheduler.clock_start_ns + 1_000_000_000
        stage.scheduler.step_system_clock(-30.0)
        stage.scheduler.run(2.0)
        assert port.now_ns() - before[0] == -29_000_000_000
        assert port.system_s() - before[3] == pytest.approx(-29.0)
        assert port.monotonic_s() - before[1] == pytest.approx(1.0)
        assert port.steady_s() - before[2] == pytest.approx(1.0)


def test_the_log_of_one_code_line_is_throttled() -> None:
    def build(port) -> None:
        def tick() -> None:
            port.logger.error("first", throttle_duration_sec=1.0)
            port.logger.info("second", throttle_duration_sec=0.5)
            port.logger.info("third", once=True)

        port.add_timer(0.1, tick)

    with rig() as stage:
        stage.node("node", build)
        stage.scheduler.run(2.05)
        lines = [(item.level, item.text, round(1e-6 * item.time_ns)) for item in stage.scheduler.log]
    assert [at for _, text, at in lines if text == "first"] == [110, 1110]
    assert [at for _, text, at in lines if text == "second"] == [110, 610, 1110, 1610]
    assert [item for item in lines if item[1] == "third"] == [("INFO", "third", 110)]
