"""Channels for viewers: one per topic of a machine, and the model computed from some of them."""

from __future__ import annotations

from collections.abc import Mapping

from robot_stack.contract import topics
from robot_stack.contract.model import EVERY_NODE, System, Topic

MODEL = "/view/robot"
"""The robot's model as foxglove.SceneUpdate, which is not a topic of the graph."""

# Inputs of the model.
MODEL_INPUTS = (topics.JOINT_STATES, topics.PASSENGER_ATTACHED, topics.EHMI_STATUS)


def offered(machine: System) -> Mapping[str, Topic]:
    """Topics of a machine and of its simulation by name, in the contract's order."""
    # Common topics of all nodes (/diagnostics, ...) are in the robot's rows; on a name conflict the machine's row wins.
    order = (System.ROBOT, System.SIMULATION, System.WMX) if machine is System.WMX else (machine, System.SIMULATION)
    rows = {row.name: row for system in order for row in topics.of_system(system)}
    if machine is System.WMX:
        own = topics.of_system(System.WMX, System.SIMULATION)
        rows = {name: row for name, row in rows.items() if row in own or EVERY_NODE in row.publishers}
    return rows


def has_model(machine: System) -> bool:
    return machine is System.ROBOT
