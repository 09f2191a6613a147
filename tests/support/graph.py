"""Compares a running stack with the contract, in both directions: publishers, subscribers, types, QoS.

tests/simulated/test_graph.py checks the rates in simulated time, because here they depend on the machine.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from robot_stack.supervisor.profile import Plan
from tests.support.waiting import wait_for

if TYPE_CHECKING:
    from robot_stack.system_monitor.topic_check import Seen

PEER = "scenario_peer"


def without_the_test(seen: Seen) -> Seen:
    """Removes ages, rates and the endpoints of the test's peer, which is not bound by the contract."""
    kept = [tuple(item for item in side if item.node != PEER) for side in (seen.publishers, seen.subscribers)]
    age_s = None if seen.traffic.age_s is None else 0.0
    traffic = replace(seen.traffic, age_s=age_s)
    return replace(seen, publishers=kept[0], subscribers=kept[1], traffic=traffic)


def assert_graph_is_the_contracts(plan: Plan) -> None:
    """Repeats until everything matches: on a busy machine discovery and first messages take long."""
    from robot_stack.system_monitor.nodes.topic_meter import Meter
    from robot_stack.system_monitor.topic_check import judge_all, rows_of, unknown_topics

    rows = rows_of(plan.machine, use_sim_time=plan.use_sim_time)
    nodes = frozenset(node for process in plan.processes for node in process.nodes)
    wrong: dict[str, tuple[str, ...]] = {}
    with Meter(rows) as meter:
        meter.settle(20.0)

        def as_in_the_contract() -> bool:
            meter.run(3.0)
            seen = {name: without_the_test(item) for name, item in meter.seen().items()}
            findings = judge_all(rows, seen, nodes, math.inf)
            wrong.clear()
            wrong.update({finding.row.name: finding.problems for finding in findings if finding.problems})
            wrong.update(dict.fromkeys(unknown_topics(meter.topic_names(), rows), ("not in the contract",)))
            return not wrong

        try:
            wait_for(as_in_the_contract, "a stack as in the contract", 60.0)
        except AssertionError as error:
            raise AssertionError(f"{error}: {wrong}") from None
