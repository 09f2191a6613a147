"""Checks the contract's interface packages: installed, and built from this checkout's definitions."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

from robot_stack.contract import actions, services, topics

_ROOT = Path(__file__).resolve().parents[2]


def contract_types() -> list[str]:
    """Every interface type of the contract, ``package/kind/Name``."""
    typed = (topics.TOPICS, services.SERVICES, actions.ACTIONS)
    return sorted({row.type for rows in typed for row in rows})


def examine_interfaces() -> tuple[list[str], list[str], int]:
    """Types that fail to import, types whose installed definition differs from the checkout's, number of types."""
    types = contract_types()
    missing = [name for name in types if not _importable(name)]
    different = [name for name in types if name not in missing and _differs(name)]
    return missing, different, len(types)


def _importable(type_name: str) -> bool:
    package, kind, name = type_name.split("/")
    try:
        return hasattr(importlib.import_module(f"{package}.{kind}"), name)
    except ImportError:
        return False


def _differs(type_name: str) -> bool:
    """False also if one of the two is missing: a system package, or an installation without sources."""
    package, kind, name = type_name.split("/")
    source = _ROOT / package / kind / f"{name}.{kind}"
    installed = Path(sys.prefix) / "share" / package / kind / f"{name}.{kind}"
    if not source.is_file() or not installed.is_file():
        return False
    return source.read_bytes() != installed.read_bytes()
