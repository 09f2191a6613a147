"""A robot among objects that appear and disappear, from the simulated LiDARs through perception to a safety verdict.

Everything is real except ROS and the drive: the robot executes every twist exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_stack.contract.frames import OVERHEAD_LIDAR
from robot_stack.core.config import load
from robot_stack.core.geometry import IDENTITY, ZERO_TWIST, Pose2, Twist2, exp_se2
from robot_stack.core.robot import load_robot
from robot_stack.core.robot_shape import load_robot_shape
from robot_stack.perception.params import PerceptionParams
from robot_stack.perception.pipeline import Pipeline, Scene
from robot_stack.perception.watch import Watch
from sim.camera.history import BASE
from sim.camera.motion import Track
from sim.lidar import labels
from sim.lidar.bodies import chair_shapes, robot_shapes
from sim.lidar.kernels import FIRST_SOLID
from sim.lidar.params import LidarParams, load_lidar_params
from sim.lidar.scene import WHEELCHAIR
from sim.lidar.scene import Scene as LidarScene
from sim.lidar.sensor import Lidar
from sim.lidar.shapes import BOX, CYLINDER, Shape, pack
from sim.params import load_sim_params

ROBOT = load_robot()
PARAMS = load(PerceptionParams, "perception_pipeline")
CHAIR_M = 0.95  # from base_link to the attached wheelchair's frame
STEP_S = 0.05


@dataclass(frozen=True)
class Post:
    """An upright cylinder, m: a child, a pole or a leg."""

    radius_m: float
    top_m: float

    def shape(self) -> Shape:
        half_m = 0.5 * self.top_m
        return Shape(CYLINDER, (0.0, 0.0, half_m), (self.radius_m, self.radius_m, half_m), labels.PERSON, 0.4)


@dataclass(frozen=True)
class Block:
    """A box, m: half length, half width, lowest and highest point."""

    half_x_m: float
    half_y_m: float
    low_m: float
    top_m: float

    def shape(self) -> Shape:
        middle_m, half_m = 0.5 * (self.low_m + self.top_m), 0.5 * (self.top_m - self.low_m)
        half = (self.half_x_m, self.half_y_m, half_m)
        return Shape(BOX, (0.0, 0.0, middle_m), half, labels.OF_KIND["wall"], 0.3)


Thing = Post | Block

# A LiDAR returns nothing nearer than 0.5 m, so a slender child 5 cm in front of the robot yields no point, and neither
# does a dog lower than the lowest ray.
CHILD, ADULT, POLE, DOG = Post(0.06, 0.62), Post(0.20, 1.70), Post(0.025, 1.50), Post(0.12, 0.40)


class Yard:
    """``step`` moves the robot by its twist and feeds half a LiDAR turn, and with every second one an overhead
    frame. Walls stand 12 m away all around.

    overhead: False for a silent overhead LiDAR. columns: per sweep, a third of the real number. mixed: share of
    beams at an edge that return a range between both surfaces. things: objects; ``at`` holds their positions in
    odom, None for an absent one.
    """

    def __init__(
        self, chair: bool = False, mixed: float = 0.0, overhead: bool = True, columns: int = 800, **things: Thing
    ) -> None:
        self.pose, self.twist, self.now_s = IDENTITY, ZERO_TWIST, 100.0
        self.chair = chair
        self.dirt_deg: tuple[float, float] | None = None  # bearings whose beams are blocked at the lens
        self._half = 0
        self._mixed, self._columns, self._has_overhead = mixed, columns, overhead
        self._lidar: Lidar | None = None
        self._overhead: Lidar | None = None
        self.put(**things)
        self.pipeline = Pipeline(ROBOT, PARAMS)
        self.pipeline.chair = chair
        self.watch = Watch(PARAMS.watch, ROBOT.lidar_xyz_m[2])
        self.problem = ""
        self.scene: Scene | None = None

    def put(self, **things: Thing) -> Yard:
        """Replaces the objects, absent until ``at`` says where they are. The noise goes on as with the former ones."""
        before = self._lidar, self._overhead
        self.at: dict[str, tuple[float, float] | None] = dict.fromkeys(things)
        self._lidar = _lidar(things, self._mixed, self._columns)
        self._overhead = _overhead_lidar(things, self._mixed) if self._has_overhead else None
        for old, new in zip(before, (self._lidar, self._overhead), strict=True):
            if old is not None and new is not None:
                new._random = old._random
        return self

    def reseed(self, seed: int) -> Yard:
        """Other noise of the LiDARs from here on."""
        for k, lidar in enumerate((self._lidar, self._overhead)):
            if lidar is not None:
                lidar._random = np.random.default_rng((seed, k))
        return self

    def step(self) -> Scene:
        """Runs one half sweep."""
        self.now_s += STEP_S
        before, self.pose = self.pose, self.pose.compose(exp_se2(self.twist, STEP_S))
        motion = self.pipeline.motion
        assert motion.on_odometry(self.now_s, self.pose, self.twist) == ""
        base = _track([(self.now_s - STEP_S, before), (self.now_s, self.pose)])
        movers = {name: _track([(self.now_s, Pose2(*at, 0.0))]) for name, at in self.at.items() if at is not None}
        if self.chair:
            movers[WHEELCHAIR] = _track(
                [(s, pose.compose(Pose2(CHAIR_M, 0.0, 0.0))) for s, pose in
                 ((self.now_s - STEP_S, before), (self.now_s, self.pose))]
            )  # fmt: skip
        self._half = 1 - self._half
        if self._overhead is not None and self._half:
            self.pipeline.overhead(self._overhead.sweep(base, self.now_s, movers).points, self.now_s)
        assert self._lidar is not None
        points = self._lidar.half_sweep(base, self.now_s, self._half, movers).points
        if self.dirt_deg is not None:
            bearing = np.degrees(np.arctan2(points["y"], points["x"]))
            points = points[(bearing < self.dirt_deg[0]) | (bearing > self.dirt_deg[1])]
        self.problem = self.watch.blind(points, self.now_s)
        self.scene = self.pipeline.scene(points, self.now_s, self.watch.obstructed)
        return self.scene

    def run(self, seconds: float, twist: Twist2 = ZERO_TWIST) -> Yard:
        self.twist = twist
        for _ in range(round(seconds / STEP_S)):
            self.step()
        return self

    def walk(self, name: str, to: tuple[float, float], speed_mps: float = 1.0) -> Yard:
        """Moves an object on a straight line while the robot keeps its twist."""
        begin = self.at[name]
        assert begin is not None
        distance_m = math.dist(begin, to)
        for share in np.arange(0.0, 1.0, STEP_S * speed_mps / distance_m):
            self.at[name] = (begin[0] + share * (to[0] - begin[0]), begin[1] + share * (to[1] - begin[1]))
            self.step()
        self.at[name] = to
        return self


def _lidar(things: dict[str, Thing], mixed: float, columns: int) -> Lidar:
    params = load_lidar_params().with_columns(columns)
    return Lidar(_scene(things, []), _with_mixed(params, mixed), ROBOT, seed=1)


def _overhead_lidar(things: dict[str, Thing], mixed: float) -> Lidar:
    params, own = load_lidar_params(OVERHEAD_LIDAR), robot_shapes(ROBOT, load_robot_shape())
    return Lidar(_scene(things, own), _with_mixed(params, mixed), ROBOT, 2, OVERHEAD_LIDAR)


def _with_mixed(params: LidarParams, mixed: float) -> LidarParams:
    """Sets the share of mixed returns. These reveal an object that is itself too near to return points."""
    return params.model_validate(
        {**params.model_dump(), "ranging": {**params.ranging.model_dump(), "mixed_share": mixed}}
    )


def _scene(things: dict[str, Thing], own: Sequence[Shape]) -> LidarScene:
    """own: shapes of the robot that the sensor sees."""
    chair = chair_shapes(load_sim_params().wheelchair, 0.3, passenger=True)
    walls = [_wall(12.0, 0.0, 0.1, 12.0), _wall(-12.0, 0.0, 0.1, 12.0), _wall(0.0, 12.0, 12.0, 0.1),
             _wall(0.0, -12.0, 12.0, 0.1)]  # fmt: skip
    shapes = pack(walls, [chair, *([post.shape()] for post in things.values()), *([own] if own else [])])
    return LidarScene(
        shapes=shapes,
        movers=(WHEELCHAIR, *things, *([BASE] if own else [])),
        rects=np.empty((0, 7)),
        label=np.concatenate([np.array([labels.GROUND] * FIRST_SOLID, np.uint8), shapes.label]),
        reflectivity=np.concatenate([np.full(FIRST_SOLID, 0.2, np.float32), shapes.reflectivity]),
    )


def _wall(x: float, y: float, half_x: float, half_y: float) -> Shape:
    return Shape(BOX, (x, y, 1.25), (half_x, half_y, 1.25), labels.OF_KIND["wall"], 0.5)


def _track(poses: list[tuple[float, Pose2]]) -> Track:
    matrices = np.tile(np.eye(4), (len(poses), 1, 1))
    for matrix, (_, pose) in zip(matrices, poses, strict=True):
        matrix[:3, :3] = Rotation.from_euler("z", pose.yaw).as_matrix()
        matrix[:2, 3] = pose.x, pose.y
    return Track(np.array([s for s, _ in poses]), matrices)


def state_at(yard: Yard, x_m: float, y_m: float) -> int:
    """Returns the state of the cell at a place in odom."""
    grid = yard.pipeline.space.grid()
    column = math.floor((x_m - grid.corner_m[0]) / grid.cell_m)
    row = math.floor((y_m - grid.corner_m[1]) / grid.cell_m)
    return int(grid.state[row, column])


def near(points: NDArray[np.float32], x_m: float, y_m: float, within_m: float = 0.25) -> int:
    """Returns the number of points within a distance of a place in base_link."""
    return int((np.hypot(points[:, 0] - x_m, points[:, 1] - y_m) <= within_m).sum())
