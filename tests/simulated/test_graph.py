"""The endpoints and rates of the whole robot against the contract. On DDS: tests/nodes/test_profile_graphs.py."""

from __future__ import annotations

from robot_stack.contract import topics
from robot_stack.contract.graph import Endpoints, lacking, strangers
from robot_stack.system_monitor.topic_check import rows_of
from sim.stack.stack import SimulatedStack
from tests.simulated.stage import staged

_MEASURED_S = 4.0
# Published only during an activity, or by a page.
ON_DEMAND = {"/docking/cmd_vel", "/teleop/cmd_vel", "/docking/target", "/ui/heartbeat", "/departure_warning"}
ON_DEMAND |= {"/building/request", "/building/state"}
# By processes that are not in the profile.
ON_DEMAND |= {row.name for row in (*topics.REMOTE_COPIES, topics.VENDOR_IMU, topics.VENDOR_BATTERY_STATE)}


def _endpoints(stack: SimulatedStack, name: str) -> Endpoints:
    """The endpoints of the robot's nodes: operator and test may use any topic."""
    network = stack.scheduler.network
    tools = {stack.operator.port.name, stack.test_tool.port.name}
    publishers = {item.port.name for item in network.publishers(name)} - tools
    subscribers = {item.port.name for item in network.subscriptions(name)} - tools
    return Endpoints(frozenset(publishers), frozenset(subscribers))


def test_rows_and_the_running_robot_are_the_same() -> None:
    with staged(light=False) as stage:
        plan = stage.stack.plan
        nodes = frozenset(node for process in plan.processes for node in process.nodes)
        rows = rows_of(plan.machine, use_sim_time=False)
        received = {row.name: stage.listen(row) for row in rows if row.rate_hz and not row.bulk}
        stage.run(1.0 + _MEASURED_S)
        wrong: list[str] = []
        for row in rows:
            seen = _endpoints(stage.stack, row.name)
            wrong += [f"{row.name}: {text}" for text in (*lacking(row, seen, nodes), *strangers(row, seen, nodes))]
        for row in rows:
            if row.name not in received:
                continue
            times = [time_s for time_s in received[row.name].times_s if time_s > stage.now_s - _MEASURED_S]
            # Rows that are published only during an activity have no messages here.
            if times and len(times) < 0.9 * row.rate_hz * _MEASURED_S - 1.0:
                wrong.append(f"{row.name}: {len(times)} messages in {_MEASURED_S} s, {row.rate_hz} Hz promised")
        silent = {name for name, item in received.items() if not item.items}
        assert silent <= ON_DEMAND, silent
        assert not wrong, "\n".join(wrong)
        known = {row.name for row in rows}
        network = stage.stack.scheduler.network
        assert set(network._publishers) | set(network._subscriptions) <= known
