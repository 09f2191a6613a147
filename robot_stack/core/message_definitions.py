"""Message definitions as rosbag2 and Foxglove expect them: the .msg text followed by the text of every type it uses.

Read from the installed packages' ``share/<package>/msg``. The format: after the root type's text, for each type used,
in order of name and depth first, a line of 80 ``=``, a line ``MSG: package/Name``, and that type's text.
https://mcap.dev/spec/registry#ros2msg
"""

from __future__ import annotations

import json
import os
import re
import sys
from functools import cache
from pathlib import Path

_SEPARATOR = "=" * 80
# The first word of a line that is no comment, without array brackets and string bounds.
_FIELD_TYPE = re.compile(r"^\s*([A-Za-z][A-Za-z0-9_/]*)", re.MULTILINE)
_PRIMITIVES = frozenset(
    {
        *("bool", "byte", "char", "string", "wstring", "float32", "float64"),
        *("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64"),
    }
)


class DefinitionMissing(Exception):
    """The definition of a type is not installed."""


@cache
def message_definition(type_name: str) -> str:
    """The full text for ``package/msg/Name``. Raises DefinitionMissing."""
    parts: list[str] = []
    _append(type_name, parts, set())
    return "".join(parts)


@cache
def type_hash(type_name: str) -> str:
    """The RIHS01 hash of ``package/msg/Name`` as its package was built. Raises DefinitionMissing."""
    try:
        described = json.loads(_read(type_name, ".json"))
        return next(str(item["hash_string"]) for item in described["type_hashes"] if item["type_name"] == type_name)
    except (ValueError, KeyError, TypeError, StopIteration) as error:
        raise DefinitionMissing(f"no type hash of {type_name} is installed") from error


def _append(type_name: str, parts: list[str], seen: set[str]) -> None:
    text = _read(type_name, ".msg")
    parts.append(text)
    package = type_name.split("/")[0]
    for used in sorted(_used_types(text, package)):
        if used not in seen:
            seen.add(used)
            parts.append(f"\n{_SEPARATOR}\nMSG: {used}\n")
            _append(_full_name(used), parts, seen)


def _used_types(text: str, package: str) -> set[str]:
    words = {match.group(1) for match in _FIELD_TYPE.finditer(text)} - _PRIMITIVES
    return {word if "/" in word else f"{package}/{word}" for word in words}


def _full_name(name: str) -> str:
    package, *_, short = name.split("/")
    return f"{package}/msg/{short}"


def _read(type_name: str, suffix: str) -> str:
    package, kind, name = type_name.split("/")
    for prefix in (*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix):
        path = Path(prefix) / "share" / package / kind / f"{name}{suffix}"
        if prefix and path.is_file():
            return path.read_text(encoding="utf-8")
    raise DefinitionMissing(f"no definition of {type_name} is installed ({package}/{kind}/{name}{suffix})")
