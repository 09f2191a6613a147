"""The type hashes (RIHS01) of the installed interface packages. Run as a program to lock those of the project's types:

    .venv/bin/python -m tests.contract.type_hashes

Two computers communicate only if their hashes agree, so a new lock is a change of the robot's interfaces.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

OWN_PACKAGES = ("custom_msgs", "wmx_ros2_message")
UPSTREAM_PACKAGES = ("control_msgs", "nav2_msgs", "tf2_msgs")
OWN_LOCK = Path(__file__).with_name("type_hashes_own.json")
UPSTREAM_LOCK = Path(__file__).with_name("type_hashes_upstream.json")


def share_of(package: str) -> Path:
    """The package's installed share folder: in the environment, else in a sourced ROS 2 installation."""
    prefixes = [sys.prefix, *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))]
    shares = [Path(prefix) / "share" / package for prefix in prefixes]
    found = next((share for share in shares if (share / "package.xml").is_file()), None)
    if found is None:
        raise FileNotFoundError(f"{package} is not installed in any of {prefixes}; run launch_scripts/setup")
    return found


def installed(package: str) -> dict[str, str]:
    """Type name -> RIHS01 string, of every type of the package, read from the descriptions that rosidl generated."""
    hashes: dict[str, str] = {}
    for kind in ("msg", "srv", "action"):
        for description in sorted((share_of(package) / kind).glob("*.json")):
            entries = json.loads(description.read_text())["type_hashes"]
            hashes |= {e["type_name"]: e["hash_string"] for e in entries if e["type_name"].startswith(f"{package}/")}
    return hashes


def locked(lock: Path) -> dict[str, str]:
    return dict(json.loads(lock.read_text())["types"])


def lock_own() -> None:
    types: dict[str, str] = {}
    for package in OWN_PACKAGES:
        types |= installed(package)
    OWN_LOCK.write_text(json.dumps({"types": dict(sorted(types.items()))}, indent=2) + "\n")


if __name__ == "__main__":
    lock_own()
