"""Names for annotations of parts that refer to each other, which avoids import cycles.

``SimPort`` is that of ``sim.scheduler.port``, ``Life`` that of ``process``, ``Scheduler`` that of ``scheduler``, and
``SimulatedStack`` that of ``sim.stack.stack``.
"""

from __future__ import annotations

from typing import Any, TypeAlias

SimPort: TypeAlias = Any
Life: TypeAlias = Any
Scheduler: TypeAlias = Any
SimulatedStack: TypeAlias = Any
