"""Robots of other dimensions: one configuration folder each, in which only robot.yaml differs from the shipped one."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from robot_stack.core.config import config_dir, read_yaml

_HOOK_M = 0.02  # from the ends of the rails, held by the latch, back to the chassis
_CHAIR_M = 0.90  # from the latch to the front of a latched wheelchair
_LATCH_PLATES_M = 0.70  # width of the plates with the hooks; wheelchairs are the same for small and large robots


@dataclass(frozen=True, slots=True)
class Size:
    """factor: scales all lengths not shared with the wheelchair. camera_m: height of both cameras, whose target is a
    board 0.45 m above the ground. lidar: x, y, z m and roll, pitch, yaw deg of its mounting. rear: the rear modules'
    (x, y), as a share of the shipped robot's before scaling."""

    factor: float
    camera_m: float
    lidar_m: tuple[float, float, float]
    lidar_deg: tuple[float, float, float]
    rear: tuple[float, float] = (1.0, 1.0)

    def robot(self, shipped: dict[str, Any]) -> dict[str, Any]:
        """robot.yaml of this size."""
        f = self.factor
        made = dict(shipped)
        for name in ("wheel_radius_m", "wheel_width_m", "centre_of_gravity_height_m"):
            made[name] = f * shipped[name]
        share = {"fl": (1.0, 1.0), "fr": (1.0, 1.0), "rl": self.rear, "rr": self.rear}
        made["modules"] = {
            name: {"x_m": f * share[name][0] * at["x_m"], "y_m": f * share[name][1] * at["y_m"]}
            for name, at in shipped["modules"].items()
        }
        made["mass_kg"] = f * f * shipped["mass_kg"]
        latch_m = f * shipped["latch"]["x_m"]
        made["latch"] = {**shipped["latch"], "x_m": latch_m}
        chassis = {name: f * value for name, value in shipped["chassis"].items()}
        made["chassis"] = {**chassis, "length_m": 2.0 * (latch_m - _HOOK_M)}
        footprint = {name: f * value for name, value in shipped["footprint"].items()}
        width_m = max(footprint["width_m"], _LATCH_PLATES_M)
        made["footprint"] = {**footprint, "width_m": width_m}
        wide_m = max(shipped["footprint_with_chair"]["width_m"], width_m)
        front = {"front_m": latch_m + _CHAIR_M, "rear_m": footprint["rear_m"], "width_m": wide_m}
        made["footprint_with_chair"] = front
        for name in ("front_camera_xyz_m", "rear_camera_xyz_m"):
            made[name] = [f * shipped[name][0], 0.02 * (f - 1.0), self.camera_m]
        made["mast"] = {**shipped["mast"], "x_m": f * shipped["mast"]["x_m"], "bottom_m": chassis["top_m"]}
        sensors = {name: dict(sensor) for name, sensor in shipped["range_sensors"].items()}
        sensors["lidar"] |= {"xyz_m": list(self.lidar_m), "rpy_deg": list(self.lidar_deg)}
        x, y, z = sensors["overhead_lidar"]["xyz_m"]
        sensors["overhead_lidar"]["xyz_m"] = [f * x, y, z]
        made["range_sensors"] = sensors
        return made

    def write(self, folder: Path) -> Path:
        """Writes the configuration folder of such a robot into ``folder``."""
        made = folder / "config"
        shutil.copytree(config_dir(), made)
        robot = self.robot(read_yaml(made / "robot.yaml"))
        (made / "robot.yaml").write_text(yaml.safe_dump(robot, sort_keys=False), encoding="utf-8")
        return made


SIZES = {
    "small": Size(0.8, 0.44, (0.05, 0.0, 0.58), (0.0, 0.0, 90.0)),
    "middle": Size(1.0, 0.45, (-0.12, 0.06, 0.85), (0.0, 4.0, 0.0)),
    "large": Size(1.25, 0.47, (0.32, 0.0, 1.05), (1.5, -3.0, -35.0), rear=(0.85, 0.75)),
}
"""Three robots with different LiDAR mountings, the large one with a narrower rear nearer to its centre."""
