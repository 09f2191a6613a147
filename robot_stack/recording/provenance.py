"""What an event of the black box keeps beside its messages: software, map, configuration, states of the nodes."""

from __future__ import annotations

import hashlib
import io
import tarfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import robot_stack
from robot_stack.core.config import config_dir
from robot_stack.core.kept_events import MapUsed, NodeSnapshot, Software
from robot_stack.core.node_record import NodeRecords, names
from robot_stack.core.site_map import map_checksum
from robot_stack.recording.black_box_files import Provenance


def provenance(map_name: str, monotonic_s: Callable[[], float]) -> Provenance:
    """As of now, when the nodes read the same configuration. monotonic_s: the clock of the nodes' records.

    Raises ConfigError for an unknown map, OSError.
    """
    used = MapUsed(name=map_name, sha256=map_checksum(map_name)) if map_name else None
    return Provenance(_software(), used, configuration(), partial(_nodes, NodeRecords(), monotonic_s))


def _software() -> Software:
    folder, total = Path(robot_stack.__file__).parent, hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        total.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    return Software(version=robot_stack.__version__, sha256=total.hexdigest())


def configuration() -> bytes:
    """The YAML files in force as a tar archive; maps are identified by their checksums, which are among them.

    Raises ConfigError, OSError.
    """
    folder, packed = config_dir(), io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w:gz") as archive:
        for path in sorted(folder.rglob("*.yaml")):
            archive.add(path, f"config/{path.relative_to(folder)}", recursive=False)
    return packed.getvalue()


def _nodes(records: NodeRecords, monotonic_s: Callable[[], float]) -> tuple[NodeSnapshot, ...]:
    now_s = monotonic_s()
    states = [(name, records.read(name)) for name in names()]
    return tuple(
        NodeSnapshot(name=name, pid=state.pid, ready=state.ready, text=state.text, silent_s=now_s - state.beat_s)
        for name, state in states
        if state is not None
    )
