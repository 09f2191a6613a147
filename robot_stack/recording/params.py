"""Parameters of the recorder and of the black box, ``config/recorder.yaml`` and ``config/black_box.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StringConstraints, model_validator

from robot_stack.contract.faults import BY_CODE
from robot_stack.contract.model import System
from robot_stack.core.config import Config

# A name of a folder, not a path: no slash, no leading dot.
FolderName = Annotated[str, StringConstraints(pattern=r"^([A-Za-z0-9_][A-Za-z0-9_.+-]*)?$", max_length=128)]


class SelectionParams(Config):
    """What is recorded, and how it is written."""

    systems: Annotated[tuple[System, ...], Field(min_length=1)]
    include: tuple[str, ...]
    exclude: tuple[str, ...]
    max_disk_use: Annotated[float, Field(gt=0.0, le=0.99)]
    flush_period_s: Annotated[float, Field(ge=0.05, le=1.0)]
    chunk_size_kb: Annotated[float, Field(ge=1.0, le=65_536.0)]
    compression: Literal["zstd", "none"]
    images: Literal["docking", "always", "never"]
    image_rate_hz: Annotated[float, Field(gt=0.0, le=100.0)]
    image_tail_s: Annotated[float, Field(ge=1.0, le=60.0)]
    sweeps: Literal["thinned", "always", "never"]
    sweep_rate_hz: Annotated[float, Field(gt=0.0, le=100.0)]
    queue_mb: Annotated[float, Field(ge=1.0, le=1024.0)]

    @model_validator(mode="after")
    def _one_machine(self) -> SelectionParams:
        if System.ROBOT in self.systems and System.WMX in self.systems:
            raise ValueError("systems: robot and wmx use the same topic names for different machines")
        return self


class RecorderParams(SelectionParams):
    output_folder: str
    name: FolderName
    split_size_mb: Annotated[float, Field(ge=0.1, le=100_000.0)]


class BlackBoxParams(SelectionParams):
    """See ``config/black_box.yaml``."""

    before_s: Annotated[float, Field(ge=5.0, le=600.0)]
    after_s: Annotated[float, Field(ge=1.0, le=120.0)]
    segment_s: Annotated[float, Field(ge=1.0, le=60.0)]
    segment_max_mb: Annotated[float, Field(ge=0.01, le=10_000.0)]
    event_max_s: Annotated[float, Field(ge=60.0, le=3600.0)]
    ignored_faults: tuple[str, ...]
    silence_s: Annotated[float, Field(ge=1.0, le=60.0)]
    settle_s: Annotated[float, Field(ge=0.0, le=600.0)]
    image_block_px: Annotated[int, Field(ge=0, le=256)]
    retention_days: Annotated[float, Field(gt=0.0, le=3650.0)]
    retention_gb: Annotated[float, Field(gt=0.0, le=100_000.0)]
    rides_retention_days: Annotated[float, Field(gt=0.0, le=3650.0)]
    map: str

    @model_validator(mode="after")
    def _known_faults(self) -> BlackBoxParams:
        if unknown := sorted(set(self.ignored_faults) - BY_CODE.keys()):
            raise ValueError(f"ignored_faults: {', '.join(unknown)}: no fault of the contract")
        return self
