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


def test_verdicts_without_a_problem() -> None:
    for row, seen, verdict in (
        (topics.ODOM, healthy(topics.ODOM, "swerve_controller"), Verdict.OK),
        (topics.SPACE, Seen(), Verdict.NOT_RUN),
        (topics.PLAN, healthy(topics.PLAN, "navigation_controller"), Verdict.QUIET),
    ):
        finding = judge(row, seen, NODES, 0.1)
        assert (finding.verdict, finding.problems) == (verdict, ())


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


def test_wrong_type_is_named() -> None:
    seen = healthy(topics.ODOM, "swerve_controller")
    listener = Endpoint("rviz", "std_msgs/msg/String", Reliability.RELIABLE, Durability.VOLATILE)
    for wrong in (
        replace(seen, publishers=(replace(seen.publishers[0], type=listener.type),)),
        replace(seen, subscribers=(*seen.subscribers, listener)),
    ):
        assert judge(topics.ODOM, wrong, NODES, 0.1).problems == ("type std_msgs/msg/String in the graph",)


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


@pytest.mark.parametrize(
    ("count", "first_s", "last_s", "end_s", "period_s", "rate_hz"),
    [
        (4, 10.4, 13.4, 14.0, 1.0, 1.0),
        (3, 10.9, 12.9, 13.5, 1.0, 1.0),  # three or four messages at 1 Hz fall into 3.5 s
        (101, 10.0, 12.0, 14.0, 0.02, 101 / 4.0),  # fell silent
        (101, 12.0, 14.0, 14.0, 0.02, 101 / 4.0),  # began late
        (1, 12.0, 12.0, 14.0, 10.0, 0.25),
        (8, 10.1, 13.9, 14.0, 0.0, 2.0),  # events are counted over the window
    ],
)
def test_rate_in_a_window(
    count: int, first_s: float, last_s: float, end_s: float, period_s: float, rate_hz: float
) -> None:
    assert message_rate_hz(count, first_s, last_s, (10.0, end_s), period_s) == pytest.approx(rate_hz)


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


def test_missing_event_publisher_is_reported_and_tools_are_ignored() -> None:
    nodes = NODES | {"touch_ui"}
    seen = healthy(topics.GOAL_POSE, "scenario_runner")
    assert judge(topics.GOAL_POSE, seen, nodes, 0.1).problems == ("not published by touch_ui",)
    assert judge(topics.GOAL_POSE, seen, NODES, 0.1).problems == ()


def test_clock_is_a_row_only_where_nodes_live_on_it() -> None:
    assert topics.CLOCK not in rows_of(System.ROBOT, use_sim_time=False)
    assert topics.CLOCK in rows_of(System.ROBOT, use_sim_time=True)


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
    assert worst_rate_error(()) == (0.0, "")
