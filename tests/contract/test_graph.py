"""Required and forbidden endpoints: every difference is reported, in both directions."""

from __future__ import annotations

from dataclasses import replace

from robot_stack.contract import topics
from robot_stack.contract.graph import Endpoints, doubled, lacking, strangers
from robot_stack.contract.model import EVERY_NODE

NODES = ("swerve_controller", "navigation_controller", "ndt_localization")


def seen(publishers: tuple[str, ...] = (), subscribers: tuple[str, ...] = ()) -> Endpoints:
    return Endpoints(frozenset(publishers), frozenset(subscribers))


def test_missing_publisher_and_subscribers_of_row_are_reported() -> None:
    whole = seen(("swerve_controller",), ("navigation_controller", "ndt_localization"))
    assert lacking(topics.ODOM, whole, NODES) == ()
    assert lacking(topics.ODOM, seen(), NODES) == (
        "not published by swerve_controller",
        "not subscribed to by navigation_controller, ndt_localization",
    )


def test_nodes_that_do_not_run_here_are_not_missed() -> None:
    assert lacking(topics.OBSTACLES, seen(), NODES) == ()


def test_rows_of_every_node() -> None:
    assert lacking(topics.HEARTBEAT, seen(NODES[:2]), NODES) == ("not published by ndt_localization",)
    assert strangers(topics.HEARTBEAT, seen(("anybody",)), NODES) == ()


def test_publisher_for_every_node_must_publish_but_need_not_subscribe() -> None:
    nodes = ("safety_monitor", "swerve_controller")
    assert lacking(topics.SAFETY_STATUS, seen(("safety_monitor",), ("swerve_controller",)), nodes) == ()
    assert lacking(topics.SAFETY_STATUS, seen((), ("swerve_controller",)), nodes) == (
        "not published by safety_monitor",
    )


def test_missing_optional_endpoint_is_not_reported() -> None:
    row = replace(topics.ODOM, sometimes=("ndt_localization",))
    assert lacking(row, seen(("swerve_controller",), ("navigation_controller",)), NODES) == ()
    assert lacking(replace(topics.ODOM, sometimes=(EVERY_NODE,)), seen(), NODES) == ()


def test_endpoints_that_the_row_does_not_give() -> None:
    found = seen(("swerve_controller", "intruder"), ("navigation_controller", "swerve_controller", "rviz"))
    assert strangers(topics.ODOM, seen((), ("recorder",)), (*NODES, "recorder")) == ()
    assert strangers(topics.ODOM, found, NODES) == ("published by intruder", "subscribed to by swerve_controller")


def test_two_nodes_of_a_name_are_found_unless_they_are_tools() -> None:
    assert doubled(["rviz", "b", "a", "rviz", "b", "a", "c"], ("rviz",)) == ("a", "b")


def test_optional_endpoints_belong_to_publishers_or_subscribers_of_row() -> None:
    for row in topics.TOPICS:
        assert set(row.sometimes) <= {*row.publishers, *row.subscribers}, row.name
        assert row is topics.CLOCK or EVERY_NODE not in row.sometimes, row.name
