"""Selection of the recorded topics."""

from __future__ import annotations

from fnmatch import fnmatchcase

from robot_stack.contract import topics
from robot_stack.contract.model import Topic
from robot_stack.core.config import ConfigError
from robot_stack.recording.params import SelectionParams


def selected(params: SelectionParams, node: str = "recorder") -> list[Topic]:
    """The rows to record, by the parameters of ``node``; never the copies for remote viewers.

    A recorder would be their permanent subscriber, and their images are neither selected nor blurred.

    Raises ConfigError for a pattern that fits no topic, and if none is left.
    """
    rows = topics.of_system(*params.systems)
    # Topics of another machine may be excluded here as well.
    for field, known in (("include", rows), ("exclude", topics.TOPICS)):
        for pattern in getattr(params, field):
            if not any(fnmatchcase(row.name, pattern) for row in known):
                raise ConfigError(f"{node}: {field}: {pattern!r} fits no topic of the contract")
    originals = [row for row in rows if row not in topics.REMOTE_COPIES]
    chosen = [row for row in originals if _fits(row, params.include) and not _fits(row, params.exclude)]
    if not chosen:
        raise ConfigError(f"{node}: include and exclude leave no topic to record")
    return chosen


def _fits(row: Topic, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(row.name, pattern) for pattern in patterns)
