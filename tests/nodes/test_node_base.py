"""The node base in real processes on real DDS."""

from __future__ import annotations

import itertools
import os
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool

from custom_msgs.msg import SafetyStatus
from robot_stack.contract import topics
from tests.support.processes import NodeProcess, Start
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from tests.support.peer import Peer

SCRIPTS = Path(__file__).parent / "scripts"


def example(start: Start, *arguments: str) -> NodeProcess:
    """The smallest node of the stack, in its own process."""
    return start("example", command=[sys.executable, str(SCRIPTS / "example_node.py"), *arguments])


def test_heartbeat_diagnostics_and_qos_of_the_rows(start: Start, peer: Peer) -> None:
    beats, diagnostics = peer.listen(topics.HEARTBEAT), peer.listen(topics.DIAGNOSTICS)
    process = example(start)
    beat = beats.wait(lambda message: message.ready, "a ready heartbeat")
    assert (beat.node, beat.pid) == ("navigation_controller", process.pid)
    assert beat.sequence >= 1
    status = diagnostics.wait(lambda message: message.status[0].level == b"\x00", "an OK diagnosis").status[0]
    values = {item.key: item.value for item in status.values}
    assert status.name == "navigation_controller"
    assert "input /emergency_stop" in values
    assert "calls" in values["loop tick"]
    info = wait_for(lambda: peer.node.get_publishers_info_by_topic("/cmd_vel"), "the publisher in the graph")[0]
    assert info.topic_type == topics.CMD_VEL.type
    assert info.qos_profile.reliability.name == "RELIABLE"
    infos = wait_for(lambda: peer.node.get_subscriptions_info_by_topic("/emergency_stop"), "the subscription")
    assert infos[0].qos_profile.durability.name == "TRANSIENT_LOCAL"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_publishes_safe_output_before_exit(start: Start, peer: Peer, number: signal.Signals) -> None:
    received = peer.listen(topics.CMD_VEL)
    process = example(start)
    received.wait(lambda message: message.linear.x == 1.0, "driving commands")
    process.signal(number)
    assert process.wait() == 0
    received.wait(lambda message: message.linear.x == 0.0, "the safe output")


def test_exception_publishes_safe_output_and_prints_error(start: Start, peer: Peer) -> None:
    received = peer.listen(topics.CMD_VEL)
    process = example(start, "--crash-after", "20")
    assert process.wait() == 1
    assert "ZeroDivisionError" in process.output()
    received.wait(lambda message: message.linear.x == 0.0, "the safe output")


def test_a_process_that_was_held_up_says_so_and_blames_nobody(start: Start, peer: Peer) -> None:
    received = peer.listen(topics.DIAGNOSTICS)
    process = example(start)
    received.wait(lambda message: message.status[0].level == b"\x00", "an OK diagnosis")
    signals = itertools.cycle((signal.SIGSTOP, signal.SIGCONT, signal.SIGCONT, signal.SIGCONT))

    def paused() -> bool:
        process.signal(next(signals))
        return "held up" in {item.key for item in received.last.status[0].values}

    wait_for(paused, "the pause in /diagnostics", poll_s=0.3)
    process.signal(signal.SIGCONT)


def test_a_second_node_of_the_same_name_refuses_to_start_until_the_first_is_gone(start: Start) -> None:
    first = example(start)
    first.wait_output("driving")
    second = example(start)
    assert second.wait() == 2
    assert f"already running in this ROS domain (process {first.pid})" in second.output()
    assert first.running()
    first.signal(signal.SIGKILL)
    first.wait()
    example(start).wait_output("driving")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--ros-args", "-p", "speeed:=1.0"), "speeed"),
        (("--advertise", "WHEEL_COMMANDS"), "navigation_controller may not publish /swerve/wheel_commands"),
        (("--listen", "ODOM"), "may not listen to /odom: the contract names recorder, black_box"),
    ],
    ids=["unknown parameter", "publisher outside the contract", "every row is the recorder's"],
)
def test_what_the_contract_forbids_ends_the_start(start: Start, arguments: tuple[str, ...], said: str) -> None:
    process = example(start, *arguments)
    assert process.wait() == 2
    assert said in process.output()


def test_publishers_accept_qos_overrides(start: Start, peer: Peer) -> None:
    example(start, "--ros-args", "-p", "qos_overrides./cmd_vel.publisher.reliability:=best_effort")

    def reliability() -> str | None:
        infos = peer.node.get_publishers_info_by_topic("/cmd_vel")
        return infos[0].qos_profile.reliability.name if infos else None

    assert wait_for(reliability, "the publisher in the graph") == "BEST_EFFORT"


def test_emergency_stop_holds_until_both_keys(start: Start, peer: Peer) -> None:
    received = peer.listen(topics.CMD_VEL)
    example(start)
    received.wait(lambda message: message.linear.x == 1.0, "driving commands")
    peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    received.wait(lambda message: message.linear.x == 0.0, "the stop")
    stopped = len(received.items)
    peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="EMERGENCY_STOP"), 10.0)
    peer.publish(topics.EMERGENCY_STOP, Bool(data=False))
    wait_for(lambda: len(received.items) > stopped + 10, "ten more commands")
    assert {message.linear.x for message in received.messages[stopped:]} == {0.0}
    peer.repeat(topics.SAFETY_STATUS, lambda: SafetyStatus(safety_state="NORMAL"), 10.0)
    received.wait(lambda message: message.linear.x == 1.0, "driving again")


def test_use_sim_time_drives_timers_by_clock(start: Start, peer: Peer) -> None:
    received, beats = peer.listen(topics.CMD_VEL), peer.listen(topics.HEARTBEAT)
    example(start, "--ros-args", "-p", "use_sim_time:=true")
    peer.wait_matched(topics.CLOCK)
    received.wait_connected()
    wait_for(lambda: len(beats.items) >= 3, "heartbeats, which go by real time")
    assert received.items == [], "without a clock no tick"
    now = [Time(sec=100)]
    peer.repeat(topics.CLOCK, lambda: Clock(clock=now[0]), 50.0)
    for tick in range(1, 7):
        wait_for(lambda count=tick: len(received.items) >= count, "a tick driven by /clock")
        assert len(received.items) == tick, "a second of the clock is one tick"
        now[0] = Time(sec=100 + min(tick, 5))
    count = len(beats.items)
    wait_for(lambda: len(beats.items) >= count + 3, "heartbeats")
    assert len(received.items) == 6, "no tick while /clock stands still, and none that was missed is made up for"


def test_ros_run_executable_is_registered() -> None:
    prefix = Path(sys.prefix)
    assert (prefix / "share/ament_index/resource_index/packages/robot_stack").is_file()
    launcher = prefix / "lib/robot_stack/swerve_controller"
    assert os.access(launcher, os.X_OK)
