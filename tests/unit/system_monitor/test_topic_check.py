"""The contract compared with an observed graph: every difference is reported, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robot_stack.contract import topics
from robot_stack.contract.graph import expected
from robot_stack.contract.model import Durability, Reliability, System, Topic
from robot_stack.system_monitor.topic_check import (
    Endpoint,
    Seen,
    Traffic,
    Verdict,
    judge,
    judge_all,
    message_rate_hz,
    rows_of,
    unknown_topics,
    worst_rate_error,
)

NODES = frozenset({"swerve_controller", "navigation_controller", "safety_monitor", "imu_driver"})


def endpoint(row: Topic, node: str) -> Endpoint:
    return Endpoint(node, row.type, row.qos.reliability, row.qos.durability)


def healthy(row: Topic, *nodes: str, window_s: float = 4.0) -> Seen:
    """Returns the observation that the contract requires: each node publishes at the row's rate."""
    publishers = tuple(endpoint(row, node) for node in nodes)
    subscribers = tuple(endpoint(row, node) for node in sorted(expected(row.subscribers, NODES, row.sometimes)))
    if row.rate_hz is None:
        return Seen(publishers, subscribers, Traffic(0, window_s, None))
    count = round(row.rate_hz * window_s * len(nodes))
    return Seen(publishers, subscribers, Traffic(count, window_s, 0.01, (row.rate_hz,) * len(nodes)))


def at_rates(row: Topic, *rates_hz: float, nodes: tuple[str, ...]) -> Seen:
    return replace(healthy(row, *nodes), traffic=Traffic(100, 4.0, 0.01, rates_hz))


def test_as_in_the_contract() -> None:
    finding = judge(topics.ODOM, healthy(topics.ODOM, "swerve_controller"), NODES, 0.1)
    assert (finding.verdict, finding.problems) == (Verdict.OK, ())


def test_publisher_that_should_run_is_missed() -> None:
    finding = judge(topics.ODOM, Seen(), NODES, 0.1)
    assert finding.problems == ("not published by swerve_controller", "not subscribed to by navigation_controller")


def test_subscribers_are_compared_both_ways() -> None:
    seen = healthy(topics.WHEEL_COMMANDS, "swerve_controller")
    others = (endpoint(topics.WHEEL_COMMANDS, "imu_driver"), endpoint(topics.WHEEL_COMMANDS, "rviz"))
    finding = judge(topics.WHEEL_COMMANDS, replace(seen, subscribers=seen.subscribers + others), NODES, 0.1)
    assert finding.problems == ("subscribed to by imu_driver, which the contract does not name",)
    deaf = replace(healthy(topics.CMD_VEL, "navigation_controller"), subscribers=())
    problems = judge(topics.CMD_VEL, deaf, NODES, 0.1).problems
    assert problems == ("not subscribed to by safety_monitor, swerve_controller",)


def test_topic_without_a_node_in_the_profile_is_not_run() -> None:
    assert judge(topics.SPACE, Seen(), NODES, 0.1).verdict is Verdict.NOT_RUN


def test_wrong_type_is_named() -> None:
    seen = healthy(topics.ODOM, "swerve_controller")
    wrong = replace(seen, publishers=(replace(seen.publishers[0], type="std_msgs/msg/String"),))
    assert judge(topics.ODOM, wrong, NODES, 0.1).problems == ("type std_msgs/msg/String in the graph",)


def test_wrong_type_of_a_subscriber_is_named_too() -> None:
    listener = Endpoint("rviz", "std_msgs/msg/String", Reliability.RELIABLE, Durability.VOLATILE)
    seen = healthy(topics.ODOM, "swerve_controller")
    seen = replace(seen, subscribers=(*seen.subscribers, listener))
    assert judge(topics.ODOM, seen, NODES, 0.1).problems == ("type std_msgs/msg/String in the graph",)


@pytest.mark.parametrize(
    "change", [{"reliability": Reliability.RELIABLE}, {"durability": Durability.TRANSIENT_LOCAL}], ids=str
)
def test_wrong_qos_is_named(change: dict[str, object]) -> None:
    seen = healthy(topics.ODOM, "swerve_controller")
    wrong = replace(seen, publishers=(replace(seen.publishers[0], **change),))  # type: ignore[arg-type]
    (problem,) = judge(topics.ODOM, wrong, NODES, 0.1).problems
    assert problem.startswith("swerve_controller publishes ")


def test_stranger_is_named() -> None:
    seen = healthy(topics.WHEEL_COMMANDS, "swerve_controller", "intruder")
    problems = judge(topics.WHEEL_COMMANDS, seen, NODES, 0.1).problems
    assert "published by intruder, which the contract does not name" in problems


@pytest.mark.parametrize(("rate_hz", "right"), [(50, True), (45.5, True), (54.5, True), (44, False), (56, False)])
def test_rate_within_the_tolerance(rate_hz: float, right: bool) -> None:
    seen = at_rates(topics.ODOM, rate_hz, nodes=("swerve_controller",))
    assert (judge(topics.ODOM, seen, NODES, 0.1).problems == ()) == right


def test_slow_publisher_among_many_is_detected() -> None:
    seen = at_rates(topics.HEARTBEAT, 1.0, 1.0, 0.8, 1.0, nodes=tuple(sorted(NODES)))
    assert judge(topics.HEARTBEAT, seen, NODES, 0.1).rate_error == pytest.approx(0.2)


class TestRate:
    """A window of 4 s, from 10 to 14."""

    WINDOW = (10.0, 14.0)

    def test_slow_topic_is_measured_exactly(self) -> None:
        """At 1 Hz, three or four messages fall into 3.5 s, but the measured rate is 1 Hz."""
        assert message_rate_hz(4, 10.4, 13.4, self.WINDOW, 1.0) == pytest.approx(1.0)
        assert message_rate_hz(3, 10.9, 12.9, (10.0, 13.5), 1.0) == pytest.approx(1.0)

    def test_sender_that_fell_silent_is_not_forgiven(self) -> None:
        assert message_rate_hz(101, 10.0, 12.0, self.WINDOW, 0.02) == pytest.approx(101 / 4.0)

    def test_sender_that_began_late_is_not_forgiven(self) -> None:
        assert message_rate_hz(101, 12.0, 14.0, self.WINDOW, 0.02) == pytest.approx(101 / 4.0)

    def test_one_message(self) -> None:
        assert message_rate_hz(1, 12.0, 12.0, self.WINDOW, 10.0) == pytest.approx(0.25)

    def test_events_are_counted_over_the_window(self) -> None:
        assert message_rate_hz(8, 10.1, 13.9, self.WINDOW, 0.0) == pytest.approx(2.0)


def test_topic_of_every_node_is_expected_from_each_at_its_rate() -> None:
    seen = healthy(topics.HEARTBEAT, *NODES)
    finding = judge(topics.HEARTBEAT, seen, NODES, 0.1)
    assert finding.expected_hz == 4.0
    assert finding.problems == ()
    fewer = healthy(topics.HEARTBEAT, *(NODES - {"imu_driver"}))
    assert judge(topics.HEARTBEAT, fewer, NODES, 0.1).problems == ("not published by imu_driver",)


def test_a_topic_on_demand_may_be_silent() -> None:
    never = replace(healthy(topics.DOCKING_CMD_VEL, "docking_controller"), traffic=Traffic(0, 4.0, None))
    finding = judge(topics.DOCKING_CMD_VEL, never, NODES | {"docking_controller"}, 0.1)
    assert (finding.verdict, finding.rate_error) == (Verdict.QUIET, 0.0)


def test_silent_publisher_is_named() -> None:
    never = replace(healthy(topics.ODOM, "swerve_controller"), traffic=Traffic(0, 4.0, None))
    assert judge(topics.ODOM, never, NODES, 0.1).problems == ("advertised, but nothing is sent",)
    stopped = replace(never, traffic=Traffic(100, 4.0, 1.5))
    assert judge(topics.ODOM, stopped, NODES, 0.1).problems == ("silent for 1.5 s",)


def test_event_topic_without_events_is_quiet() -> None:
    assert judge(topics.PLAN, healthy(topics.PLAN, "navigation_controller"), NODES, 0.1).verdict is Verdict.QUIET


def test_missing_event_publisher_is_reported_and_tools_are_ignored() -> None:
    nodes = NODES | {"touch_ui"}
    seen = healthy(topics.GOAL_POSE, "scenario_runner")
    assert judge(topics.GOAL_POSE, seen, nodes, 0.1).problems == ("not published by touch_ui",)
    assert judge(topics.GOAL_POSE, seen, NODES, 0.1).problems == ()


def test_clock_is_a_row_only_where_nodes_live_on_it() -> None:
    assert topics.CLOCK not in rows_of(System.ROBOT, use_sim_time=False)
    assert topics.CLOCK in rows_of(System.ROBOT, use_sim_time=True)


def test_one_machine_has_one_row_for_a_name() -> None:
    for machine in (System.ROBOT, System.WMX):
        names = [row.name for row in rows_of(machine, use_sim_time=True)]
        assert len(names) == len(set(names))


def test_unknown_topics_exclude_topics_of_ros() -> None:
    rows = rows_of(System.ROBOT, use_sim_time=False)
    names = ["/odom", "/rosout", "/parameter_events", "/clock", "/docking/dock/_action/status", "/mine"]
    assert unknown_topics(names, rows) == ("/mine",)


def test_worst_rate_error_is_relative() -> None:
    seen = {
        "/odom": at_rates(topics.ODOM, 49.5, nodes=("swerve_controller",)),
        "/sensors/imu": at_rates(topics.IMU, 105.0, nodes=("imu_driver",)),
    }
    findings = judge_all((topics.ODOM, topics.IMU, topics.OBSTACLES), seen, NODES, 0.1)
    error, name = worst_rate_error(findings)
    assert name == "/sensors/imu"
    assert error == pytest.approx(0.05)


def test_worst_rate_error_of_nothing() -> None:
    assert worst_rate_error(()) == (0.0, "")
