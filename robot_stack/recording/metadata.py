"""``metadata.yaml`` beside the files of a recording, in the form of rosbag2 of ROS 2 Jazzy (version 9).

https://github.com/ros2/rosbag2, rosbag2_storage
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from robot_stack.contract.model import Qos
from robot_stack.core.atomic_file import replace_file
from robot_stack.core.config import ConfigError, read_yaml

METADATA_FILE = "metadata.yaml"
QOS_KEY = "offered_qos_profiles"
HASH_KEY = "topic_type_hash"
_VERSION = 9
_DISTRO = "jazzy"
# RMW_DURATION_INFINITE
_FOREVER = {"sec": 9_223_372_036, "nsec": 854_775_807}


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """A recorded topic: ``type`` is ``package/msg/Name``, ``qos`` rosbag2's list of offered profiles."""

    name: str
    type: str
    type_hash: str
    qos: tuple[dict[str, Any], ...]


@dataclass(frozen=True, slots=True)
class FileInfo:
    """One file: times in ns since the epoch of its first and last message (0 without any), messages by topic name."""

    name: str
    start_ns: int
    end_ns: int
    counts: dict[str, int]

    @property
    def messages(self) -> int:
        return sum(self.counts.values())


def offered_qos(qos: Qos) -> tuple[dict[str, Any], ...]:
    """rosbag2's description of a publisher with this QoS."""
    return (
        {
            "history": "keep_last",
            "depth": qos.depth,
            "reliability": qos.reliability.value,
            "durability": qos.durability.value,
            "deadline": dict(_FOREVER),
            "lifespan": dict(_FOREVER),
            "liveliness": "automatic",
            "liveliness_lease_duration": dict(_FOREVER),
            "avoid_ros_namespace_conventions": False,
        },
    )


def qos_text(qos: Sequence[dict[str, Any]]) -> str:
    """The profiles as YAML, for a channel's metadata."""
    return _dump(list(qos))


def qos_from_text(text: str) -> tuple[dict[str, Any], ...]:
    return tuple(yaml.safe_load(text) or ()) if text else ()


def bag_metadata(files: Sequence[FileInfo], topics: Sequence[TopicInfo]) -> dict[str, Any]:
    """The content of ``metadata.yaml`` under its root key."""
    with_messages = [file for file in files if file.messages]
    start_ns = min((file.start_ns for file in with_messages), default=0)
    end_ns = max((file.end_ns for file in with_messages), default=0)
    counts: Counter[str] = Counter()
    for file in files:
        counts.update(file.counts)
    return {
        "version": _VERSION,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end_ns - start_ns},
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "message_count": counts.total(),
        "topics_with_message_count": [_topic(topic, counts[topic.name]) for topic in topics],
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file.name for file in files],
        "files": [_file(file) for file in files],
        "custom_data": None,
        "ros_distro": _DISTRO,
    }


def metadata_text(files: Sequence[FileInfo], topics: Sequence[TopicInfo]) -> str:
    """The metadata as YAML, for the metadata record inside a file."""
    return _dump(bag_metadata(files, topics))


def write_metadata(folder: Path, files: Sequence[FileInfo], topics: Sequence[TopicInfo]) -> None:
    """Replaces the folder's ``metadata.yaml`` atomically."""
    replace_file(folder / METADATA_FILE, _dump({"rosbag2_bagfile_information": bag_metadata(files, topics)}))


def recorded_files(folder: Path) -> list[str]:
    """File names in the order of recording from ``metadata.yaml``; empty if it is missing or unreadable."""
    try:
        names = read_yaml(folder / METADATA_FILE)["rosbag2_bagfile_information"]["relative_file_paths"]
        return [Path(str(name)).name for name in names]
    except (ConfigError, KeyError, TypeError):
        return []


def _topic(topic: TopicInfo, messages: int) -> dict[str, Any]:
    return {
        "topic_metadata": {
            "name": topic.name,
            "type": topic.type,
            "serialization_format": "cdr",
            "offered_qos_profiles": [dict(item) for item in topic.qos],
            "type_description_hash": topic.type_hash,
        },
        "message_count": messages,
    }


def _file(file: FileInfo) -> dict[str, Any]:
    return {
        "path": file.name,
        "starting_time": {"nanoseconds_since_epoch": file.start_ns},
        "duration": {"nanoseconds": file.end_ns - file.start_ns},
        "message_count": file.messages,
    }


class _Plain(yaml.SafeDumper):
    """Without anchors, which yaml-cpp can read but which are hard to read for people."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _dump(data: Any) -> str:
    return yaml.dump(data, Dumper=_Plain, sort_keys=False, allow_unicode=True, default_flow_style=False)
