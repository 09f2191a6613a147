"""Opens a recording or the black box: checks the disk space and completes recordings of an earlier recorder."""

from __future__ import annotations

import math
from pathlib import Path

from robot_stack.contract.model import Topic
from robot_stack.core.config import ConfigError
from robot_stack.core.kept_events import CONFIG_FILE
from robot_stack.recording.background import BackgroundWriter, disk_use
from robot_stack.recording.black_box_files import BlackBox, Clocks, Provenance
from robot_stack.recording.params import BlackBoxParams, RecorderParams
from robot_stack.recording.provenance import configuration
from robot_stack.recording.recovery import recover_all
from robot_stack.recording.writer import BagWriter, Format, topic_info


def prepare_folder(output: Path, max_disk_use: float) -> list[str]:
    """Makes the folder and completes recordings of an earlier recorder. Raises ConfigError if the disk is full."""
    need_room(output, max_disk_use)
    try:
        return recover_all(output)
    except OSError as error:
        raise _unusable(output, error) from error


def need_room(output: Path, max_disk_use: float) -> None:
    """Makes the folder. Raises ConfigError if this fails or the disk use exceeds its limit."""
    try:
        output.mkdir(parents=True, exist_ok=True)
        use = disk_use(output)
    except OSError as error:
        raise _unusable(output, error) from error
    if use >= max_disk_use:
        limit = f"limit max_disk_use {max_disk_use:.0%}"
        raise ConfigError(f"recorder: the disk of {output} is {use:.0%} full, {limit}")


def _unusable(output: Path, error: OSError) -> ConfigError:
    return ConfigError(f"recorder: output_folder {output} cannot be used: {error.strerror or error}")


def open_recording(folder: Path, rows: list[Topic], params: RecorderParams) -> BackgroundWriter:
    """Raises ConfigError if the folder cannot be made."""
    form = Format(
        split_bytes=round(params.split_size_mb * 1e6),
        chunk_bytes=round(params.chunk_size_kb * 1e3),
        compress=params.compression == "zstd",
    )
    try:
        bag = BagWriter(folder, [topic_info(row) for row in rows], form, {CONFIG_FILE: configuration()})
    except OSError as error:
        raise ConfigError(f"recorder: {folder} cannot be made: {error.strerror or error}") from error
    return BackgroundWriter(
        bag,
        folder,
        flush_period_s=params.flush_period_s,
        max_disk_use=params.max_disk_use,
        queue_bytes=round(params.queue_mb * 1e6),
    )


def open_black_box(
    folder: Path, rows: list[Topic], params: BlackBoxParams, kept: Provenance, clocks: Clocks
) -> tuple[BlackBox, BackgroundWriter]:
    """The black box and the thread that writes it. Raises ConfigError if the folder cannot be made."""
    box = make_black_box(folder, rows, params, kept, clocks)
    # The black box gives room by itself and never ends because of a full disk.
    return box, BackgroundWriter(
        box,
        folder,
        flush_period_s=params.flush_period_s,
        max_disk_use=math.inf,
        queue_bytes=round(params.queue_mb * 1e6),
    )


def make_black_box(
    folder: Path, rows: list[Topic], params: BlackBoxParams, kept: Provenance, clocks: Clocks
) -> BlackBox:
    """Raises ConfigError if the folder cannot be made."""
    try:
        return BlackBox(folder, [topic_info(row) for row in rows], params, kept, clocks)
    except OSError as error:
        raise ConfigError(f"black_box: {folder} cannot be used: {error.strerror or error}") from error
