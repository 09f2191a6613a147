"""The robot's surroundings: the site's map, the newest costmap, people in it, and remembered obstacles."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from robot_stack.core.distance_field import clearance_field
from robot_stack.core.geometry import IDENTITY, Pose2, Twist2
from robot_stack.core.people import Person
from robot_stack.core.robot import Footprint
from robot_stack.core.site_map import OCCUPIED, Grid
from robot_stack.core.zones import Zone, ZoneType
from robot_stack.navigation.doors import Doors
from robot_stack.navigation.footprint import outline
from robot_stack.navigation.global_planner import goal_problem
from robot_stack.navigation.goal import GoalCode, Refusal
from robot_stack.navigation.lanes import Lanes
from robot_stack.navigation.local_map import LETHAL, LocalMap, costmap_problem, local_map
from robot_stack.navigation.one_way import FREE_COURSES, against_m, limit_rad, permitted
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.planning_grid import FAR_M, PlanningGrid
from robot_stack.navigation.pose_source import Located
from robot_stack.navigation.routes import RouteRequest

Array = npt.NDArray[np.float64]
# Lethal cells within this distance of a map obstacle belong to it.
_SAME_M = 0.30
# Those within this distance are not remembered.
_MAPPED_M = 0.15
# A step of the pose by more than _MAPPED_M, or by this, is a correction: an error of this angle moves what is seen in
# 5 m by _MAPPED_M.
_TURNED_RAD = 0.03
_MOST_REMEMBERED = 20_000
# For so long, people in a group are remembered.
_STOOD_S = 30.0
_NEAR_M, _CROWD_M = 3.5, 0.3
_DOT = np.zeros((1, 2))
# Points around a standing person.
_AROUND = 24
_ZONE_STEP_M = 0.1
# Until the deceleration has built up, and the drive follows.
_ZONE_LEAD_S = 0.4


class WorldModel:
    """grid: of the site map, None without one. zones, lanes: of the site; lifts: the lift of each of their doors. Poses
    are in map unless noted as odom.

    ``grid`` and ``local`` have keepout zones as obstacles. What the costmap sees in them is not explained by the map.
    local: in odom, of the newest costmap, with the map's obstacles that it does not see. Without costmaps, of the map
    alone; nothing is then given in odom, and ``map_to_odom`` remains the identity.
    """

    def __init__(
        self,
        params: NavigationParams,
        grid: Grid | None,
        zones: tuple[Zone, ...] = (),
        lanes: Lanes | None = None,
        lifts: Mapping[str, str] | None = None,
    ) -> None:
        self._params = params
        # Straight motions are shorter than this: longer ones follow the lanes.
        self.straight_m = math.inf if lanes is None else params.graph.from_m
        courses = FREE_COURSES if grid is None else permitted(zones, grid, params.one_way.tolerance_rad)
        self._mapped = self.grid = None if grid is None else PlanningGrid(grid, courses=courses)
        # The map's edge is no obstacle of it: people and things beside it are none of the map's.
        self._obstacles = None if grid is None else PlanningGrid(grid, bounded=False)
        self._limit_rad = limit_rad(params.one_way.tolerance_rad)
        # Way against the one-way zones at the robot, beyond the permitted courses, less the way along them.
        self.back_m = 0.0
        self.doors = Doors(zones, params.door, lifts)
        self._zones = zones if lanes is None else (*zones, *lanes.speed_zones())
        self._slow = [zone for zone in self._zones if zone.type is ZoneType.SPEED]
        outlines = [zone.rings[0] for zone in self._slow]
        self._slow_low = np.array([ring.min(axis=0) for ring in outlines]).reshape(-1, 2)
        self._slow_high = np.array([ring.max(axis=0) for ring in outlines]).reshape(-1, 2)
        closed = [zone for zone in zones if zone.type is ZoneType.KEEPOUT]
        self._closed: npt.NDArray[np.bool_] | None = None  # the map's cells in keepout zones
        if grid is not None and closed:
            self._closed = np.any([zone.touched(grid) for zone in closed], axis=0)
            with_closed = replace(grid, occupancy=np.where(self._closed, np.int8(OCCUPIED), grid.occupancy))
            self.grid = PlanningGrid(with_closed, courses=courses)
        self.local: LocalMap | None = None
        if grid is not None and self.grid is not None and not self.seeing:
            place, occupied = (grid.resolution_m, grid.origin_x_m, grid.origin_y_m), self.grid.known_field == 0.0
            self.local = LocalMap(0.0, *place, grid.occupancy, occupied, self.grid.known_field)
        self.costmaps = 0
        self.map_to_odom: Pose2 = IDENTITY
        self._received_s = -math.inf
        self._people: tuple[Person, ...] = ()
        self._people_stamp_s = self._people_received_s = -math.inf
        self._walked_s = -math.inf  # when a walking person was in the list
        self._here = 0.0, 0.0
        self._remembered = np.empty((0, 2))
        self._remembered_s = np.empty(0)
        self._at_map = np.empty((0, 2))  # seen at present, at obstacles of the map

    @property
    def seeing(self) -> bool:
        """The costmap is used."""
        return self._params.use_costmap

    @property
    def free_space(self) -> bool:
        """True without map and costmap: every way is clear."""
        return self.grid is None and not self.seeing

    @property
    def people(self) -> tuple[Person, ...]:
        """In odom, without those in groups."""
        return tuple(one for one in self._people if not one.in_group)

    @property
    def everybody(self) -> tuple[Person, ...]:
        """In odom."""
        return self._people

    def in_the_way(self, now_s: float) -> tuple[Person, ...]:
        """``everybody``, and in a crowd also what the map does not have within ``_NEAR_M`` of the robot, in odom.

        People who came behind others have not been seen apart from them. Only for making room: a thing that is taken
        for a person costs time.
        """
        if self.local is None or self._mapped is None or now_s - self._walked_s > _STOOD_S:
            return self._people
        cells = np.unique(np.floor(self.local.points() / _CROWD_M), axis=0)
        at = (cells + 0.5) * _CROWD_M
        at = at[(np.hypot(*(at - self._here).T) <= _NEAR_M) & ~self._near_map(self._to_map(at))]
        crowd = (Person(now_s, x, y, radius_m=0.5 * _CROWD_M, walked=True) for x, y in at.tolist())
        return (*self._people, *crowd)

    def problem(self, steady_s: float) -> str:
        """Why costmap or people forbid motion (missing or stale), else an empty text."""
        if not self.seeing:
            return ""
        limit_s = self._params.follow.costmap_timeout_s
        inputs = {"/local_costmap/costmap": self._received_s, "/perception/people": self._people_received_s}
        for name, received_s in inputs.items():
            if not math.isfinite(received_s):
                return f"{name} never received"
            if not 0.0 <= steady_s - received_s <= limit_s:
                return f"{name} silent for more than {limit_s} s"
        return ""

    def on_people(self, stamp_s: float, people: tuple[Person, ...], received_s: float) -> None:
        """Takes the people around the robot at the stamp, odom. A repeated list does not reset the age.

        Those at obstacles of the map are left out: a part of these, seen through a gap, has a person's size, and seems
        to move with the robot.
        """
        if stamp_s == self._people_stamp_s:
            return
        self._people_stamp_s, self._people_received_s = stamp_s, received_s
        at = np.array([(one.x, one.y) for one in people]).reshape(-1, 2)
        mapped = np.zeros(len(people), np.bool_) if self._mapped is None else self._near_map(self._to_map(at))
        if any(one.walks for one in people):
            self._walked_s = stamp_s
        stood = self._stood(stamp_s, people)
        self._people = (*(one for one, near in zip(people, mapped, strict=True) if not near), *stood)

    def _stood(self, stamp_s: float, people: tuple[Person, ...]) -> Iterator[Person]:
        """People who stood where the costmap still shows something, and who are not in the newest list: in a group
        that others have joined, perception does not separate them.
        """
        found = {one.number for one in people}
        for one in self._people:
            if one.number in found or not one.walked or one.walks or not 0.0 <= stamp_s - one.stamp_s <= _STOOD_S:
                continue
            if self.local is None or self.local.clearance_m(_DOT, np.array([(one.x, one.y, 0.0)]))[0] > one.radius_m:
                continue
            if all(math.hypot(one.x - other.x, one.y - other.y) > other.radius_m for other in people):
                yield replace(one, apart_s=-math.inf)

    def on_costmap(
        self, stamp_s: float, resolution_m: float, origin: Pose2, cells: npt.NDArray[np.int8], received_s: float
    ) -> str:
        """Takes a costmap, (rows, columns), origin in odom. Returns why it was refused, else an empty text."""
        problem = costmap_problem(resolution_m, origin, cells.shape, cells.size)
        if problem or not math.isfinite(stamp_s):
            return problem or "/local_costmap/costmap stamp is not finite"
        if self.local is not None and stamp_s == self.local.stamp_s:
            return ""  # a duplicate, which does not reset the age
        lethal = cells >= LETHAL
        walking = self._walking(stamp_s, lethal, resolution_m, origin)
        closed = self._closed_cells(lethal & ~walking, resolution_m, origin)
        self.local = local_map(stamp_s, resolution_m, origin, cells, walking, closed)
        self._received_s = received_s
        self.costmaps += 1
        self._remember(stamp_s)
        return ""

    def locate(self, located: Located) -> None:
        """Takes the pose of the odom frame.

        A correction ends the memory of obstacles: those seen under a wrong pose are elsewhere, and may be the map's.
        """
        if not self.seeing:
            return
        odom = located.pose.relative_to(located.map_to_odom)
        self._here = odom.x, odom.y
        uncorrected = self.map_to_odom.compose(located.pose.relative_to(located.map_to_odom))
        step = located.pose.relative_to(uncorrected)
        if math.hypot(step.x, step.y) > _MAPPED_M or abs(step.yaw) > _TURNED_RAD:
            self._remembered, self._remembered_s = self._remembered[:0], self._remembered_s[:0]
        self.map_to_odom = located.map_to_odom

    # --- clearances --------------------------------------------------------------------------------------------------

    def to_odom(self, poses: Array) -> Array:
        """(n, 3) poses in map, expressed in odom."""
        o = self.map_to_odom.inverse()
        c, s = math.cos(o.yaw), math.sin(o.yaw)
        x, y = o.x + c * poses[:, 0] - s * poses[:, 1], o.y + s * poses[:, 0] + c * poses[:, 1]
        return np.column_stack((x, y, poses[:, 2] + o.yaw))

    def clearance_m(self, footprint: Footprint, poses: Array) -> Array:
        """(n,) clearance at (n, 3) poses by map and costmap together; walking people do not count."""
        edge = outline(footprint)
        clear = np.full(len(poses), FAR_M)
        if self.grid is not None:
            clear = np.minimum(clear, self.grid.clearance_m(edge, poses, known=True))
        if self.seeing and self.local is not None:
            clear = np.minimum(clear, self.local.clearance_m(edge, self.to_odom(poses)))
        return clear

    def person_m(self, poses: Array, now_s: float, walking_m: float) -> float:
        """Least distance of a person to (n, 3) poses; walking people count as ``walking_m`` nearer."""
        at = self.to_odom(poses)
        least = math.inf
        for person in self.people:
            x, y = person.at(now_s)
            distance_m = float(np.hypot(at[:, 0] - x, at[:, 1] - y).min())
            least = min(least, distance_m - (walking_m if person.walks else 0.0))
        return least

    def zone_speed_mps(self, poses: Array) -> Array:
        """(n,) speed that the zones allow at (n, 3) poses in map; infinite without a limit."""
        speeds = np.full(len(poses), np.inf)
        low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
        # A site may have a zone for each of a thousand lanes: only those near the poses are examined.
        near = np.all((self._slow_low <= high) & (self._slow_high >= low), axis=1)
        for index in np.flatnonzero(near):
            zone = self._slow[index]
            inside = zone.contains(poses[:, 0], poses[:, 1])
            speeds = np.where(inside, np.minimum(speeds, zone.speed_mps), speeds)
        return speeds

    def against_m(self, poses: Array) -> float:
        """Length of the motion along (n, 3) poses in map that is against one-way zones, m."""
        return against_m(self._zones, poses[:, :2], self._limit_rad)

    def count_back(self, pose: Pose2, twist: Twist2, dt_s: float) -> None:
        """Adds the motion of a tick to ``back_m``; outside the zones it is zero. pose: in map. twist: base_link.

        A course between across and the largest permitted one counts as along, in proportion: a robot that follows a
        route at the limit, with small deviations to both sides, does not use up its way back.
        """
        along = self._along_mps(pose, twist)
        if along is None:
            self.back_m = 0.0
            return
        if along < 0.0:
            permitted_share = -math.cos(self._limit_rad)
            along = (along + permitted_share * twist.speed()) / (1.0 - permitted_share)
        self.back_m = max(0.0, self.back_m - along * dt_s)

    def back_left_m(self, pose: Pose2, twist: Twist2) -> float:
        """How far the robot may still go with a motion against one-way zones, m; infinite for a permitted motion."""
        along = self._along_mps(pose, twist)
        if along is None or along >= twist.speed() * math.cos(self._limit_rad):
            return math.inf
        return max(0.0, self._params.one_way.back_m - self.back_m)

    def _along_mps(self, pose: Pose2, twist: Twist2) -> float | None:
        """Speed along the one-way zones at the robot, negative against them, the least of several; None outside.

        pose: in map. twist: base_link.
        """
        at_x, at_y = np.array([pose.x]), np.array([pose.y])
        speed_mps, course = twist.speed(), pose.yaw + math.atan2(twist.vy, twist.vx)
        speeds = [
            speed_mps * math.cos(course - zone.heading_rad)
            for zone in self._zones
            if zone.type is ZoneType.ONE_WAY and zone.contains(at_x, at_y)[0]
        ]
        return min(speeds, default=None)

    def zone_limit_mps(self, located: Located, twist: Twist2, deceleration_mps2: float) -> float:
        """Speed that the zones at the robot allow, and those ahead in its motion, to be entered at their own speed.

        twist: commanded, base_link. A robot beside its route may be in a zone that the route does not cross.
        """
        speed_mps = twist.speed()
        if not self._zones:
            return math.inf
        lead_m = _ZONE_LEAD_S * speed_mps
        end_m = lead_m + 0.5 * speed_mps**2 / deceleration_mps2 + 2.0 * _ZONE_STEP_M
        along_m = np.arange(0.0, end_m, _ZONE_STEP_M)
        course = located.pose.yaw + math.atan2(twist.vy, twist.vx)
        x, y = located.pose.x + along_m * math.cos(course), located.pose.y + along_m * math.sin(course)
        limits = self.zone_speed_mps(np.column_stack((x, y, np.zeros(len(x)))))
        braking_m = np.maximum(along_m - lead_m, 0.0)
        return float(np.sqrt(limits**2 + 2.0 * deceleration_mps2 * braking_m).min())

    # --- planning ----------------------------------------------------------------------------------------------------

    def goal_problem(self, footprint: Footprint, goal: Pose2) -> Refusal | None:
        if self._mapped is None or self.grid is None:
            return None
        params = self._params.planner
        by_map = goal_problem(self._mapped, footprint, goal, params)
        if by_map is not None or goal_problem(self.grid, footprint, goal, params) is None:
            return by_map
        text = f"goal ({goal.x:.2f}, {goal.y:.2f}) lies in a keepout zone, or too near to one"
        return Refusal(GoalCode.GOAL_OCCUPIED, text)

    def question(self, start: Pose2, goal: Pose2, footprint: Footprint) -> RouteRequest:
        """A request for a route around all obstacles of map and costmap until now, and around standing people."""
        seen = np.concatenate((self.doors.hide(self._remembered), self._standing()))
        return RouteRequest(start, goal, footprint, seen, self.doors.hide(self._at_map))

    def _standing(self) -> Array:
        """(n, 2) points around people who stand, map: a route past them must leave the gap the robot keeps."""
        p = self._params
        angles = np.arange(_AROUND) * (2.0 * math.pi / _AROUND)
        rings = [
            np.column_stack((one.x + reach_m * np.cos(angles), one.y + reach_m * np.sin(angles)))
            for one in self.people
            if one.walked and not one.walks
            for reach_m in (one.radius_m + p.people.standing_gap_m - p.planner.margin_m,)
        ]
        return self._to_map(np.concatenate(rings)) if rings else np.empty((0, 2))

    def shown(self) -> bytes:
        """A digest of the obstacles of a request: while it is unchanged, so is the result."""
        size_m = self._params.planner.search_resolution_m
        column, row = np.floor(self._remembered / size_m).astype(np.int64).T
        cells = np.unique((row << 32) + column)  # one number per cell: sorting pairs would take most of a tick
        return hashlib.blake2b(cells.tobytes(), digest_size=16).digest()

    # --- memory ------------------------------------------------------------------------------------------------------

    def _walking(
        self, stamp_s: float, lethal: npt.NDArray[np.bool_], resolution_m: float, origin: Pose2
    ) -> npt.NDArray[np.bool_]:
        """Mask of the lethal cells of walking people, whose predicted positions are avoided instead."""
        walking = np.zeros_like(lethal)
        for one in self.people:
            if not one.walks or one.box is None or one.stamp_s < self._people_stamp_s:
                continue
            (x, y), (x0, y0, x1, y1) = one.at(stamp_s), one.box
            at = np.array((x - one.x - origin.x, y - one.y - origin.y))
            c0, r0 = np.floor((np.array((x0, y0)) + at) / resolution_m + 0.5).astype(int) - 1
            c1, r1 = np.floor((np.array((x1, y1)) + at) / resolution_m + 0.5).astype(int) + 1
            walking[max(r0, 0) : max(r1, 0), max(c0, 0) : max(c1, 0)] = True
        return walking & lethal

    def _closed_cells(
        self, seen: npt.NDArray[np.bool_], resolution_m: float, origin: Pose2
    ) -> npt.NDArray[np.bool_] | None:
        """Mask of a costmap's cells in keepout zones, and in obstacles of the map that it does not see; None without a
        map.

        seen: its static lethal cells. Obstacles of the map near these are left out: an error of the pose would double
        the walls, and narrow a gate.
        """
        if self._mapped is None:
            return None
        columns_rows = np.indices(seen.shape)[::-1].reshape(2, -1).T
        points = self._to_map(np.array((origin.x, origin.y)) + (columns_rows + 0.5) * resolution_m)
        occupied = self._mapped.values(self._mapped.known_field, points, FAR_M) == 0.0
        closed: npt.NDArray[np.bool_] = occupied.reshape(seen.shape)
        if closed.any():
            closed &= clearance_field(seen, resolution_m, 2.0 * _SAME_M) > _SAME_M
        closed |= self._in_closed(points).reshape(seen.shape)
        return closed

    def _in_closed(self, points: Array) -> npt.NDArray[np.bool_]:
        """(n,) True for points (n, 2), map, in a keepout zone."""
        if self._mapped is None or self._closed is None:
            return np.zeros(len(points), np.bool_)
        return self._mapped.values(self._closed, points, False)

    def _near_map(self, points: Array) -> npt.NDArray[np.bool_]:
        """(n,) True for points (n, 2), map, at an obstacle of the map."""
        return self._map_clearance_m(points) < _SAME_M

    def _map_clearance_m(self, points: Array) -> Array:
        """(n,) distance of points (n, 2), map, from the map's obstacles."""
        assert self._obstacles is not None
        return self._obstacles.clearance_m(_DOT, np.column_stack((points, np.zeros(len(points)))), known=True)

    def _to_map(self, points: Array) -> Array:
        o = self.map_to_odom
        c, s = math.cos(o.yaw), math.sin(o.yaw)
        return np.column_stack((o.x + c * points[:, 0] - s * points[:, 1], o.y + s * points[:, 0] + c * points[:, 1]))

    def _remember(self, stamp_s: float) -> None:
        """Within its extent, the costmap replaces the remembered obstacles."""
        assert self.local is not None
        if len(self._remembered):
            at = self.to_odom(np.column_stack((self._remembered, np.zeros(len(self._remembered)))))
            age_s = stamp_s - self._remembered_s
            keep = ~self.local.covers(at[:, 0], at[:, 1]) & (age_s >= 0.0) & (age_s <= self._params.planner.memory_s)
            self._remembered, self._remembered_s = self._remembered[keep], self._remembered_s[keep]
        seen = self._to_map(self.local.points())
        seen = seen[~self._in_closed(seen)]  # not seen, and the route's grid has them
        if self._mapped is not None and len(seen):
            apart = self._map_clearance_m(seen) > _MAPPED_M
            seen, self._at_map = seen[apart], seen[~apart]
        self._remembered = np.concatenate((self._remembered, seen))[-_MOST_REMEMBERED:]
        self._remembered_s = np.concatenate((self._remembered_s, np.full(len(seen), stamp_s)))[-_MOST_REMEMBERED:]
