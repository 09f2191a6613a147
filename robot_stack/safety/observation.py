"""Collects the inputs of the safety monitor message by message, and returns them as one snapshot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from robot_stack.contract import processes, topics
from robot_stack.contract.model import Criticality
from robot_stack.contract.states import ALIGNING, SERVOED
from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.core.limits import SafetyLimit, SpeedLimit
from robot_stack.core.robot import Footprint, Robot
from robot_stack.safety.attitude import PlanarAcceleration, UpDirection
from robot_stack.safety.button import Contact, EmergencyButton
from robot_stack.safety.chair_watch import ChairWatch
from robot_stack.safety.collision import outline_of
from robot_stack.safety.collision_prediction import CollisionPrediction, look_ahead, onto_no_ground, rests
from robot_stack.safety.commands import CommandWatch
from robot_stack.safety.computer_watch import ComputerWatch, LinkWatch
from robot_stack.safety.conditions import stale_s
from robot_stack.safety.dead_reckoning import DeadReckoning, Modules
from robot_stack.safety.drive_watch import DriveWatch
from robot_stack.safety.edge_watch import EdgeWatch
from robot_stack.safety.inputs import DriveReading, ImuSample, ProcessAge, Snapshot
from robot_stack.safety.lidar_watch import LidarWatch
from robot_stack.safety.overspeed import OverspeedWatch
from robot_stack.safety.params import SafetyParams
from robot_stack.safety.pedestrian_collision import PedestrianCollisionWatch
from robot_stack.safety.slope import SlopeWatch
from robot_stack.safety.steering_watch import SteeringWatch
from robot_stack.safety.stop_sources import Press, SourcePresence, SourceReport, StopSources
from robot_stack.safety.surroundings import Surroundings
from robot_stack.safety.timing import age_s
from robot_stack.safety.watches import CameraWatch, EstopWatch, ImuWatch, Latest, PoseWatch, WheelWatch

CAMERAS = (topics.FRONT_CAMERA_INFO, topics.REAR_CAMERA_INFO)
# The processes that maintain the links to displays and screens.
_EHMI, _UI = "ehmi_bridge", "touch_ui"
# The source of the emergency stop that must always be present.
_BUTTON = "emergency_stop_button"


class Observation:
    """The inputs and their history. All times are steady seconds at reception.

    chair: the wheelchair and the latch. edge: the safety edge.
    latch_problem: why the monitor's memory is not on disk, empty if it is.
    """

    def __init__(
        self,
        params: SafetyParams,
        robot: Robot,
        now_s: float,
        passenger: bool,
        presses: tuple[Press, ...],
    ) -> None:
        self._started_s = now_s
        undocking = SpeedLimit(params.undocking.max_speed_mps, params.undocking.max_yaw_rate_radps)
        self._docking_limit = SpeedLimit(params.docking.max_speed_mps, params.docking.max_yaw_rate_radps)
        self.chair = ChairWatch(passenger, undocking, stale_s(topics.LATCH_STATUS))
        self.edge = EdgeWatch(robot.safety_edge is not None, params.button_debounce_s)
        self._settle_s = params.startup_settle_s
        self._criticality = {name: processes.BY_NAME[name].criticality for name in params.expected_processes}
        self._heartbeat_s: dict[str, float] = {}
        motion = PlanarAcceleration(params.kinematic_filter_s, params.kinematic_max_mps2)
        up = UpDirection(params.attitude_time_constant_s, params.attitude_settle_s, params.attitude_max_gap_s)
        self.estop = EstopWatch()
        self.sources = StopSources(
            params.stop_sources.explain_s,
            params.stop_sources.discovery_s,
            stale_s(topics.EMERGENCY_STOP_SOURCES),
            presses,
        )
        self._button_there = SourcePresence(params.stop_sources.button_silence_s, params.startup_settle_s)
        self._watches_button = _BUTTON in params.expected_processes
        own = SpeedLimit(robot.empty.max_speed_mps, robot.empty.max_yaw_rate_radps)
        self._overspeed = OverspeedWatch(params.overspeed, own, robot.emergency_deceleration_mps2)
        dead_reckoning = DeadReckoning(params.obstacles.max_latency_s)
        modules = Modules(robot.module_positions_m(), robot.wheel_radius_m)
        self.wheels = WheelWatch(modules, params.standstill_mps, motion, dead_reckoning)
        self.steering = SteeringWatch(params.steering, modules, params.standstill_mps, stale_s(topics.WHEEL_COMMANDS))
        self.drive = DriveWatch(
            silence_s=params.drive_silence_s,
            servo_off_s=params.drive_servo_off_s,
            servo_on_timeout_s=params.drive_servo_on_timeout_s,
            startup_grace_s=params.startup_grace_s,
            startup_settle_s=params.startup_settle_s,
            now_s=now_s,
        )
        self._imu = ImuWatch(up, motion, params.imu_min_mps2, params.imu_max_mps2, params.imu_max_radps)
        self._slope = SlopeWatch(params, robot.module_positions_m())
        self._pose = PoseWatch()
        self._quality, self._battery = Latest(0.0, 1.0), Latest(0.0, 1.0)
        self._cameras = CameraWatch([topic.name for topic in CAMERAS])
        self.lidar, self.overhead_lidar = LidarWatch(params.lidar), LidarWatch(params.overhead_lidar)
        self.button = EmergencyButton(params.button_debounce_s, params.startup_settle_s)
        self.computer = ComputerWatch(
            params.computer.cpu_high_percent, stale_s(topics.ROBOT_STATUS), stale_s(topics.COMPUTER_TEMPERATURE)
        )
        self.ehmi = LinkWatch(_EHMI in params.expected_processes)
        self.ui = LinkWatch(_UI in params.expected_processes, params.links.ui_required)
        self.commands = CommandWatch(stale_s(topics.CMD_VEL_LIMITED))
        self.surroundings = Surroundings(params.obstacles, dead_reckoning)
        self._last_way_s: float | None = None
        self.latch_problem = ""
        self._collision, self._robot = params.collision, robot
        self._pedestrian_collision = PedestrianCollisionWatch(
            params.pedestrian_collision, robot.emergency_deceleration_mps2
        )

    def emergency_stop(self, pressed: bool, now_s: float) -> None:
        self.estop.received(pressed, now_s)
        self.sources.message(pressed, now_s)

    def stop_source(self, report: SourceReport, now_s: float) -> None:
        """A message of ``/emergency_stop/sources``."""
        self.sources.report(report, now_s)

    def limited(self, limit: SafetyLimit, now_s: float) -> None:
        """The published speed limit."""
        self._overspeed.limited(limit, limit.is_hard_stop(), self._robot.motion(self.chair.carried), now_s)

    def heartbeat(self, process: str, now_s: float) -> None:
        self._heartbeat_s[process] = now_s
        link = {_EHMI: self.ehmi, _UI: self.ui}.get(process)
        if link is not None:
            link.process_heard(now_s)

    def engine(self, reading: DriveReading | None, now_s: float) -> None:
        """The motion engine's status; None if it cannot be read."""
        self.drive.received(reading, now_s)
        self.button.update(Contact.UNREADABLE if reading is None else reading.button, now_s)
        self.chair.contacts(None if reading is None else reading.latch)
        self.edge.received(None if reading is None else reading.edge, now_s)

    def joint_states(
        self, names: Sequence[str], position_rad: Sequence[float], velocity_radps: Sequence[float], now_s: float
    ) -> None:
        self.wheels.received(names, position_rad, velocity_radps, now_s)
        self.steering.measured(self.wheels.speeds_mps, self.wheels.angles_rad)

    def imu(self, sample: ImuSample, now_s: float) -> None:
        self._imu.received(sample, now_s)

    def pose(self, x_m: float, y_m: float, now_s: float) -> None:
        self._pose.received(x_m, y_m, now_s)

    def quality(self, quality: float, now_s: float) -> None:
        self._quality.received(quality, now_s)

    def battery(self, charge: float, now_s: float) -> None:
        """State of charge, [0, 1]."""
        self._battery.received(charge, now_s)

    def docking(self, state: str, now_s: float) -> None:
        """State of ``/docking/status``."""
        self._cameras.docking(state in ALIGNING, now_s)
        # The robot moves into the dock, whose own parts are then no obstacles.
        self._last_way_s = now_s if state in SERVOED else None

    def camera(self, topic: str, now_s: float) -> None:
        """A ``camera_info`` of ``CAMERAS``: it accompanies each image."""
        self._cameras.received(topic, now_s)

    def obstacles(self, points: NDArray[Any], latency_s: float, now_s: float) -> None:
        """Obstacle points, (n, 3) m in base_link ``latency_s`` ago."""
        self.surroundings.received(points, latency_s, outline_of(self._body()), now_s)

    def snapshot(self, emergency: bool, now_s: float) -> Snapshot:
        """All inputs now. Events (a short press, a jump) appear in one snapshot only.

        Args:
            emergency: an emergency stop is latched.
        """
        complete = self._complete()
        estop = self._stop_asked(complete, now_s)
        inclination_rad = self._imu.inclination_rad(now_s, stale_s(topics.IMU))
        stands = self.wheels.still_for_s(now_s, stale_s(topics.JOINT_STATES)) is not None
        source = self.commands.leading(now_s)
        return Snapshot(
            uptime_s=age_s(now_s, self._started_s),
            estop=estop,
            contact=self.edge.judge(),
            chair_loose=self.chair.loose(stands),
            latch_not_closed=self.chair.not_held(source, now_s),
            undocking=self.chair.undocking(source, now_s),
            docking=self._docking_limit if self._docks(now_s) else None,
            steering=self.steering.judge(now_s),
            drive=self.drive.judge(emergency or bool(estop), complete, now_s),
            overspeed=self._overspeed.judge(self.wheels.twist(now_s, stale_s(topics.JOINT_STATES)), now_s),
            joint_states_up=self.wheels.up(complete, now_s, stale_s(topics.JOINT_STATES), self._settle_s),
            joint_states_age_s=self.wheels.take_silence_s(now_s),
            joint_states_problem=self.wheels.problem,
            imu_age_s=self._imu.age_s(now_s),
            imu_problem=self._imu.problem,
            inclination_rad=inclination_rad,
            slope=self._slope.judge(inclination_rad, self._imu.downhill_rad, self._motions(now_s), now_s),
            pose_age_s=self._pose.age_s(now_s),
            pose_jump_m=self._pose.take_jump_m(),
            quality_age_s=self._quality.age_s(now_s),
            quality=self._quality.value,
            battery_age_s=self._battery.age_s(now_s),
            battery=self._battery.value,
            latch_problem=self.latch_problem,
            processes={
                name: ProcessAge(criticality, age_s(now_s, self._heartbeat_s.get(name)))
                for name, criticality in self._criticality.items()
            },
            cameras=self._cameras.ages_s(now_s, stale_s(topics.DOCKING_STATUS)),
            lidar_age_s=self.lidar.age_s(now_s),
            lidar_problem=self.lidar.problem,
            overhead_lidar_age_s=self.overhead_lidar.age_s(now_s),
            overhead_lidar_problem=self.overhead_lidar.problem,
            obstacles_age_s=self.surroundings.age_s(now_s),
            obstacles_problem=self.surroundings.problem,
            sight_age_s=self.surroundings.sight_age_s(now_s),
            prediction=self._prediction(now_s),
            computer=self.computer.state(now_s),
            ehmi_silent_s=self.ehmi.silent_s(now_s),
            ui_silent_s=self.ui.silent_s(now_s),
        )

    def _stop_asked(self, complete: bool, now_s: float) -> str:
        """Sources that request the emergency stop, empty without any."""
        asked = self.sources.standing(now_s)
        if self.estop.take_pressed() and not asked:
            asked = "/emergency_stop is true"
        silent_s = self.sources.age_s(_BUTTON, now_s)
        if self._watches_button and self._button_there.missing(silent_s, complete, now_s):
            asked = "; ".join(filter(None, (asked, f"no message from {_BUTTON} for {silent_s:.2f} s")))
        return asked

    def _motions(self, now_s: float) -> list[Twist2]:
        """The requested motion and the drive's own command, without standstills."""
        motions = (self.commands.requested(now_s), self.commands.driven(now_s) or ZERO_TWIST)
        return [motion for motion in motions if not rests(motion, self._collision)]

    def _prediction(self, now_s: float) -> CollisionPrediction | None:
        """None while the obstacles are unknown. After losing sight of them, their last positions, moved by dead
        reckoning, count until the robot stands.
        """
        sighted = self.surroundings.age_s(now_s) <= stale_s(topics.OBSTACLES)
        stands = self.wheels.still_for_s(now_s, stale_s(topics.JOINT_STATES)) is not None
        if not self.surroundings.known or (stands and not sighted):
            return None
        # A wheelchair stays in place during undocking: it does not move with the robot.
        undocking = self.chair.undocking(self.commands.leading(now_s), now_s) is not None
        footprint = self._body() if undocking else self._footprint()
        moving = self.surroundings.moving(stale_s(topics.MOVING), now_s)
        measured = self.wheels.twist(now_s, stale_s(topics.JOINT_STATES))
        driven, requested = self.commands.driven(now_s), self.commands.requested(now_s)
        unseen = self.surroundings.unseen(stale_s(topics.UNSEEN_SPACE), now_s)
        points = self.surroundings.points(self._docks(now_s), stale_s(topics.DOCKING_TARGET), now_s)

        def ahead(shape: Footprint) -> CollisionPrediction:
            return look_ahead(
                points,
                None if moving is None else unseen,  # unknown moving bodies: the limit of unseen space
                outline_of(shape),
                outline_of(shape, self._collision.margin_m),
                measured,
                driven,
                requested,
                self._collision,
                self._robot.emergency_deceleration_mps2,
                self._robot.motion(self.chair.carried),
            )

        seen = ahead(footprint)
        if footprint is not self._body():
            seen = seen.worse(ahead(self._body()))  # within the outline of a wheelchair that may be absent
        if self.chair.carried:
            ends = self.surroundings.no_ground(stale_s(topics.NO_GROUND), now_s)
            leading = [measured, driven or ZERO_TWIST, requested]
            seen = replace(seen, no_ground=onto_no_ground(ends, outline_of(footprint), leading, self._collision))
        if moving is None:
            return seen
        motions = [measured, requested if driven is None else driven]
        pedestrian_collision = self._pedestrian_collision.judge(
            moving, seen.nearest_m, outline_of(footprint), motions, requested, now_s
        )
        return replace(seen, pedestrian_collision=pedestrian_collision)

    def _docks(self, now_s: float) -> bool:
        """The docking controller moves the robot into a dock, and no other source commands it."""
        fresh = age_s(now_s, self._last_way_s) <= stale_s(topics.DOCKING_STATUS)
        return fresh and self.commands.leading(now_s) in (None, topics.DOCKING_CMD_VEL.name)

    def _body(self) -> Footprint:
        """The robot's own footprint; it includes a wheelchair only on a latch that is confirmed closed."""
        return self._robot.footprint_with_chair if self.chair.closed else self._robot.footprint

    def _footprint(self) -> Footprint:
        return self._robot.footprint_with_chair if self.chair.carried else self._robot.footprint

    def _complete(self) -> bool:
        """Every critical process has sent a heartbeat. Until then the machine is under start-up load."""
        critical = (name for name, criticality in self._criticality.items() if criticality is Criticality.CRITICAL)
        return all(name in self._heartbeat_s for name in critical)
