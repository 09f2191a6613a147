"""Every action of the specification's table in every scope that it has there (2.1.0, 6.8.1; 3.0.0, table 4).

Instant actions that the robot has are tested in ``test_fleet_instant_actions.py`` and ``test_fleet_charging.py``.
"""

from __future__ import annotations

from typing import Any, Final

import pytest

from robot_stack.fleet.errors import ErrorType
from robot_stack.fleet.instant import supported
from robot_stack.fleet.version import Version
from tests.unit.fleet.master import Bench, action, error_types, order, route, statuses

_COMMON: Final = {
    "startPause": "instant",
    "stopPause": "instant",
    "startCharging": "instant node",
    "stopCharging": "instant node",
    "enableMap": "instant node",
    "downloadMap": "instant",
    "deleteMap": "instant",
    "stateRequest": "instant",
    "logReport": "instant",
    "pick": "node edge",
    "drop": "node edge",
    "detectObject": "node edge",
    "finePositioning": "node edge",
    "waitForTrigger": "node",
    "cancelOrder": "instant",
    "factsheetRequest": "instant",
}
TABLES: Final = {
    Version.V2: {**_COMMON, "initPosition": "instant node"},
    Version.V3: {
        **_COMMON,
        "initializePosition": "instant node",
        "startHibernation": "instant",
        "stopHibernation": "instant",
        "shutdown": "instant",
        "downloadZoneSet": "instant",
        "enableZoneSet": "instant node",
        "deleteZoneSet": "instant",
        "clearInstantActions": "instant node",
        "clearZoneActions": "instant node",
        "trigger": "instant",
        "retry": "instant",
        "skipRetry": "instant",
        "updateCertificate": "instant",
    },
}
PARAMETERS: Final[dict[str, dict[str, Any]]] = {"pick": {"stationName": "chair_1"}}
ON_NODES: Final = ("pick", "drop", "startCharging")
ROWS: Final = [
    (version, name, scope) for version, table in TABLES.items() for name, in_ in table.items() for scope in in_.split()
]


@pytest.mark.parametrize(("version", "name", "scope"), ROWS)
def test_an_action_is_carried_out_or_refused_by_name(version: Version, name: str, scope: str) -> None:
    bench = Bench(version)
    entry = action(name, "one", **PARAMETERS.get(name, {}))
    if scope == "instant":
        state = bench.instant(entry)
        if name in supported(bench.vehicle):
            assert not any("unknown" in error["errorDescription"] for error in state["errors"])
            return
        kind = ErrorType.INSTANT_ACTION
        assert statuses(state) == {"one": "FAILED"}
    else:
        data = order(route("a", "b"))
        part = data["nodes" if scope == "node" else "edges"][-1]
        before = [action("pick", "first", **PARAMETERS["pick"])] if (name, scope) == ("drop", "node") else []
        part["actions"] = [*before, entry]
        state = bench.order(data)
        if scope == "node" and name in ON_NODES:
            assert (error_types(state), state["orderId"]) == ([], "order_1")
            return
        kind = ErrorType.ORDER_ACTION
        assert state["orderId"] == ""
    assert error_types(state) == bench.named(kind)
    assert name in state["errors"][0]["errorDescription"]
    references = [one["referenceKey"] for one in state["errors"][0]["errorReferences"]]
    assert ("edgeId" if scope == "edge" else "actionId") in references
