"""Rates and ages reported by subscribers, compared with the rows of the contract."""

from __future__ import annotations

import math

import pytest

from robot_stack.contract import topics
from robot_stack.contract.model import EVERY_NODE, System
from robot_stack.contract.processes import PROCESSES
from robot_stack.core.health import INPUT_PREFIX, InputState, describe_input, parse_input
from robot_stack.system_monitor.topic_health import TopicFigures, TopicHealth, describe_topic, judge_topic, topics_of

NODES = ("swerve_controller", "imu_driver")


@pytest.mark.parametrize(
    "state",
    [
        InputState("/odom", 0.05, 49.8, True, 1234),
        InputState("/odom", 7.25, 0.0, False, 3),
        InputState("/odom", 0.01, math.nan, True, 1),
        InputState("/odom", -0.5, math.nan, False, 1),
        InputState("/odom", math.inf, math.nan, False, 0),
    ],
)
def test_input_description_round_trip(state: InputState) -> None:
    read = parse_input("/odom", describe_input(state))
    assert (read.fresh, read.received) == (state.fresh, state.received)
    assert (read.age_s, read.rate_hz) == pytest.approx((state.age_s, state.rate_hz), nan_ok=True)


@pytest.mark.parametrize("text", ["", "soon", "received=3", "received=x rate_hz=1.0 age_s=1.0 fresh=True", "a=b=c"])
def test_malformed_input_description_is_not_parsed(text: str) -> None:
    assert parse_input("/odom", text) is None


def test_an_input_is_read_by_its_fields_alone() -> None:
    """Not by a text for people, nor by their order."""
    text = describe_input(InputState("/odom", 7.25, 49.8, False, 3))
    others = " ".join(["note=STALE", *reversed(text.split())])
    assert parse_input("/odom", others) == parse_input("/odom", text) == InputState("/odom", 7.25, 49.8, False, 3)


def report(health: TopicHealth, node: str, text: str, now_s: float, topic: str = "/odom") -> None:
    health.update(node, [(f"{INPUT_PREFIX}{topic}", text), ("loop tick", "3 calls"), (INPUT_PREFIX, "junk")], now_s)


def test_topic_figures_come_from_subscriber_with_most_messages() -> None:
    health = TopicHealth(5.0)
    assert health.figures("/odom", 0.0) is None
    report(health, "mission_manager", "received=100 rate_hz=10.0 age_s=0.09 fresh=True", 1.0)
    report(health, "ndt_localization", "received=500 rate_hz=50.1 age_s=0.02 fresh=True", 1.0)
    report(health, "costmap_server", "received=0 rate_hz=nan age_s=inf fresh=False", 1.0)
    assert health.figures("/odom", 1.5) == TopicFigures(50.1, 0.02)
    assert health.figures("/imu", 1.5) is None


def test_stale_subscriber_report_is_ignored() -> None:
    health = TopicHealth(5.0)
    report(health, "ndt_localization", "received=500 rate_hz=50.1 age_s=0.02 fresh=True", 1.0)
    report(health, "mission_manager", "received=100 rate_hz=10.0 age_s=0.09 fresh=True", 3.0)
    assert health.figures("/odom", 6.0) == TopicFigures(50.1, 0.02)
    assert health.figures("/odom", 6.1) == TopicFigures(10.0, 0.09)
    assert health.figures("/odom", 8.1) is None
    assert health.figures("/odom", 2.0) == TopicFigures(50.1, 0.02)  # the other report lies in the future


def test_topic_never_received_is_described_as_such() -> None:
    health = TopicHealth(5.0)
    report(health, "ndt_localization", "received=0 rate_hz=nan age_s=inf fresh=False", 1.0)
    figures = health.figures("/odom", 1.0)
    assert (math.isnan(figures.rate_hz), figures.age_s) == (True, math.inf)
    assert describe_topic(topics.ODOM, figures) == "nothing received"


@pytest.mark.parametrize(
    ("figures", "problem"),
    [
        (TopicFigures(50.0, 0.02), ""),
        (TopicFigures(37.6, 0.02), ""),
        (TopicFigures(37.4, 0.02), "37.4 Hz instead of 50"),
        (TopicFigures(62.6, 0.02), "62.6 Hz instead of 50"),
        (TopicFigures(math.nan, 0.02), ""),
        (TopicFigures(50.0, 0.21), "silent for 0.2 s"),
        (TopicFigures(math.nan, math.inf), "never received"),
        (None, ""),
    ],
)
def test_traffic(figures: TopicFigures | None, problem: str) -> None:
    assert judge_topic(topics.ODOM, figures, NODES, 0.25) == problem


def test_topics_on_demand_or_without_local_publisher_are_not_judged() -> None:
    silent = TopicFigures(0.0, 99.0)
    assert judge_topic(topics.ODOM, silent, ("imu_driver",), 0.25) == ""
    assert judge_topic(topics.DOCKING_CMD_VEL, silent, ("docking_controller",), 0.25) == ""
    assert judge_topic(topics.PLAN, silent, ("navigation_controller",), 0.25) == ""
    assert judge_topic(topics.HEARTBEAT, silent, NODES, 0.25) == ""


def test_topic_description() -> None:
    assert describe_topic(topics.ODOM, TopicFigures(50.0, 0.02)) == "50.0 Hz of 50, age 0.02 s"
    assert describe_topic(topics.PLAN, TopicFigures(math.nan, 9.0)) == "rate unknown, age 9.00 s"
    assert describe_topic(topics.ODOM, None) == "no subscriber reports it"


def test_topics_are_filtered_by_running_nodes() -> None:
    found = topics_of((topics.ODOM, topics.PLAN, topics.DIAGNOSTICS), NODES)
    assert found == (topics.ODOM, topics.DIAGNOSTICS)


def test_every_rated_topic_has_reporting_subscriber() -> None:
    """Otherwise the monitor would have to count it.

    Node records report heartbeats, the tree is the monitor's own, and reports of the pose cover its covariance. The
    copies for remote viewers have subscribers outside of the stack only.
    """
    nodes = {node for process in PROCESSES for node in process.nodes}
    untold = [
        row.name
        for row in topics.of_system(System.ROBOT)
        if row.rate_hz is not None and not ({EVERY_NODE, *nodes} & set(row.subscribers))
    ]
    copies = [row.name for row in topics.REMOTE_COPIES]
    assert untold == ["/system/heartbeat", "/diagnostics_agg", "/localization/pose", *copies]
