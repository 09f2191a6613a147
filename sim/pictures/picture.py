"""Pictures of the robot in its world: ``python -m sim.pictures.picture --output ride.png``.

Renders off screen. Without a display MuJoCo needs EGL (Debian: libegl1, libgl1-mesa-dri), which is asked for by
``MUJOCO_GL=egl`` unless the environment sets it.
"""

from __future__ import annotations

import argparse
import itertools
import math
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

if __name__ == "__main__":  # not for an importing module: without EGL, mujoco could then not be imported at all
    os.environ.setdefault("MUJOCO_GL", "egl")

import mujoco
import PIL.Image

from robot_stack.core.config import ConfigError
from robot_stack.core.geometry import Pose2, Twist2
from robot_stack.core.robot import load_robot
from sim.params import load_sim_params
from sim.pictures.picture_figures import add_capsule, paint_boards, paint_passenger
from sim.plant.rig import Rig, TwistController
from sim.plant.world import Setup, World
from sim.worldfile import load_world

Image = NDArray[np.uint8]
_SUPERSAMPLING = 4
_SHADOW_PIXELS = 8192
_TURNS_DEG = {"behind": 35.0, "ahead": 140.0, "beside": 80.0}
_CHAIR_AHEAD_M = 0.45  # middle of robot and chair together
_ROUTE_COLOR = (0.95, 0.55, 0.10, 1.0)


@dataclass(frozen=True, slots=True)
class View:
    """A camera that looks at a point: distance in m, azimuth (0 = looking east) and elevation in degrees."""

    at_m: tuple[float, float, float]
    distance_m: float
    azimuth_deg: float
    elevation_deg: float


def beside(world: World, turn_deg: float) -> View:
    """The robot, and the wheelchair it holds, from close by; 0 degrees is from behind, 180 from ahead."""
    pose = world.truth().pose()
    if world.attached:
        middle = pose.compose(Pose2(_CHAIR_AHEAD_M, 0.0, 0.0))
        return View((middle.x, middle.y, 0.45), 3.9, math.degrees(pose.yaw) + turn_deg, -18.0)
    return View((pose.x, pose.y, 0.35), 3.2, math.degrees(pose.yaw) + turn_deg, -18.0)


def from_above(world: World) -> View:
    """The whole site."""
    floor = world.setup.world.floor
    width_m, depth_m = floor.max_x_m - floor.min_x_m, floor.max_y_m - floor.min_y_m
    middle = (0.5 * (floor.min_x_m + floor.max_x_m), 0.5 * (floor.min_y_m + floor.max_y_m), 0.0)
    return View(middle, 1.05 * max(width_m, depth_m), 90.0, -65.0)


def render(
    model: Any, data: Any, view: View, size: tuple[int, int], paint: Callable[[Any], object] = lambda _: None
) -> Image:
    """(height, width, 3) red, green, blue of MuJoCo's present state. size: width, height. paint: adds to the scene."""
    width, height = size
    model.vis.quality.offsamples = _SUPERSAMPLING
    model.vis.quality.shadowsize = _SHADOW_PIXELS
    model.vis.global_.offwidth = max(width, model.vis.global_.offwidth)
    model.vis.global_.offheight = max(height, model.vis.global_.offheight)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = view.at_m
    camera.distance, camera.azimuth, camera.elevation = view.distance_m, view.azimuth_deg, view.elevation_deg
    options = mujoco.MjvOption()
    options.geomgroup[:] = 1
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera, options)
        paint(renderer.scene)
        return np.array(renderer.render())


def _paint(scene: Any, world: World, route: Sequence[tuple[float, float]]) -> None:
    """route: points x, y in m, painted on the ground."""
    for begin, end in itertools.pairwise(route):
        add_capsule(scene, (*begin, 0.01), (*end, 0.01), 0.03, _ROUTE_COLOR)
    paint_boards(scene, world)
    paint_passenger(scene, world)


def ride_to(world: str, start: Pose2, twist: Twist2, duration_s: float, passenger_kg: float | None) -> World:
    """A world in which the robot has driven for a while, so that wheels are turned and bodies lean."""
    attached = passenger_kg is not None
    setup = Setup(load_world(world), 1, start, attached, attached, passenger_kg or 0.0)
    rig = Rig(load_robot(), load_sim_params(), setup)
    rig.run(duration_s, TwistController(rig.robot, lambda _: twist, attached), lambda _: None)
    return rig.sim.world


def main() -> int:
    options = _options()
    try:
        start = Pose2(options.x, options.y, math.radians(options.yaw))
        twist = Twist2(options.speed, 0.0, options.turn)
        world = ride_to(options.world, start, twist, options.after, options.passenger)
        routes = load_world(options.world).routes
        if options.route and options.route not in routes:
            raise ConfigError(f"world {options.world} has no route {options.route!r}; there are {', '.join(routes)}")
    except ConfigError as error:
        print(f"picture: {error}", file=sys.stderr)
        return 2
    view = from_above(world) if options.view == "above" else beside(world, _TURNS_DEG[options.view])
    points = routes[options.route].points_m if options.route else []
    size = (options.width, options.height)
    image = render(world.model, world.data, view, size, partial(_paint, world=world, route=points))
    PIL.Image.fromarray(image).save(options.output)
    print(options.output)
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="picture", description="A picture of the robot in its world.")
    parser.add_argument("--output", type=Path, required=True, help="PNG file")
    parser.add_argument("--world", default="yard", help="a world of config/worlds/")
    parser.add_argument("--view", choices=(*_TURNS_DEG, "above"), default="ahead")
    parser.add_argument("--route", default="", help="a route of the world, painted on the ground")
    parser.add_argument("--x", type=float, default=1.0, help="start, m")
    parser.add_argument("--y", type=float, default=0.0, help="start, m")
    parser.add_argument("--yaw", type=float, default=0.0, help="start, degrees")
    parser.add_argument("--speed", type=float, default=0.8, help="m/s")
    parser.add_argument("--turn", type=float, default=0.25, help="rad/s")
    parser.add_argument("--after", type=float, default=3.0, help="s of driving before the picture is taken")
    parser.add_argument("--passenger", type=float, help="kg; with a number the wheelchair hangs on the latch")
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=720)
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
