"""Prepares a new recording: checks the disk space and completes recordings of an earlier recorder."""

from __future__ import annotations

from pathlib import Path

from robot_stack.contract.model import Topic
from robot_stack.core.config import ConfigError
from robot_stack.recording.background import BackgroundWriter, disk_use
from robot_stack.recording.params import RecorderParams
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
        bag = BagWriter(folder, [topic_info(row) for row in rows], form)
    except OSError as error:
        raise ConfigError(f"recorder: {folder} cannot be made: {error.strerror or error}") from error
    return BackgroundWriter(
        bag,
        folder,
        flush_period_s=params.flush_period_s,
        max_disk_use=params.max_disk_use,
        queue_bytes=round(params.queue_mb * 1e6),
    )
