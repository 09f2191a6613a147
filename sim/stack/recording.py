"""The recording of a run on the scheduler, equal to that of the node ``recorder``."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from robot_stack.core.config import load
from robot_stack.core.kept_events import CONFIG_FILE
from robot_stack.recording.images import IMAGE_TYPE, DockingWatch, Thinning
from robot_stack.recording.params import RecorderParams
from robot_stack.recording.provenance import configuration
from robot_stack.recording.selection import selected
from robot_stack.recording.sweeps import SweepChoice
from sim.scheduler.observers import Recording

RUN_FILE = "run.json"
"""Name of the attachment with the seed, and the parameters that override the configuration by node and name."""


class MessageChoice:
    """Selects the messages to record, by ``config/recorder.yaml``."""

    def __init__(self, params: RecorderParams) -> None:
        self._sweeps = SweepChoice(params.sweeps, params.sweep_rate_hz)
        self._mode = params.images
        self.rows = [row for row in selected(params) if self._sweeps.subscribes(row) and not self._without(row.type)]
        self._thinned = {row.name for row in self.rows if self._sweeps.thins(row)}
        self._images = {row.name for row in self.rows if row.type == IMAGE_TYPE}
        self._image_rate = Thinning(params.image_rate_hz)
        self._docking = DockingWatch(params.image_tail_s)

    def on_docking(self, state: str, now_s: float) -> None:
        self._docking.on_status(state, now_s)

    def keeps(self, topic: str, now_s: float) -> bool:
        if topic in self._thinned:
            return self._sweeps.keeps(topic, now_s)
        if topic not in self._images:
            return True
        return (self._mode == "always" or self._docking.active(now_s)) and self._image_rate.keeps(topic, now_s)

    def _without(self, type_name: str) -> bool:
        return type_name == IMAGE_TYPE and self._mode == "never"


def record_run(
    folder: Path,
    clock_start_ns: int,
    docking_state: Callable[[], str],
    seed: int,
    parameters: Mapping[str, Mapping[str, Any]],
) -> Recording:
    """An observer for the scheduler. docking_state: of /docking/status. parameters: overrides by node and name.

    Raises ConfigError, OSError.
    """
    choice = MessageChoice(load(RecorderParams, "recorder"))

    def keeps(topic: str, ros_s: float) -> bool:
        choice.on_docking(docking_state(), ros_s)
        return choice.keeps(topic, ros_s)

    attachments = {CONFIG_FILE: configuration(), RUN_FILE: run_file(seed, parameters)}
    return Recording(folder, choice.rows, clock_start_ns, keeps, attachments=attachments)


def run_file(seed: int | None, parameters: Mapping[str, Mapping[str, Any]]) -> bytes:
    """The content of ``RUN_FILE``. seed: None if none is known."""
    return json.dumps({"seed": seed, "parameters": parameters}).encode()
