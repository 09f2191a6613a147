"""aruco_detector: publishes /docking/aruco_detections from camera images, one array for both cameras' exposures."""

from __future__ import annotations

from functools import partial

import cv2
from sensor_msgs.msg import CameraInfo

from custom_msgs.msg import ArucoDetection, ArucoDetectionArray
from robot_stack.contract import frames, topics
from robot_stack.core.camera import Intrinsics
from robot_stack.core.config import ConfigError
from robot_stack.core.docks import load_docks
from robot_stack.docking.nodes.aruco_messages import Seen, detection_array, detections, intrinsics_of
from robot_stack.docking.vision.detection_gate import DetectionGate
from robot_stack.docking.vision.detector import MarkerDetector
from robot_stack.docking.vision.pairing import Attention, Exposure, ExposureSets
from robot_stack.docking.vision.params import ArucoDetectorParams
from robot_stack.docking.warm_up import warm_up
from robot_stack.middleware.conversions import time_to_s
from robot_stack.middleware.image import grey_image
from robot_stack.middleware.inputs import Input
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.wire import ImageView

_CAMERAS = {
    frames.FRONT_CAMERA: (topics.FRONT_IMAGE, topics.FRONT_CAMERA_INFO),
    frames.REAR_CAMERA: (topics.REAR_IMAGE, topics.REAR_CAMERA_INFO),
}
# Rate of checks whether an image has waited long enough: with one camera dead the delay grows by at most a period.
_LOOK_HZ = 20.0


class ArucoDetectorNode(StackNode, bulk=True):
    """Detects markers during docking, and publishes empty arrays otherwise."""

    def __init__(self) -> None:
        super().__init__("aruco_detector", ArucoDetectorParams)
        cv2.setNumThreads(1)  # more threads cost more than they gain, and the other core has work
        try:
            self._detector = MarkerDetector(load_docks(), self.params.detector)
        except ValueError as error:
            raise ConfigError(f"config/docks.yaml: {error}") from error
        warm_up()
        self._period_s = 1.0 / topics.ARUCO_DETECTIONS.nominal_rate_hz
        self._sets: ExposureSets[Seen] = ExposureSets(tuple(_CAMERAS), self._period_s, self.params.pair_wait_s)
        self._attention = Attention(tuple(_CAMERAS), self.params.idle_camera_every)
        self._intrinsics: dict[str, Intrinsics] = {}
        self._complaints: dict[str, str] = {}
        self._gate = DetectionGate(self.params.linger_s)
        self._on = False
        self._published_s = self.steady_s()
        self._images: dict[str, Input] = {}
        self._output = self.advertise(topics.ARUCO_DETECTIONS)
        self._status = self.subscribe(topics.DOCKING_STATUS)
        for camera, (image, info) in _CAMERAS.items():
            self.subscribe(info, partial(self._on_info, camera))
            self._images[camera] = self.subscribe(image, partial(self._on_image, camera))
        self.set_health(False, "waiting for images")
        self.every(_LOOK_HZ, self._look)

    def _on_info(self, camera: str, message: CameraInfo) -> None:
        try:
            self._intrinsics[camera] = intrinsics_of(message)
            self._complaints.pop(f"{camera} info", None)
        except ValueError as error:
            self._intrinsics.pop(camera, None)
            self._complaints[f"{camera} info"] = f"{camera} camera_info: {error}"

    def _on_image(self, camera: str, message: ImageView) -> None:
        received_s, stamp_s = self._images[camera].received_s, time_to_s(message.header.stamp)
        new = self._sets.is_new(camera, stamp_s)
        self._note(f"{camera} stamp", "" if new else f"{camera} image: stamp is not newer than the last")
        if new:
            self._switch()
            began_s = self.monotonic_s()
            found = self._detect(camera, message) if self._on else []
            taken_ms = 1e3 * (self.monotonic_s() - began_s)
            self._sets.add(Exposure(camera, stamp_s, received_s, Seen(message.header.stamp, found, taken_ms)))
        self._look()

    def _switch(self) -> None:
        state = self._status.latest.state if self._status.fresh() else ""
        on = self.params.always_on or self._gate.wanted(state, self.steady_s())
        if on and not self._on:
            self._detector.reset()
            self._attention.reset()
        self._on = on

    def _detect(self, camera: str, message: ImageView) -> list[ArucoDetection]:
        intrinsics = self._intrinsics.get(camera)
        if intrinsics is None or not self._attention.uses(camera):
            return []
        try:
            observations = self._detector.detect(
                grey_image(message), intrinsics, camera, time_to_s(message.header.stamp)
            )
        except ValueError as error:
            self._note(f"{camera} image", f"{camera} {error}")
            return []
        self._note(f"{camera} image", "")
        if observations:
            self._attention.saw(camera)
        return detections(observations, camera, message.header.stamp)

    def _look(self) -> None:
        now_s = self.steady_s()
        alive = frozenset(camera for camera, entry in self._images.items() if entry.fresh())
        exposures = self._sets.take(now_s, alive, self._attention.leading)
        # Without images the rate is kept by empty arrays of stamp zero; a late image gets one more period.
        if not exposures and now_s - self._published_s < self._period_s * (2.0 if alive else 1.0):
            return
        self._published_s = now_s if exposures else max(self._published_s + self._period_s, now_s - self._period_s)
        output = detection_array(exposures)
        self._output.publish(output)
        self._report_state(alive, output, sum(seen.item.taken_ms for seen in exposures))

    def _note(self, about: str, text: str) -> None:
        """Sets the problem of an item for the health; empty: clears it."""
        if text:
            self._complaints[about] = text
        else:
            self._complaints.pop(about, None)

    def _report_state(self, alive: frozenset[str], output: ArucoDetectionArray, taken_ms: float) -> None:
        silent = [f"no images of {camera}" for camera in _CAMERAS if camera not in alive]
        blind = [f"no camera_info of {camera}" for camera in sorted(alive) if camera not in self._intrinsics]
        faults = ["waiting for images"] if not alive else [*silent, *blind, *self._complaints.values()]
        self.set_health(
            not faults, "; ".join(faults) or ("detecting" if self._on else "idle: docking needs no markers")
        )
        self.report.values["detect_ms"] = f"{taken_ms:.2f}" if self._on else "off"
        self.report.values["markers"] = ", ".join(str(item.marker_id) for item in output.detections) or "none"
