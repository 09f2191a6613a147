"""The simulated LiDAR: sweeps and half sweeps from timed poses, without ROS and without pacing.

    scene = build_scene(world, params, sim_params.wheelchair, people=("person_anna",))
    lidar = Lidar(scene, params, robot, seed)
    sweep = lidar.sweep(base_track, stamp_s, {"person_anna": track})

Frames: tracks hold base_link, wheelchair and people in map; points are in the frame of the
sensor that ``config/robot.yaml`` names, as a driver publishes them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_stack.contract import frames
from robot_stack.core.point_cloud import SWEEP, Points
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.core.robot import Robot
from sim.camera.history import BASE
from sim.camera.motion import Track
from sim.lidar import returns as model
from sim.lidar.glass import look_through
from sim.lidar.kernels import AIRBORNE_HIT, BLOCK, FIRST_SOLID, GROUND_HIT, WET_HIT, cast_ground, cast_solids
from sim.lidar.mirror import mirror
from sim.lidar.params import LidarParams
from sim.lidar.poses import poses_at
from sim.lidar.scene import Scene
from sim.lidar.shapes import F32, F64, Beams, Met, Solids
from sim.lidar.still_view import StillView
from sim.lidar.sun import Sun, dazzle, towards
from sim.lidar.weather import Particles, Weather, draw, meet, particles


@dataclass(frozen=True, slots=True)
class Conditions:
    """Conditions of a measurement.

    noise_factor: multiplies the noise. covered_share: of the circle, from ahead. weather: None if it is dry.
    sun: None without glare.
    """

    noise_factor: float = 1.0
    covered_share: float = 0.0
    weather: Weather | None = None
    sun: Sun | None = None


CLEAR = Conditions()
_BELOW_EVERYTHING_M = -1.0e3
_BANK = 1 << 19
_SURE_SIGNAL = 10.0  # of ``returns``: detected almost always
_OF_RINGS, _OF_WEATHER, _OF_SUN, _OF_GLASS = 1, 2, 3, 4
_UNMOVED = np.eye(4)


@dataclass(frozen=True, slots=True)
class Sweep:
    """points: ``SWEEP`` records, times relative to stamp_s, which is when the last column fired. labels: (n,)."""

    stamp_s: float
    points: Points
    labels: NDArray[np.uint8]


def join(first: Sweep, second: Sweep) -> Sweep:
    """Two parts that follow each other, as one at the second's stamp."""
    middle = len(first.points)
    points = np.empty(middle + len(second.points), SWEEP)  # numpy's concatenate would pack the records
    points[:middle], points[middle:] = first.points, second.points
    points["time"][:middle] -= np.float32(second.stamp_s - first.stamp_s)
    return Sweep(second.stamp_s, points, np.concatenate((first.labels, second.labels)))


class Lidar:
    """One sensor of ``config/robot.yaml``. seed: its true mounting, its rings' errors and its noise."""

    def __init__(self, scene: Scene, params: LidarParams, robot: Robot, seed: int, sensor: str = frames.LIDAR) -> None:
        self.scene, self.params, self.seed = scene, params, seed
        beams = params.beams
        random = np.random.default_rng(seed)
        self.mounting = _mounting(robot.range_sensors[sensor], params, random)
        turned = robot.to_sensor_frame(sensor).astype(np.float32)
        self._turned: F32 | None = None if (turned == np.eye(3)).all() else turned
        self._random = random
        start = math.radians(beams.start_azimuth_deg)
        self._azimuths: F64 = start - 2.0 * np.pi * np.arange(beams.columns) / beams.columns
        self._nominal: F64 = np.radians(np.linspace(beams.lowest_deg, beams.highest_deg, beams.rings))
        own = np.random.default_rng((seed, _OF_RINGS))  # other numbers than those of mounting and noise
        self._biases_m: F64 = params.ranging.range_bias_m * own.uniform(-1.0, 1.0, beams.rings)
        off_deg = params.ranging.elevation_bias_deg * own.uniform(-1.0, 1.0, beams.rings)
        self._elevations: F64 = self._nominal + np.radians(off_deg)
        self._normals = random.standard_normal(_bank_size(beams.columns * beams.rings), dtype=np.float32)
        self._uniforms = random.random(len(self._normals), dtype=np.float32)
        self._model = _model(params)
        self._weather_random = np.random.default_rng((seed, _OF_WEATHER))
        self._sun_random = np.random.default_rng((seed, _OF_SUN))
        self._glass_random = np.random.default_rng((seed, _OF_GLASS))
        self._is_glass = np.zeros(FIRST_SOLID + len(scene.shapes.kind), np.bool_)  # by number of what was met
        self._is_glass[FIRST_SOLID + np.array(scene.glass, np.int64)] = True
        self._air: dict[Weather, tuple[Particles, F32]] = {}
        self._has_wet_ground = bool((scene.rects[:, 6] == 0.0).any())
        shape = (beams.columns, beams.rings)
        self._ranges, self._cosines = np.empty(shape, np.float32), np.empty(shape, np.float32)
        self._hits = np.empty(shape, np.int16)
        self._fixed = int((scene.shapes.mover < 0).sum())  # fixed shapes come first
        self._still: dict[tuple[int, int], StillView] = {}

    @property
    def columns(self) -> int:
        return self.params.beams.columns

    @property
    def column_s(self) -> float:
        """From one column to the next, s."""
        return self.params.beams.period_s / self.columns

    def sweep(
        self,
        base: Track,
        stamp_s: float,
        movers: Mapping[str, Track] | None = None,
        conditions: Conditions = CLEAR,
    ) -> Sweep:
        """A full turn whose last column fires at stamp_s. Movers without a track are absent."""
        return self.part(base, stamp_s, 0, self.columns, movers, conditions)

    def half_sweep(
        self,
        base: Track,
        stamp_s: float,
        half: int,
        movers: Mapping[str, Track] | None = None,
        conditions: Conditions = CLEAR,
        out: Points | None = None,
    ) -> Sweep:
        """Half 0 or 1 of a turn; its last column fires at stamp_s. out: as in ``part``."""
        return self.share(base, stamp_s, (half, 2), movers, conditions, out)

    def share(
        self,
        base: Track,
        stamp_s: float,
        which: tuple[int, int],
        movers: Mapping[str, Track] | None = None,
        conditions: Conditions = CLEAR,
        out: Points | None = None,
    ) -> Sweep:
        """Part ``which[0]`` of a turn in ``which[1]`` parts; its last column fires at stamp_s. out: as in ``part``."""
        number, parts = which
        first, last = self.columns * number // parts, self.columns * (number + 1) // parts
        return self.part(base, stamp_s, first, last, movers, conditions, out)

    def part(
        self,
        base: Track,
        stamp_s: float,
        first: int,
        last: int,
        movers: Mapping[str, Track] | None = None,
        conditions: Conditions = CLEAR,
        out: Points | None = None,
    ) -> Sweep:
        """Columns first to last - 1 of a turn; column last - 1 fires at stamp_s.

        out: the caller's memory for the points, room for every beam; allocation costs as much as the points.
        """
        times = np.arange(first - last + 1, 1, dtype=np.float64) * self.column_s
        met = self.ranges(base, stamp_s + times, first, last, movers or {})
        reflectivity, extinction_per_m = self._through_weather(conditions.weather, met)
        if conditions.sun is not None:
            self._into(conditions.sun, base, stamp_s + times, (first, last), met)
        count = met.ranges.size
        numbers = self._model.copy()
        numbers[model.EXTINCTION_PER_M] = extinction_per_m
        numbers[model.NOISE_M] *= conditions.noise_factor
        numbers[model.COVERED] = conditions.covered_share
        points, labels = np.empty(count, SWEEP) if out is None else out[:count], np.empty(count, np.uint8)
        skip = int(self._random.integers(0, len(self._normals) - 3 * count - 3))
        used = model.returns(
            self._azimuths[first:last],
            self._nominal,
            self._biases_m,
            times,
            met,
            self.scene.label,
            reflectivity,
            WET_HIT,
            numbers,
            self._normals[skip:],
            self._uniforms[skip:],
            points.view(np.float32).reshape(count, 6),
            points.view(np.uint32).reshape(count, 6),
            labels,
        )
        if self._turned is not None:  # as a driver does by the nominal mounting
            own = np.stack([points[axis][:used] for axis in "xyz"])
            for axis, values in zip("xyz", self._turned @ own, strict=True):
                points[axis][:used] = values
        return Sweep(stamp_s, points[:used], labels[:used])

    def _through_weather(self, weather: Weather | None, met: Met) -> tuple[F32, float]:
        """Adds airborne particles to the beams. Returns the surfaces' reflectivity, by number, and extinction, 1/m."""
        if weather is None:
            return self.scene.reflectivity, 0.0
        if weather not in self._air:
            self._air = {weather: self._in_air(weather)}  # of one weather at a time: values come from a service
        air, shine = self._air[weather]
        chosen, uniforms = draw(air, met.ranges.size, self._weather_random)
        meet(chosen, uniforms, air, shine, met)
        return shine, air.extinction_per_m

    def _into(self, sun: Sun, base: Track, times_s: F64, part: tuple[int, int], met: Met) -> None:
        """Adds the sun's effects to the beams of columns part[0] to part[1] - 1."""
        glare, ranging = self.params.glare, self.params.ranging
        _, rotations = poses_at(base, times_s, self.mounting)
        share = towards(sun, glare, self._azimuths[part[0] : part[1]], self._elevations, rotations)
        bright = _SURE_SIGNAL * 0.1 / ranging.range_at_ten_percent_m**2
        dazzle(share, sun, glare, bright, ranging.max_m, self._sun_random, met)

    def _in_air(self, weather: Weather) -> tuple[Particles, F32]:
        air = particles(weather, self.params)
        shine = self.scene.reflectivity * np.float32(air.surface_factor)
        shine[GROUND_HIT] = self.scene.reflectivity[GROUND_HIT] * np.float32(air.ground_factor)
        shine[AIRBORNE_HIT] = 1.0
        return air, shine

    def ranges(self, base: Track, times_s: F64, first: int, last: int, movers: Mapping[str, Track]) -> Met:
        """What the beams truly meet, valid until the next call."""
        origins, rotations = poses_at(base, times_s, self.mounting)
        block_times = times_s[np.minimum(np.arange(0, last - first, BLOCK) + BLOCK // 2, last - first - 1)]
        place = np.zeros((len(block_times), len(self.scene.movers), 3))
        place[:, :, 2] = _BELOW_EVERYTHING_M
        turned = np.tile(np.eye(3), (len(block_times), len(self.scene.movers), 1, 1))
        tracks = {BASE: base, **movers}
        for index, name in enumerate(self.scene.movers):
            if name in tracks:
                place[:, index], turned[:, index] = poses_at(tracks[name], block_times, _UNMOVED)
        shapes, count = self.scene.shapes, last - first
        met = Met(self._ranges[:count], self._hits[:count], self._cosines[:count])
        max_m = self.params.ranging.max_m
        beams = Beams(self._azimuths[first:last], self._elevations, origins, rotations, max_m)
        solids = Solids(shapes.kind, shapes.mover, shapes.centre_m, shapes.rotation, shapes.half_m, place, turned)
        still = self._still.setdefault((first, last), StillView())
        if not still.recall(origins, rotations, met):
            cast_ground(beams, self.scene.rects, met)
            cast_solids(beams, 0, self._fixed, solids, met)
            still.keep(origins, rotations, met)
        cast_solids(beams, self._fixed, len(shapes.kind), solids, met)
        share = self.params.wet.mirror_share
        if share > 0.0 and self._has_wet_ground:
            skip = int(self._random.integers(0, len(self._uniforms) - met.ranges.size))
            mirror(beams, share, self._uniforms[skip:], solids, met)
        if self.scene.glass:
            self._through_glass(beams, solids, met)
        return met

    def _through_glass(self, beams: Beams, solids: Solids, met: Met) -> None:
        hits, glass = met.hits, self.params.glass
        chosen = np.flatnonzero((hits >= FIRST_SOLID) & self._is_glass[np.maximum(hits, 0)])
        uniforms = self._glass_random.random((len(chosen), 3))
        numbers = glass.refractive_index, math.cos(math.radians(glass.glint_deg)), self.scene.reflectivity
        panes = self._is_glass[FIRST_SOLID:]
        look_through(chosen, uniforms, beams, panes, *numbers, solids, met)


def _bank_size(beams: int) -> int:
    """Numbers for one sweep and room to begin anywhere."""
    return max(4 * beams, _BANK)


def _mounting(sensor: RangeSensor, params: LidarParams, random: np.random.Generator) -> F64:
    """(4, 4) true pose of the sensor in base_link."""
    towards, axis = random.standard_normal(3), random.standard_normal(3)
    pose = np.eye(4)
    shift = params.mounting.position_m * random.random() * towards / np.linalg.norm(towards)
    pose[:3, 3] = np.array(sensor.xyz_m) + shift
    angle = params.mounting.rotation_rad * random.random()
    pose[:3, :3] = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix() @ sensor.rotation()
    return pose


def _model(params: LidarParams) -> F64:
    ranging = params.ranging
    numbers = np.zeros(model.MODEL_SIZE)
    numbers[model.MIN_M], numbers[model.MAX_M], numbers[model.NOISE_M] = ranging.min_m, ranging.max_m, ranging.noise_m
    numbers[model.TEN_PERCENT_M], numbers[model.LOST] = ranging.range_at_ten_percent_m, ranging.lost_share
    numbers[model.MIXED], numbers[model.MIXED_STEP_M] = ranging.mixed_share, ranging.mixed_step_m
    numbers[model.MIXED_REACH_M] = ranging.mixed_reach_m
    numbers[model.INTENSITY_NOISE], numbers[model.WET_LOST] = ranging.intensity_noise, params.wet.lost_share
    cover = params.cover
    numbers[model.COVER_RETURN], numbers[model.COVER_NEAREST_M] = cover.return_share, cover.nearest_m
    numbers[model.COVER_FARTHEST_M] = cover.farthest_m
    return numbers
