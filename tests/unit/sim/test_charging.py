"""The charging contacts of the simulated stations."""

from __future__ import annotations

import math

import pytest

from robot_stack.core.config import ConfigError
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from sim.plant.charging import ChargingContacts
from sim.worldfile import WorldFile, load_world

YARD = load_world("yard")


def docked() -> Pose2:
    """base_link in map at the yard's charger, as config/docks.yaml has it."""
    dock = load_docks().docks["charger"]
    return YARD.stations["charger"].pose().compose(dock.dock_pose.pose())


@pytest.mark.parametrize(
    ("off", "power_w"),
    [
        (Pose2(0.0, 0.0, 0.0), 480.0),
        (Pose2(0.012, -0.012, math.radians(2.5)), 480.0),
        (Pose2(0.021, 0.0, 0.0), 0.0),
        (Pose2(0.0, -0.021, 0.0), 0.0),
        (Pose2(0.0, 0.0, math.radians(3.5)), 0.0),
        (Pose2(0.0, 0.0, math.pi), 0.0),
    ],
)
def test_contacts_meet_within_their_tolerance(off: Pose2, power_w: float) -> None:
    contacts = ChargingContacts(YARD)
    assert contacts.power_w(docked().compose(off)) == power_w
    contacts.dead = True
    assert contacts.power_w(docked().compose(off)) == 0.0


def test_a_world_without_chargers() -> None:
    assert ChargingContacts(load_world("flat")).power_w(docked()) == 0.0


def test_a_charger_needs_its_station() -> None:
    content = YARD.model_dump() | {"stations": {}}
    with pytest.raises((ValueError, ConfigError), match="chargers: no station charger"):
        WorldFile.model_validate(content)
