"""Node camera_driver: the simulated front and rear cameras, with images of the true poses of all bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from sensor_msgs.msg import Image

from robot_stack.contract import frames, services, topics
from robot_stack.contract.model import Topic
from robot_stack.core.camera import Intrinsics, camera_file, load_intrinsics
from robot_stack.core.camera import mounting as camera_mounting
from robot_stack.core.config import Config
from robot_stack.core.docks import Docks, load_docks
from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.nodes.camera_output import camera_transform
from robot_stack.middleware.conversions import camera_info, time_from_s
from robot_stack.middleware.node import StackNode
from sim.camera.conditions import Conditions
from sim.camera.faults import CameraFaults
from sim.camera.history import BodyHistory, ExposurePlan
from sim.camera.model import draw_camera
from sim.camera.motion import Motion
from sim.camera.params import load_camera_params
from sim.camera.render import Renderer
from sim.camera.scenery import build_scenery
from sim.camera.warm_up import warm_up
from sim.devices.v4l2 import V4l2Camera
from sim.nodes.bodies import Bodies
from sim.nodes.fault_service import serve_faults
from sim.nodes.message_bytes import ImageBytes
from sim.plant.terrain import solids
from sim.worldfile import load_world
from tf2_msgs.msg import TFMessage

_WHEELCHAIR_BODY = "wheelchair"
_FRONT, _REAR = "front", "rear"
_END_S = 2.0
_ROWS: dict[str, tuple[str, Topic, Topic]] = {
    _FRONT: (frames.FRONT_CAMERA, topics.FRONT_IMAGE, topics.FRONT_CAMERA_INFO),
    _REAR: (frames.REAR_CAMERA, topics.REAR_IMAGE, topics.REAR_CAMERA_INFO),
}


class CameraDriverParams(Config):
    """``config/camera_driver.yaml``.

    device_folder: in the runtime folder, where the cameras are V4L2 devices ``front`` and ``rear`` for programs with
    the library of ``sim.devices.v4l2``; empty: none, but the topics.
    """

    seed: Annotated[int, Field(ge=0)]
    world: str
    rear_phase_s: Annotated[float, Field(ge=0.0, lt=0.1)]
    silence_s: Annotated[float, Field(gt=0.0)]
    device_folder: str


class _Topics:
    """The image and the intrinsics of a camera as messages."""

    def __init__(self, node: StackNode, frame: str, calibrated: Intrinsics, rows: tuple[Topic, Topic]) -> None:
        image = Image(height=calibrated.height, width=calibrated.width, encoding="mono8", step=calibrated.width)
        self._info = camera_info(calibrated)
        image.header.frame_id = self._info.header.frame_id = frame
        self._image = ImageBytes(image)
        self._images, self._infos = (node.advertise(row) for row in rows)

    def take(self, picture: NDArray[np.uint8], time_s: float) -> bytes:
        """The image's message."""
        return self._image.filled(picture, time_from_s(time_s))

    def publish(self, time_s: float, data: bytes) -> None:
        self._images.publish(data)
        self._info.header.stamp = time_from_s(time_s)
        self._infos.publish(self._info)


@dataclass(frozen=True, slots=True)
class _Device:
    """A camera as a device file. middle_s: from the start of the first row's exposure to the image's time."""

    file: V4l2Camera
    middle_s: float

    def take(self, picture: NDArray[np.uint8], time_s: float) -> bytes:
        """Sends the frame. No message."""
        self.file.send(picture, time_s - self.middle_s)
        return b""


@dataclass(slots=True)
class _Camera:
    name: str
    renderer: Renderer
    plan: ExposurePlan
    picture: NDArray[np.uint8]
    output: _Topics | _Device
    exposed: bool = False


class CameraDriverNode(StackNode, bulk=True):
    """Takes an image once the history of the bodies covers its exposure."""

    def __init__(self) -> None:
        super().__init__("camera_driver", CameraDriverParams)
        self._docks = load_docks()
        self._boards = _dock_by_body(self._docks)
        self._history = BodyHistory()
        self._cameras = self._build()
        size = self._cameras[0].picture.shape
        markers = [marker for dock in self._docks.docks.values() for marker in dock.markers]
        self._faults = CameraFaults(_ROWS, markers, size)
        if not self.params.device_folder:
            self._tf = self.advertise(topics.TF_STATIC)
            # Nominal: without the simulated cameras' mounting error.
            self._tf.publish(TFMessage(transforms=[camera_transform(self, frame) for frame, _, _ in _ROWS.values()]))
        # Called before each image; returns False in runs that do not need images.
        self.wants_pictures: Callable[[], bool] = lambda: True
        self.conditions: Callable[[str, float], Conditions] = self._faults.conditions
        self._worker = self.worker("camera", world_waits=True)
        self.at_end.callback(self._worker.close, _END_S)
        self._bodies = Bodies(self, self._on_bodies)
        serve_faults(self, services.INJECT_CAMERA_FAULT, self.inject_fault)
        self.set_health(False, f"waiting for {topics.SIM_BODIES.name}")
        self.every(2.0, self._watch)

    def _on_bodies(self, time_s: float, poses: dict[str, NDArray[np.float64]]) -> None:
        self._history.add(time_s, poses)
        for camera in self._cameras:
            due_s = camera.plan.due(self._history)
            if due_s is not None:
                self._take(camera, due_s)

    def _take(self, camera: _Camera, time_s: float) -> None:
        if self._faults.is_active("silent", camera.name, time_s) or not self.wants_pictures():
            return
        frozen = self._faults.is_active("frozen", camera.name, time_s) and camera.exposed
        camera.exposed = True
        motion = None if frozen else self._history.motion(time_s, self._boards)
        conditions = self.conditions(camera.name, time_s)
        self._worker.submit(
            lambda: _picture(camera, time_s, motion, conditions), lambda data: self._publish(camera, time_s, data)
        )

    def _publish(self, camera: _Camera, time_s: float, data: bytes) -> None:
        if isinstance(camera.output, _Topics):
            camera.output.publish(time_s, data)
        self.set_health(True, "pictures are taken")

    def _watch(self) -> None:
        self._bodies.watch(self.params.silence_s)

    def inject_fault(self, kind: str, target: str, value: float, duration_s: float) -> str:
        """Raises FaultRefused."""
        return self._faults.inject(kind, target, value, duration_s, self.now_s())

    def _build(self) -> list[_Camera]:
        warm_up()
        params = load_camera_params()
        scenery = build_scenery(solids(load_world(self.params.world)), self._docks)
        cameras = []
        for index, (name, (frame, image_row, info_row)) in enumerate(_ROWS.items()):
            calibrated = load_intrinsics(camera_file(frame))
            random = np.random.default_rng([self.params.seed, index])
            camera = draw_camera(frame, calibrated, camera_mounting(self.robot, frame), params, random)
            renderer = Renderer(camera, self._docks, params, random, scenery)
            shutter = params.shutter
            margin_s = 0.5 * (calibrated.height * shutter.row_time_s + shutter.exposure_s)
            phase_s = self.params.rear_phase_s if name == _REAR else 0.0
            plan = ExposurePlan(1.0 / image_row.nominal_rate_hz, phase_s, margin_s)
            picture = np.zeros((calibrated.height, calibrated.width), np.uint8)
            output: _Topics | _Device
            if self.params.device_folder:
                output = _Device(V4l2Camera(runtime_dir() / self.params.device_folder / name), margin_s)
                self.at_end.callback(output.file.close)
            else:
                output = _Topics(self, frame, calibrated, (image_row, info_row))
            cameras.append(_Camera(name, renderer, plan, picture, output))
        return cameras


def _picture(camera: _Camera, time_s: float, motion: Motion | None, conditions: Conditions) -> bytes:
    """Runs on the worker: the message of an image. If motion is None, the previous image is sent again."""
    if motion is not None:
        camera.renderer.render(motion, conditions, camera.picture)
    return camera.output.take(camera.picture, time_s)


def _dock_by_body(docks: Docks) -> dict[str, str]:
    """Dock ids by the body that carries the board: a station by its name, the wheelchair by its kind."""
    return {_WHEELCHAIR_BODY if dock.kind == "wheelchair" else name: name for name, dock in docks.docks.items()}
