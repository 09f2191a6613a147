"""The frames of a film, from a story."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from robot_stack.core.geometry import Pose2
from robot_stack.core.robot import Robot
from robot_stack.core.robot_shape import Placed, RobotShape, Solid, placed, planar, robot_solids, transform
from robot_stack.film.camera import View, followed
from robot_stack.film.painter import Image, Painter
from robot_stack.film.params import FilmParams
from robot_stack.film.site import Site
from robot_stack.film.tracks import Story, moments, newest

Floats = NDArray[np.float64]

WHEELCHAIR, PERSON = "wheelchair", "person_"  # names of tracks
_PLAN_RGB, _TRAIL_RGB = (31, 184, 174), (240, 120, 24)
_PLAN_PX, _TRAIL_PX = 3.0, 1.5
_OBSTACLE_M = 0.12
_OBSTACLE_COLOUR = "#b05a50"
_SEEN_M = 14.0  # objects farther from the picture's middle are left out


class Film:
    """A story in a site."""

    def __init__(self, story: Story, site: Site, robot: Robot, shape: RobotShape, params: FilmParams) -> None:
        self._story, self._robot, self._shape, self._params = story, robot, shape, params
        self.count = max(2, round(params.length_s * params.frame_hz))
        self._times = moments(story.robot, self.count, params.standing_mps, params.turning_m)
        self._painter = Painter(site, params.width_px, params.height_px, params.supersampling)
        path = np.array([_ahead(story.robot.at(time_s)) for time_s in self._times])
        self._looks = followed(path, params.camera.calm_s * params.frame_hz)

    def frames(self) -> Iterator[tuple[float, Image]]:
        """(time of the ride in s since its beginning, picture)."""
        for time_s, at_m in zip(self._times.tolist(), self._looks, strict=True):
            view = View(self._params.camera, at_m, self._painter.size_px)
            picture = self._painter.paint(view, self._solids(time_s, at_m), self._lines(time_s))
            yield time_s - float(self._times[0]), picture

    def caption(self, frame: int) -> str:
        return str(newest(self._story.captions, float(self._times[frame]), ""))

    def _solids(self, time_s: float, at_m: Floats) -> list[Placed]:
        story, shape = self._story, self._shape
        base = planar(story.robot.at(time_s))
        solids = [
            Placed(part, solid, base @ pose)
            for part, solid, pose in robot_solids(self._robot, shape, story.joints_at(time_s))
        ]
        for name, track in story.others.items():
            pose = track.at(time_s)
            if math.hypot(pose.x - at_m[0], pose.y - at_m[1]) > _SEEN_M:
                continue
            if name == WHEELCHAIR:
                solids += placed(name, (*shape.wheelchair, *shape.passenger), planar(pose))
            else:
                solids += placed(name, shape.person if name.startswith(PERSON) else shape.station, planar(pose))
        return solids + self._obstacles(time_s)

    def _obstacles(self, time_s: float) -> list[Placed]:
        height_m = self._params.obstacle_height_m
        solid = Solid(
            kind="box",
            size_m=(_OBSTACLE_M, _OBSTACLE_M, height_m),
            at_m=(0.0, 0.0, 0.5 * height_m),
            turn_deg=(0.0, 0.0, 0.0),
            colour=_OBSTACLE_COLOUR,
        )
        points = newest(self._story.obstacles, time_s, np.empty((0, 2)))
        return [Placed("obstacle", solid, transform((x, y, 0.5 * height_m))) for x, y in points]

    def _lines(self, time_s: float) -> list[tuple[Floats, tuple[int, int, int], float]]:
        plan = newest(self._story.plans, time_s, np.empty((0, 2)))
        return [
            (self._story.robot.line(time_s), _TRAIL_RGB, _TRAIL_PX),
            (plan, _PLAN_RGB, _PLAN_PX),
        ]


def _ahead(pose: Pose2) -> tuple[float, float]:
    """The camera's target: between robot and wheelchair."""
    return pose.x + 0.4 * math.cos(pose.yaw), pose.y + 0.4 * math.sin(pose.yaw)
