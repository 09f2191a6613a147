"""Parameters of the system monitor: ``config/system_monitor.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, field_validator

from robot_stack.contract.processes import BY_NAME
from robot_stack.core.config import Config, Positive

_ITSELF = "system_monitor"


class SystemMonitorParams(Config):
    """proc_folder, thermal_folder: folders of the kernel. disk_folder: empty = the default folder of recordings.
    A relative folder lies in the runtime folder.

    cpu_window_s: time over which the processor's use is averaged. rate_tolerance: relative.
    groups: name of a group of /diagnostics_agg -> its nodes.
    """

    proc_folder: Annotated[str, Field(min_length=1)]
    thermal_folder: Annotated[str, Field(min_length=1)]
    disk_folder: str
    cpu_window_s: Annotated[float, Field(ge=0.1, le=10.0)]

    process_period_s: Positive
    pss_period_s: Positive
    graph_period_s: Positive
    clock_step_s: Positive
    clock_drift_s: Positive
    rate_tolerance: Annotated[float, Field(gt=0.0, lt=1.0)]

    expected_processes: tuple[str, ...]

    base_path: Annotated[str, Field(pattern=r"^/[^/]+$")]
    stale_after_s: Positive
    groups: dict[str, tuple[str, ...]]

    @property
    def nodes(self) -> tuple[str, ...]:
        """The nodes that run here, the system monitor among them."""
        itself = () if _ITSELF in self.expected_processes else (_ITSELF,)
        return tuple(node for name in (*self.expected_processes, *itself) for node in BY_NAME[name].nodes)

    @field_validator("expected_processes")
    @classmethod
    def _processes_exist(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        for name in names:
            if name not in BY_NAME:
                raise ValueError(f"{name} is not a process of the contract")
        return names

    @field_validator("groups")
    @classmethod
    def _in_one_group(cls, groups: dict[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        nodes = [node for members in groups.values() for node in members]
        for node in nodes:
            if nodes.count(node) > 1:
                raise ValueError(f"{node} is in two groups")
        return groups
