"""A suite that runs on several engines runs with all values on the engine process alone (test_process.py)."""

from __future__ import annotations

import os
from collections import defaultdict

import pytest

ALL_VARIABLE = "ROBOT_STACK_WMX_CONFORMANCE"
_THINNED = ("TestAdapterOnTheFake", "TestBridge")
_AT_MOST = 4
_WHOLE = ("test_call_on_a_closed_device",)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Limits the value sets per test of the thinned suites, evenly spread; keeps all if the variable is set."""
    if os.environ.get(ALL_VARIABLE) == "all":
        return
    groups: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        name = getattr(item, "originalname", item.name)
        if isinstance(item.parent, pytest.Class) and item.parent.name in _THINNED and name not in _WHOLE:
            groups[name].append(item)
    left_out = {
        item.nodeid
        for group in groups.values()
        for index, item in enumerate(group)
        if len(group) > _AT_MOST and index % -(-len(group) // _AT_MOST)
    }
    if left_out:
        config.hook.pytest_deselected(items=[item for item in items if item.nodeid in left_out])
        items[:] = [item for item in items if item.nodeid not in left_out]
