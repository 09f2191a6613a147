"""The docking controller as a process on a real engine and real actions. What it does when: tests/simulated/nodes."""

from __future__ import annotations

import signal
from collections.abc import Callable

from rclpy.action import ActionClient

from custom_msgs.action import Dock
from robot_stack.contract import actions, topics
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for


def test_a_goal_is_answered_over_dds_and_the_process_leaves_in_order(
    start: Callable[..., NodeProcess], peer: Peer
) -> None:
    passenger = peer.listen(topics.PASSENGER_ATTACHED)
    client = ActionClient(peer.node, Dock, actions.DOCK.name)
    start("sim_world")
    start("swerve_hardware_interface")  # starts the engine's bus, without which no input can be read
    process = start("docking_controller")
    passenger.wait(lambda message: not message.data, "the passenger's state, once the latch can be read")
    wait_for(client.server_is_ready, "the action")
    sent = peer.in_loop(lambda: client.send_goal_async(Dock.Goal(dock_id="nowhere")))
    wait_for(sent.done, "an answer to the goal")
    result = peer.in_loop(sent.result().get_result_async)
    wait_for(result.done, "the result")
    assert result.result().result.error_code == Dock.Result.UNKNOWN_DOCK
    process.signal(signal.SIGTERM)
    assert process.wait() == 0
