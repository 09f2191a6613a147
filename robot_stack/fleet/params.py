"""Parameters of the fleet agent, ``config/fleet_agent.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from robot_stack.core.config import Config, Count, Positive
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.fleet.version import Version

# A level of the topics (6.3).
Level = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_.:-]{1,64}$")]


class Identity(Config):
    """interface_name, manufacturer, serial_number: levels of the topics."""

    interface_name: Level
    manufacturer: Level
    serial_number: Level

    def robot(self) -> dict[str, str]:
        """The fields of each header that name the robot."""
        return {"manufacturer": self.manufacturer, "serialNumber": self.serial_number}

    def prefix(self, version: Version) -> str:
        """The topics' levels before the last one."""
        return f"{self.interface_name}/v{version.major}/{self.manufacturer}/{self.serial_number}"


class Limits(Config):
    """Of what is received. waiting_messages: of a topic, between two ticks; older ones are dropped.

    state_bytes: of an order's nodes, edges and actions in a state message.
    """

    message_bytes: Count
    waiting_messages: Count
    messages_per_tick: Count
    instant_actions: Count
    state_bytes: Count
    actions_per_node: Annotated[int, Field(ge=1, le=50)]


class FleetParams(Config):
    """Rates in Hz, times in s, lengths in m, angles in rad.

    state_period_s: between states without an event. state_min_interval_s: between any two.
    answer_timeout_s: of the mission manager; then a request is repeated.
    pass_m to stand_rad: as in mission_manager.yaml.
    """

    tick_rate_hz: Positive
    protocol_version: Version
    identity: Identity
    series_name: Annotated[str, StringConstraints(min_length=1, max_length=64)]
    broker: BrokerParams
    state_period_s: Annotated[float, Field(gt=0.0, le=30.0)]
    state_min_interval_s: Annotated[float, Field(gt=0.0, le=30.0)]
    visualization_rate_hz: Annotated[float, Field(ge=0.0, le=10.0)]
    answer_timeout_s: Positive
    start_m: Positive
    pass_m: Positive
    pass_rad: Positive
    stand_m: Positive
    stand_rad: Positive
    standstill_mps: Positive
    standstill_radps: Positive
    base_request_m: Positive
    limits: Limits
    map: str
    journal_file: str
