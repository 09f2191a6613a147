"""The channels offered to viewers, by machine."""

from __future__ import annotations

import pytest

from robot_stack.contract import topics
from robot_stack.contract.model import System
from robot_stack.view.channels import MODEL, MODEL_INPUTS, has_model, offered


def test_the_robot_offers_every_topic_of_its_own_and_of_its_simulation() -> None:
    assert set(offered(System.ROBOT).values()) == set(topics.of_system(System.ROBOT, System.SIMULATION))
    assert {"/tf", "/tf_static", "/plan", "/docking/target"} <= set(offered(System.ROBOT))
    assert has_model(System.ROBOT)
    assert set(MODEL_INPUTS) <= set(offered(System.ROBOT).values())


def test_another_machine_offers_its_own_rows_of_shared_names() -> None:
    rows = offered(System.WMX)
    assert rows["/joint_states"] is topics.WMX_JOINT_STATES
    assert rows["/cmd_vel"] is topics.WMX_CMD_VEL
    assert "/diagnostics" in rows  # published by every node
    assert "/swerve/wheel_commands" not in rows
    assert not has_model(System.WMX)


@pytest.mark.parametrize("machine", [System.ROBOT, System.WMX])
def test_model_channel_is_not_an_offered_topic(machine: System) -> None:
    assert MODEL not in offered(machine)
