"""Processes that are killed, hang, crash, stop and restart."""

from __future__ import annotations

import pytest
from std_msgs.msg import Int32

from robot_stack.core.config import ConfigError
from robot_stack.core.node_record import NodeRecords
from sim.scheduler import Observer
from sim.scheduler.observers import LifeChange
from sim.scheduler.port import MissingDevice
from tests.unit.scheduler.rig import Bare, rig, row


class Changes(Observer):
    def __init__(self) -> None:
        self.seen: list[tuple[int, str, LifeChange]] = []

    def on_life_change(self, time_ns: int, process: str, change: LifeChange) -> None:
        self.seen.append((time_ns // 1_000_000, process, change))


def counter(topic):
    """Builds a node that publishes 1, 2, 3 ... at 10 Hz, starting again in each life."""

    def build(port) -> None:
        publisher, said = port.advertise(topic, topic.name), []

        def tick() -> None:
            said.append(0)
            publisher.publish(Int32(data=len(said)))

        port.add_timer(0.1, tick)

    return build


def test_messages_sent_before_kill_arrive_and_unsent_ones_are_lost() -> None:
    topic = row()
    with rig() as stage:
        process = stage.node("node", counter(topic))
        taken = stage.listener(topic)
        # The node ticks at 310 and 410 ms; messages leave 3 ms later and take 1 ms.
        stage.scheduler.at(313_500_000, process.kill)
        stage.scheduler.run(1.0)
        assert [value for _, value in taken] == [2, 3]
        assert process.exit_code == -9
        process.start()
        stage.scheduler.at(
            1_000_000_000 + 10_000_000 + 302_000_000, process.kill
        )  # within the wake-up of its third tick
        stage.scheduler.run(2.0)
        assert [value for _, value in taken] == [2, 3, 2]


def test_a_killed_process_is_counted_until_its_lease_ends_and_a_stopped_one_is_not() -> None:
    topic = row()
    counts = []
    with rig() as stage:
        stage.talker(topic)
        stage.listener(topic, "killed")
        stage.listener(topic, "stopped")
        stage.scheduler.run(0.3)
        stage.scheduler.processes["killed"].kill()
        stage.scheduler.processes["stopped"].stop()
        for at_s in (0.31, 0.4, 2.2, 2.4):
            stage.scheduler.run(at_s)
            counts.append((stage.publisher(topic).get_subscription_count(), stage.port("talker").node_names()))
    assert counts == [
        (2, ["talker", "killed", "stopped"]),
        (1, ["talker", "killed"]),
        (1, ["talker", "killed"]),
        (0, ["talker"]),
    ]


def test_a_stopped_process_leaves_its_outputs_safe() -> None:
    topic, nodes = row(), []

    class Safe(Bare):
        def __init__(self) -> None:
            super().__init__("node", lambda port: None)
            self.output = self.port.advertise(topic, topic.name)
            nodes.append(self)

        def safe_output(self) -> None:
            super().safe_output()
            self.output.publish(Int32(data=-1))

    with rig() as stage:
        process = stage.scheduler.spawn("node", Safe)
        taken = stage.listener(topic)
        stage.scheduler.at(300_000_000, process.stop)
        stage.scheduler.run(1.0)
        assert process.exit_code == 0
    assert nodes[0].ended == ["safe", "destroyed"]
    assert taken == [(304.0, -1)]


def test_a_safe_output_may_wait_for_an_answer() -> None:
    topic, answer, seen = row("/question"), row("/answer"), []

    class Waiting(Bare):
        def __init__(self) -> None:
            super().__init__("node", lambda port: None)
            self.ask, self.got = self.port.advertise(topic, topic.name), []
            self.port.subscribe(answer, answer.name, lambda m, _: self.got.append(m.data), 1, wakes=True, raw=False)

        def safe_output(self) -> None:
            self.ask.publish(Int32(data=1))
            self.port.wait_until(lambda: bool(self.got), 0.5, loop=True)
            seen.append((stage.scheduler.now_s, self.got))

    def echo(port) -> None:
        publisher = port.advertise(answer, answer.name)
        port.subscribe(topic, topic.name, lambda m, _: publisher.publish(m), 1, wakes=True, raw=False)

    with rig() as stage:
        process = stage.scheduler.spawn("node", Waiting)
        stage.node("echo", echo)
        stage.scheduler.at(300_000_000, process.stop)
        stage.scheduler.run(1.0)
        assert not process.alive
    assert seen == [(pytest.approx(0.308), [1])]  # 3 + 1 + 3 + 1 ms


def test_a_process_may_be_killed_while_its_safe_output_waits() -> None:
    class Waiting(Bare):
        def safe_output(self) -> None:
            self.port.wait_until(lambda: False, 0.5, loop=True)

    changes = Changes()
    with rig() as stage:
        stage.scheduler.add_observer(changes)
        process = stage.scheduler.spawn("node", lambda: Waiting("node", lambda _: None))
        stage.scheduler.at(300_000_000, process.stop)
        stage.scheduler.at(400_000_000, process.kill)
        stage.scheduler.run(1.0)
        assert process.exit_code == -9
    assert changes.seen[-1] == (400, "node", LifeChange.KILLED)


def test_hung_process_is_inactive_then_resumes() -> None:
    topic, order = row(depth=2), row("/order", depth=2)
    changes = Changes()
    with rig() as stage:
        stage.scheduler.add_observer(changes)
        process = stage.node("node", counter(topic))
        taken = stage.listener(topic)
        stage.talker(order)
        received = stage.listener(order, "hanging")
        stage.scheduler.at(301_000_000, process.hang, 0.55)
        stage.scheduler.at(301_000_000, stage.scheduler.processes["hanging"].hang, 0.5)
        for number in range(4):
            stage.say(310.0 + number, number, order)
        stage.scheduler.run(1.0)
        held_up = stage.port("node").report_values()["held up"]
        assert stage.port("hanging").report_values() == {}  # without a timer the hang is not detected
    assert [at for at, _ in taken] == [214.0, 855.0, 914.0]  # resumes at 851, then keeps its schedule
    assert received == [(801.0, 2), (801.0, 3)]
    assert held_up == "1 times, last 0.54 s"
    assert [item for item in changes.seen if item[1] == "node"] == [
        (10, "node", LifeChange.STARTED),
        (60, "node", LifeChange.READY),
        (301, "node", LifeChange.HUNG),
        (851, "node", LifeChange.RESUMED),
    ]


def test_a_process_that_hangs_while_it_computes_is_so_much_later() -> None:
    topic = row()
    with rig() as stage:
        process = stage.node("node", counter(topic))
        taken = stage.listener(topic)
        stage.scheduler.at(311_000_000, process.hang, 0.05)  # within the wake-up from 310 to 313 ms
        stage.scheduler.run(0.4)
    assert taken == [(214.0, 2), (364.0, 3)]


def test_a_hang_can_be_ended_before_its_time() -> None:
    topic, changes = row(), Changes()
    with rig() as stage:
        stage.scheduler.add_observer(changes)
        process = stage.node("node", counter(topic))
        taken = stage.listener(topic)
        stage.scheduler.at(305_000_000, process.hang, 3600.0)
        stage.scheduler.at(350_000_000, process.resume)
        stage.scheduler.run(0.44)
        process.resume()  # not hung: no effect
    assert [count for _, count in taken] == [2, 3, 4]
    assert taken[1][0] == 354.0  # immediately after it resumes
    assert changes.seen[-2:] == [(305, "node", LifeChange.HUNG), (350, "node", LifeChange.RESUMED)]


def test_an_exception_ends_the_process_and_is_in_the_result() -> None:
    nodes = []

    class Failing(Bare):
        def __init__(self) -> None:
            super().__init__("node", lambda port: port.add_timer(0.1, lambda: 1 // 0))
            nodes.append(self)

    changes = Changes()
    with rig() as stage:
        stage.scheduler.add_observer(changes)
        process = stage.scheduler.spawn("node", Failing)
        stage.scheduler.run(1.0)
        assert not process.alive
        assert process.exit_code == 1
        (failure,) = stage.scheduler.failures
    assert (failure.time_ns, failure.process) == (110_000_000, "node")
    assert "ZeroDivisionError" in failure.text
    assert changes.seen[-1][2] is LifeChange.CRASHED
    assert nodes[0].ended == ["safe", "destroyed"]


def test_a_wrong_configuration_is_a_refusal() -> None:
    def refuse(_) -> None:
        raise ConfigError("no such thing")

    with rig() as stage:
        process = stage.node("node", refuse)
        stage.scheduler.run(0.3)
        assert process.exit_code == 2
        assert stage.scheduler.failures[0].text == "ConfigError: no such thing"


def test_two_nodes_of_one_name_cannot_live_at_once() -> None:
    with rig() as stage:
        stage.node("node")
        second = stage.scheduler.spawn("second", lambda: Bare("node", lambda _: None), at_s=0.2)
        stage.scheduler.run(0.5)
        assert second.exit_code == 2
        assert "already running" in stage.scheduler.failures[0].text
        stage.scheduler.processes["node"].kill()
        second.start()
        stage.scheduler.run(1.0)
        assert second.alive


def test_a_restarted_process_is_a_new_life_of_the_same_factory() -> None:
    topic = row()
    with rig() as stage:
        process = stage.node("node", counter(topic))
        taken = stage.listener(topic)
        stage.scheduler.run(0.35)
        first = stage.port("node").process_id
        process.restart()
        with pytest.raises(RuntimeError, match="runs already"):
            process.start()
        stage.scheduler.run(0.7)
        assert stage.port("node").process_id != first
        assert process.lives == 2
        # The new process starts at 360 ms, is discovered at 510 ms, and ticks for the second time at 560 ms.
        assert taken == [(214.0, 2), (314.0, 3), (564.0, 2), (664.0, 3)]


def test_the_record_of_a_node_is_of_virtual_time() -> None:
    with rig() as stage:
        stage.node("node", lambda port: port.add_timer(0.2, lambda: port.node_record.beat(True, "fine")))
        stage.scheduler.run(0.5)
        port, state = stage.port("node"), NodeRecords().read("node")
        assert state is not None
        assert (state.pid, state.beats, state.ready) == (port.process_id, 2, True)
        assert port.monotonic_s() - state.beat_s == pytest.approx(0.09)
        stage.scheduler.processes["node"].kill()
        assert NodeRecords().read("node") == state


def test_a_device_is_replaced_by_its_counterpart() -> None:
    def open_bus(path: str, *, speed: int) -> str:
        raise AssertionError("the real one")

    made = []
    with rig() as stage:
        stage.scheduler.devices[open_bus] = lambda port, path, *, speed: (port.name, path, speed)
        stage.node("node", lambda port: made.append(port.device(open_bus, "/dev/can0", speed=5)))
        stage.scheduler.run(0.3)
        assert made == [("node", "/dev/can0", 5)]
        with pytest.raises(MissingDevice, match=r"node asks for the device .*rig\.row"):
            stage.port("node").device(row)


def test_parameters_are_given_by_node_and_shown() -> None:
    with rig() as stage:
        stage.node("node", parameters={"node": {"a.b": 3}})
        stage.scheduler.run(0.3)
        port = stage.port("node")
        assert port.parameter_overrides() == {"a.b": 3}
        port.show_parameters({"a.b": 3, "c": 1})
        assert port.shown_parameters == {"a.b": 3, "c": 1}
