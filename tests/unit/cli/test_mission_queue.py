"""The list of orders for an operator."""

from __future__ import annotations

import pytest

from robot_stack.cli.mission_queue import print_queue
from robot_stack.cli.nodes.mission_queue import Queue, ShownOrder


def test_an_open_route_and_the_origin_of_its_pause_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    orders = (
        ShownOrder("a", "tour", "fleet", 100, 0.0, under_way=True, open=True),
        ShownOrder("b", "tour", "fleet", 100, 0.0, under_way=False, open=True),
        ShownOrder("c", "short_hop", "cli", 200, 0.0, under_way=False, open=False),
    )
    print_queue(Queue("", orders, "fleet"))
    assert capsys.readouterr().out.splitlines() == [
        "orders start one after the other",
        "under way a: tour, priority 100, from fleet, open route, paused by fleet",
        "1. b: tour, priority 100, from fleet, open route",
        "2. c: short_hop, priority 200, from cli",
    ]
