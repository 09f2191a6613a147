"""Latencies and computing times of the scheduler, ``config/scheduler.yaml``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from robot_stack.core.config import Config

PositiveMs = Annotated[float, Field(gt=0.0, le=600_000.0)]


class Spread(Config):
    """A lognormal duration by its median and its 99th percentile. Equal values make a constant."""

    median_ms: PositiveMs
    p99_ms: PositiveMs

    @model_validator(mode="after")
    def _ordered(self) -> Spread:
        if self.p99_ms < self.median_ms:
            raise ValueError(f"p99_ms ({self.p99_ms}) must not be below median_ms ({self.median_ms})")
        return self


class WorkerSpread(Spread):
    """parallel: the job may run in a thread while virtual time goes on; only for jobs without side effects.

    None: by the node's ``world_waits``.
    """

    parallel: bool | None = None


class LatencyParams(Config):
    """small, bulk: rows without an entry of their own. call: services and actions, each way. rows: by topic name."""

    small: Spread
    bulk: Spread
    call: Spread
    rows: dict[str, Spread]


class DiscoveryParams(Config):
    """appear: from the creation of an endpoint until all others know it. leave: from its orderly end on.

    lease_s: from the end of a killed process until its endpoints vanish.
    """

    appear: Spread
    leave: Spread
    lease_s: Annotated[float, Field(gt=0.0, le=120.0)]


class NamedSpreads(Config):
    """names: by the name of a node or process; the others take ``default``."""

    default: Spread
    names: dict[str, Spread]

    def of(self, name: str) -> Spread:
        return self.names.get(name, self.default)


class WorkerParams(Config):
    """names: by the name of a worker."""

    default: WorkerSpread
    names: dict[str, WorkerSpread]

    def of(self, name: str) -> WorkerSpread:
        return self.names.get(name, self.default)


class SchedulerParams(Config):
    """start: from the order to start a process until its first node is constructed. construction: of each node.

    compute: of each node, per wake-up. workers: per job.
    """

    latency: LatencyParams
    discovery: DiscoveryParams
    start: NamedSpreads
    construction: NamedSpreads
    compute: NamedSpreads
    workers: WorkerParams
