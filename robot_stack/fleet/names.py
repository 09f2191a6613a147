"""Names of VDA 5050 3.0.0 for fields and values that the code calls by their names of 2.1.0."""

from __future__ import annotations

from typing import Any, Final

from robot_stack.fleet.version import Version

_FIELDS: Final = {
    # state and visualization
    "agvPosition": "mobileRobotPosition",
    "positionInitialized": "localized",
    "batteryState": "powerSupply",
    "batteryCharge": "stateOfCharge",
    "resultDescription": "actionResult",
    "infoDescription": "infoDescriptor",
    "eStop": "activeEmergencyStop",
    # factsheet
    "agvKinematic": "mobileRobotKinematics",
    "agvClass": "mobileRobotClass",
    "maxLoadMass": "maximumLoadMass",
    "speedMin": "minimumSpeed",
    "speedMax": "maximumSpeed",
    "accelerationMax": "maximumAcceleration",
    "decelerationMax": "maximumDeceleration",
    "heightMin": "minimumHeight",
    "heightMax": "maximumHeight",
    "maxStringLens": "maximumStringLengths",
    "msgLen": "maximumMessageLength",
    "idLen": "maximumIdLength",
    "loadIdLen": "maximumLoadIdLength",
    "maxArrayLens": "maximumArrayLengths",
    "minOrderInterval": "minimumOrderInterval",
    "minStateInterval": "minimumStateInterval",
    "agvActions": "mobileRobotActions",
    "agvGeometry": "mobileRobotGeometry",
    "set": "envelope2dId",
    "polygonPoints": "vertices",
    "maxWeight": "maximumWeight",
    "agvSpeedLimit": "maximumSpeed",
    "agvAccelerationLimit": "maximumAcceleration",
}
# Of fields that hold nothing else by these names.
_VALUES: Final = {
    ("connectionState", "CONNECTIONBROKEN"): "CONNECTION_BROKEN",
    ("agvKinematic", "OMNI"): "OMNIDIRECTIONAL",
    ("valueDataType", "FLOAT"): "NUMBER",
}


def written(data: Any, version: Version) -> Any:
    """``data`` with the names of ``version``."""
    if version is Version.V2:
        return data
    if isinstance(data, list):
        return [written(item, version) for item in data]
    if not isinstance(data, dict):
        return data
    return {
        _FIELDS.get(key, key): _VALUES.get((key, value), value) if isinstance(value, str) else written(value, version)
        for key, value in data.items()
    }
