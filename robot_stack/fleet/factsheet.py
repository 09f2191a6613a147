"""The factsheet, without its header (VDA 5050 2.1.0, 6.15; 3.0.0, 7.10): from the robot's configuration.

Fields have their names of 2.1.0; see ``names``.

Lengths in m in base_link, which is the vehicle's coordinate system.
"""

from __future__ import annotations

from typing import Any, Final

from robot_stack.core.mission import MAX_WAYPOINTS, SLOWEST
from robot_stack.core.robot import Footprint, Robot
from robot_stack.fleet import acceptance, instant
from robot_stack.fleet.codec import Data
from robot_stack.fleet.order import MAX_ID_LENGTH
from robot_stack.fleet.params import FleetParams
from robot_stack.fleet.vehicle import LOAD_POSITION, LOAD_TYPE, MAX_LOAD_ID_LENGTH, Vehicle
from robot_stack.fleet.version import Version

_MAX_ENUM_LENGTH: Final = 300  # longer texts of the robot are cut
_STANDS: Final = "The robot stands while it carries the action out, whatever the blocking type."
_POSE: Final = "Gives localization a pose; refused while a mission is under way or a wheelchair is attached."
_TEXTS: Final = {
    "pick": f"Docks to the wheelchair of a station and latches it. {_STANDS}",
    "drop": f"Puts the wheelchair down where the robot stands, and backs off. {_STANDS}",
    "wait": f"Manufacturer's own: waits. {_STANDS}",
    "startCharging": f"Docks to a charger, at the end of an order; it goes on after stopCharging alone. {_STANDS}",
    "stopCharging": "Leaves the charger, back to the node of startCharging.",
    "cancelOrder": "Stops at once. While docking the robot stands where it is, and staff look after it.",
    "startPause": "Pauses the order under way.",
    "stopPause": "Ends a pause by startPause, not that of a person.",
    "stateRequest": "Sends a state.",
    "factsheetRequest": "Sends the factsheet.",
    "initPosition": _POSE,
    "initializePosition": _POSE,
    "clearInstantActions": "Removes finished and failed instant actions from the state.",
}
_FIELDS: Final = {
    "order.nodes.nodePosition": ("REQUIRED", "the robot plans its paths between nodes itself"),
    "order.nodes.nodePosition.theta": ("SUPPORTED", "without it the robot faces the direction of travel"),
    "order.nodes.nodePosition.allowedDeviationXY": ("SUPPORTED", ""),
    "order.nodes.nodePosition.allowedDeviationTheta": ("SUPPORTED", ""),
}


def factsheet(robot: Robot, vehicle: Vehicle, params: FleetParams) -> Data:
    loaded = robot.with_passenger
    is_v3 = vehicle.version is Version.V3
    speeds = ("maximumSpeed", "maximumRotationSpeed") if is_v3 else ("maxSpeed", "maxRotationSpeed")
    fields = _FIELDS | {f"order.edges.{name}": ("SUPPORTED", f"at least {SLOWEST}") for name in speeds}
    return {
        "typeSpecification": {
            "seriesName": params.series_name,
            "seriesDescription": "carries a wheelchair with its passenger, latched to its front",
            "agvKinematic": "OMNI",
            "agvClass": "CARRIER",
            "maxLoadMass": robot.chair_mass_kg + robot.passenger_max_mass_kg,
            "localizationTypes": ["NATURAL"],
            "navigationTypes": ["FREELY_NAVIGATING" if is_v3 else "AUTONOMOUS"],
        }
        | ({"supportedZones": []} if is_v3 else {}),
        "physicalParameters": {
            "speedMin": params.standstill_mps,
            "speedMax": robot.empty.max_speed_mps,
            "accelerationMax": loaded.max_acceleration_mps2,
            "decelerationMax": robot.emergency_deceleration_mps2,
            "heightMin": robot.mast.top_m,
            "heightMax": robot.mast.top_m,
            "width": robot.footprint.width_m,
            "length": robot.footprint.front_m - robot.footprint.rear_m,
        },
        "protocolLimits": _limits(params, vehicle.version),
        "protocolFeatures": {
            "optionalParameters": [
                {"parameter": name, "support": support}
                | ({"description": text} if text else {})
                | ({"description": text} if text else {})
                for name, (support, text) in fields.items()
            ],
            "agvActions": [
                *(_action(name, "NODE", vehicle) for name in vehicle.node_actions),
                *(_action(name, "INSTANT", vehicle) for name in instant.supported(vehicle)),
            ],
        },
        "agvGeometry": {
            "wheelDefinitions": [
                {
                    "type": "DRIVE",
                    "isActiveDriven": True,
                    "isActiveSteered": True,
                    "position": {"x": x, "y": y},
                    "diameter": 2.0 * robot.wheel_radius_m,
                    "width": robot.wheel_width_m,
                }
                for x, y in robot.module_positions_m()
            ],
            "envelopes2d": [
                {"set": "empty", "polygonPoints": _polygon(robot.footprint)},
                {"set": "loaded", "polygonPoints": _polygon(robot.footprint_with_chair)},
            ],
        },
        "loadSpecification": {
            "loadPositions": [LOAD_POSITION],
            "loadSets": [
                {
                    "setName": "DEFAULT",
                    "loadType": LOAD_TYPE,
                    "loadPositions": [LOAD_POSITION],
                    "maxWeight": robot.chair_mass_kg + robot.passenger_max_mass_kg,
                    "agvSpeedLimit": loaded.max_speed_mps,
                    "agvAccelerationLimit": loaded.max_acceleration_mps2,
                }
            ],
        },
    }


def _limits(params: FleetParams, version: Version) -> Data:
    limits = params.limits
    states = {"state.actionStates": acceptance.MAX_ACTIONS + instant.MAX_STATES}
    if version is Version.V3:
        states = {
            "state.actionStates": acceptance.MAX_ACTIONS,
            "state.instantActionStates": instant.MAX_STATES,
        }
    return {
        "maxStringLens": {
            "msgLen": limits.message_bytes,
            "idLen": MAX_ID_LENGTH,
            "idNumericalOnly": False,
            "loadIdLen": MAX_LOAD_ID_LENGTH,
        }
        | ({"enumLen": _MAX_ENUM_LENGTH} if version is Version.V2 else {}),
        "maxArrayLens": {
            "order.nodes": MAX_WAYPOINTS,
            "order.edges": MAX_WAYPOINTS - 1,
            "node.actions": limits.actions_per_node,
            "instantActions": limits.instant_actions,
            "state.loads": 1,
        }
        | states,
        "timing": {
            "minOrderInterval": 1.0 / params.tick_rate_hz,
            "minStateInterval": params.state_min_interval_s,
            "defaultStateInterval": params.state_period_s,
        }
        | ({"visualizationInterval": 1.0 / params.visualization_rate_hz} if params.visualization_rate_hz else {}),
    }


def _action(name: str, scope: str, vehicle: Vehicle) -> Data:
    """2.1.0 without blockingTypes, for which its schema allows no array of the specification's values."""
    action: Data = {
        "actionType": name,
        "actionDescription": _TEXTS[name],
        "actionScopes": [scope],
    }
    if vehicle.version is Version.V3:
        on_node = scope == "NODE"
        action["blockingTypes"] = ["NONE", "SOFT", "SINGLE", "HARD"] if on_node else ["NONE"]
        action["pauseAllowed"] = action["cancelAllowed"] = on_node
    parameters = _parameters(name, vehicle)
    return action | ({"actionParameters": parameters} if parameters else {})


def _parameters(name: str, vehicle: Vehicle) -> list[Data]:
    chairs = ", ".join(sorted(dock for dock, kind in vehicle.docks.items() if kind == "wheelchair"))
    chargers = ", ".join(vehicle.chargers)
    pose = [
        ("x", "FLOAT", "m", False),
        ("y", "FLOAT", "m", False),
        ("theta", "FLOAT", "rad", False),
        ("mapId", "STRING", vehicle.map_id, False),
        ("lastNodeId", "STRING", "", False),
    ]
    types: dict[str, list[tuple[str, str, str, bool]]] = {
        "pick": [("stationName", "STRING", f"one of: {chairs}", False), *_LOAD_PARAMETERS],
        "drop": [("stationName", "STRING", "name of the place, without an effect", True), *_LOAD_PARAMETERS],
        "wait": [("duration", "FLOAT", "s", False)],
        "startCharging": [("stationName", "STRING", f"one of: {chargers}", len(vehicle.chargers) == 1)],
        "initPosition": pose,
        "initializePosition": pose,
    }
    if vehicle.version is Version.V3:
        types["cancelOrder"] = [("orderId", "STRING", "the order to be cancelled", True)]
    return [
        {"key": key, "valueDataType": kind, "isOptional": optional} | ({"description": text} if text else {})
        for key, kind, text, optional in types.get(name, ())
    ]


_LOAD_PARAMETERS: Final[list[tuple[str, str, str, bool]]] = [
    ("stationType", "STRING", "without an effect", True),
    ("loadType", "STRING", LOAD_TYPE, True),
    ("loadId", "STRING", "reported in loads", True),
    ("lhd", "STRING", LOAD_POSITION, True),
]


def _polygon(footprint: Footprint) -> list[dict[str, Any]]:
    half = 0.5 * footprint.width_m
    corners = (
        (footprint.front_m, half),
        (footprint.rear_m, half),
        (footprint.rear_m, -half),
        (footprint.front_m, -half),
    )
    return [{"x": x, "y": y} for x, y in corners]
