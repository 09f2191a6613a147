"""The kernel stack with camera, marker detector, docking controller and latch: a docking without ROS.

What takes time takes it here too: an image is known when it has been read out, transferred and searched, and commands
pass the same transport as everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_stack.contract import frames, topics
from robot_stack.contract.frames import DRIVE_AXES, STEER_AXES
from robot_stack.core.camera import Intrinsics, camera_file, load_intrinsics, mounting
from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.docks import Dock, load_docks
from robot_stack.core.geometry import ZERO_TWIST, Pose2, exp_se2, quaternion_from_yaw
from robot_stack.core.robot import load_robot
from robot_stack.docking.contact import push_n
from robot_stack.docking.controller import DockingController
from robot_stack.docking.latch import LatchCommand, LatchInputs
from robot_stack.docking.learning import Correction, learnt
from robot_stack.docking.params import DockingParams
from robot_stack.docking.results import Result
from robot_stack.docking.sighting import Marker, sighting
from robot_stack.docking.situation import Output, Safety, Situation
from robot_stack.docking.states import State
from robot_stack.docking.vision.detector import MarkerDetector
from robot_stack.docking.vision.params import ArucoDetectorParams
from robot_stack.drive.arbitration import Source
from robot_stack.drive.odometry import Odometry
from robot_stack.navigation.goal import GoalRequest
from sim.bench.kernel_stack import KernelStack
from sim.camera.conditions import CLEAR, Conditions
from sim.camera.history import BodyHistory
from sim.camera.model import draw_camera
from sim.camera.motion import Motion
from sim.camera.params import load_camera_params
from sim.camera.render import Renderer
from sim.camera.scenery import build_scenery
from sim.plant.terrain import solids
from sim.plant.wheelchair import matrix_of
from sim.plant.world import Setup, on_ground

Array = NDArray[np.float64]
_BODY_RATE_HZ = 100.0
_EXPOSED_S = 0.02  # until the last row is read out, with room for the poses around it
_SEARCHED_S = 0.035  # transfer of the image, search, transfer of the detections
_IMAGE_TIMEOUT_S = 0.5
_FIRST_TICKS_S = 1.0  # the latch's inputs are known by then
_CHAIR = "wheelchair"
_CAMERAS = (frames.FRONT_CAMERA, frames.REAR_CAMERA)
_SEARCHING = (State.APPROACH, State.SEARCH, State.SERVOING, State.FINE_ALIGN, State.DOCKED)
Light = Callable[[float], Conditions]


@dataclass(frozen=True, slots=True)
class DockingSample:
    """One tick of the docking controller, and what was true.

    error: base_link beside the dock pose, along m, across m, yaw rad. contact_n: force between robot and wheelchair.
    """

    time_s: float
    output: Output
    error: tuple[float, float, float]
    contact_n: float


class DockingStack(KernelStack):
    """``dock_id`` is docked to by ``run_docking``.

    light: the conditions of the pictures by time. located_by: makes of a pose what the localization shall tell instead.
    """

    def __init__(
        self,
        setup: Setup,
        dock_id: str,
        light: Light = lambda _: CLEAR,
        corrections: Mapping[str, Correction] | None = None,
        located_by: Callable[[Pose2], Pose2] = lambda pose: pose,
    ) -> None:
        super().__init__(setup)
        docks = load_docks()
        self.dock_id, self.dock = dock_id, docks.docks[dock_id]
        self._light, self._located_by = light, located_by
        self._eye = Eye(self.dock, setup)
        self.params = load(DockingParams, "docking_controller")
        self.controller = DockingController(
            self.params,
            {self._eye.frame: self._eye.nominal},
            Departure(load(DepartureParams, "departure"), announced=True),
            corrections,
        )
        self._bodies = BodyHistory()
        self._latest_image_s = -math.inf
        self._owned = False
        self._force_n = math.nan
        self.docking: list[DockingSample] = []
        self.contact_max_n = 0.0  # before the latch closed
        self.result: Result | None = None
        self.safety = Safety(known=True)
        self.camera_dead = False
        self.passenger: bool | None = None
        self.every(_BODY_RATE_HZ, self._bodies_tick)
        self.every(topics.FRONT_IMAGE.nominal_rate_hz, self._expose)
        self.every(topics.JOINT_STATES.nominal_rate_hz, self._measure_force)
        self.every(topics.DOCKING_CMD_VEL.nominal_rate_hz, self._docking_tick)

    def teach(self) -> None:
        """Gives the controller what an earlier docking to the closed latch leaves."""
        self.controller.corrections = self._eye.taught(self.dock_id, self.params)

    # --- jobs --------------------------------------------------------------------------------------------------------

    def run_docking(self, limit_s: float) -> Result | None:
        """Docks; None if it takes longer."""
        self.run(lambda: self.passenger is not None and bool(self.docking), _FIRST_TICKS_S)
        self.result = self.controller.dock(self.dock_id, self.dock)
        self.run(lambda: self.result is not None, limit_s)
        return self.result

    # --- camera ------------------------------------------------------------------------------------------------------

    def _bodies_tick(self) -> None:
        if not self.sim.world.attached:
            self.contact_max_n = max(self.contact_max_n, self.sim.world.contact_force_n())
        self._bodies.add(self.time_s, {name: matrix_of(pose) for name, pose in self.sim.world.bodies()})

    def _expose(self) -> None:
        exposed_s = self.time_s
        if not self.camera_dead:
            self.after(_EXPOSED_S, lambda: self._develop(exposed_s))

    def _develop(self, exposed_s: float) -> None:
        wanted = self.controller.busy and self.controller.state in _SEARCHING
        found: list[Marker] = []
        if wanted:
            body = _CHAIR if self.dock.kind == "wheelchair" else self.dock_id
            motion = self._bodies.motion(exposed_s, {body: self.dock_id})
            found = self._eye.look(motion, self._light(exposed_s))

        def deliver() -> None:
            self._latest_image_s = exposed_s
            self.controller.on_markers(found)

        self.after(_SEARCHED_S, deliver)

    # --- docking controller ------------------------------------------------------------------------------------------

    def on_odometry(self, stamp_s: float, odometry: Odometry) -> None:
        if hasattr(self, "controller"):  # odometry begins before there is a docking controller
            self.controller.on_odometry(stamp_s, odometry.pose)
        self._odometry_stamp_s = stamp_s

    def _measure_force(self) -> None:
        snapshot = self.hardware.session.look()
        if snapshot is None:
            return
        torque = 0.01 * self.robot.drive.max_torque_nm * snapshot.actual_torque[list(DRIVE_AXES)]
        headings_rad = snapshot.actual_pos[list(STEER_AXES)]
        self._force_n = push_n(torque.tolist(), headings_rad.tolist(), self.robot.wheel_radius_m)

    def _situation(self) -> Situation:
        now_s = self.time_s
        odometry = self.drive.odometry
        ahead_s = min(max(now_s - self._odometry_stamp_s, 0.0), self.params.motion.max_extrapolation_s)
        located, _ = self.poses.located(now_s, now_s)
        return Situation(
            now_s=now_s,
            located=None if located is None else self._located_by(located.pose),
            odom=odometry.pose.compose(exp_se2(odometry.twist, ahead_s)),
            twist=odometry.twist,
            safety=self.safety,
            images_fresh=now_s - self._latest_image_s <= _IMAGE_TIMEOUT_S,
            latch=self._latch_inputs(),
            force_n=self._force_n,
            plan_end=self.navigation.goal,
        )

    def _docking_tick(self) -> None:
        output = self.controller.tick(self._situation())
        self._latch(output.latch)
        if output.goal is not None:
            self._drive_to(output.goal)
        elif output.cancel_goal:
            self.navigation.request(GoalRequest("", 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), self.time_s, None)
        if output.twist is not None or self._owned:
            twist = output.twist or ZERO_TWIST
            self.after(0.002, lambda: self.drive.on_command(Source.DOCKING, twist, self.time_s))
        self._owned = output.twist is not None
        if output.attached is not None and output.attached != self.passenger:
            self.passenger = output.attached
            self.drive.set_passenger(output.attached)
            self.navigation.set_passenger(output.attached)
        if output.result is not None:
            self.result = output.result
        world = self.sim.world
        self.docking.append(DockingSample(self.time_s, output, self.true_error(), world.contact_force_n()))

    def true_error(self) -> tuple[float, float, float]:
        """base_link beside the dock pose in the true dock: along m, across m, yaw rad; NaN without a wheelchair."""
        if self.sim.world.wheelchair_pose() is None:
            return math.nan, math.nan, math.nan
        return self.sim.world.dock_error(self.dock.dock_pose.pose())

    def _drive_to(self, pose: Pose2) -> None:
        located, _ = self.poses.located(self.time_s, self.time_s)
        request = GoalRequest(frames.MAP, 0.0, (pose.x, pose.y, 0.0), quaternion_from_yaw(pose.yaw))
        self.navigation.request(request, self.time_s, located)

    # --- latch -------------------------------------------------------------------------------------------------------

    def _latch_inputs(self) -> LatchInputs:
        latch, snapshot = self.robot.latch, self.hardware.session.look()
        if snapshot is None:
            return LatchInputs()
        return LatchInputs(
            True,
            snapshot.input_bit(latch.byte, latch.closed_input_bit),
            snapshot.input_bit(latch.byte, latch.open_input_bit),
        )

    def _latch(self, command: LatchCommand) -> None:
        latch, io = self.robot.latch, self.hardware.engine.io
        io.SetOutBit(latch.byte, latch.close_output_bit, int(command is LatchCommand.CLOSE))
        io.SetOutBit(latch.byte, latch.open_output_bit, int(command is LatchCommand.OPEN))


class Eye:
    """A true camera, what the stack believes of it, and the detector behind it."""

    def __init__(self, dock: Dock, setup: Setup) -> None:
        docks, params = load_docks(), load_camera_params()
        self.frame = dock.camera_frame
        self.dock = dock
        self._calibrated: Intrinsics = load_intrinsics(camera_file(self.frame))
        self.nominal: Array = mounting(load_robot(), self.frame)
        # As the node camera_driver draws its cameras: the same seed is the same camera.
        random = np.random.default_rng([setup.seed, _CAMERAS.index(self.frame)])
        camera = draw_camera(self.frame, self._calibrated, self.nominal, params, random)
        scenery = build_scenery(solids(setup.world), docks)
        self._renderer = Renderer(camera, docks, params, random, scenery)
        self._detector = MarkerDetector(docks, load(ArucoDetectorParams, "aruco_detector").detector)

    def look(self, motion: Motion, conditions: Conditions) -> list[Marker]:
        """The markers in one picture."""
        image = self._renderer.render(motion, conditions)
        found = self._detector.detect(image, self._calibrated, self.frame, motion.time_s)
        return [Marker(motion.time_s, self.frame, item.marker_id, item.pose, item.quality) for item in found]

    def taught(self, docks_id: str, params: DockingParams, pictures: int = 12) -> dict[str, Correction]:
        """What an earlier latched docking leaves: the correction learnt at the dock pose itself."""
        base: Array = np.eye(4)
        dock = matrix_of(on_ground(self.dock.dock_pose.pose().inverse()))
        seen = []
        for _ in range(pictures):
            found = sighting(self.look(Motion.still(base, {docks_id: dock}), CLEAR), self.dock, self.nominal)
            if found is not None:
                seen.append(found.dock)
        p = params.latch
        result = learnt(
            Correction(),
            seen,
            self.dock.dock_pose.pose(),
            p.learn_share,
            p.largest_correction_m,
            p.largest_correction_rad,
        )
        return {docks_id: result} if isinstance(result, Correction) else {}
