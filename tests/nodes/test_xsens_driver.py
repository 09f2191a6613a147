"""The driver of the Xsens unit on a real pseudo terminal: samples, a cable that is pulled and plugged in, silence."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

from robot_stack.contract import topics
from robot_stack.middleware.conversions import time_to_s
from sim.devices.serial_line import SerialLine
from sim.devices.xsens import Motion, Mti, frame
from tests.support.peer import Peer, says
from tests.support.processes import Start
from tests.support.waiting import wait_for

MOTION = Motion(rotation_radps=(0.0, 0.0, 0.25))
PERIOD_S = 0.01


class Device:
    """A unit that sends by its own clock, on a cable that can be pulled."""

    def __init__(self, link: Path) -> None:
        self.line, self.unit = SerialLine(link), Mti()
        self.send, self.extra = True, b""
        self._turn, self._ended = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def plug(self) -> None:
        with self._turn:
            self.line.plug()

    def pull(self) -> None:
        with self._turn:
            self.line.pull()

    def _run(self) -> None:
        due_s = time.monotonic()
        while not self._ended.wait(max(0.0, due_s - time.monotonic())):
            due_s += PERIOD_S
            with self._turn:
                self.line.send(self.unit.answer_to(self.line.received()))
                sample = self.unit.sample(MOTION)
                if self.unit.measuring and self.send:
                    self.line.send(self.extra + sample)

    def close(self) -> None:
        self._ended.set()
        self._thread.join()
        self.pull()


@pytest.fixture
def device(ros_domain: int) -> Iterator[Device]:
    folder = Path(os.environ["ROBOT_STACK_RUNTIME_DIR"])
    folder.mkdir(parents=True, exist_ok=True)
    device = Device(folder / "imu")
    yield device
    device.close()


def test_samples_silence_and_a_pulled_cable(start: Start, peer: Peer, device: Device) -> None:
    samples, diagnostics, mountings = (
        peer.listen(topics.IMU),
        peer.listen(topics.DIAGNOSTICS),
        peer.listen(topics.TF_STATIC),
    )
    start("xsens_driver", "-p", "serial.port:=imu", "-p", "serial.silent_s:=1.0")
    says(diagnostics, "xsens_driver", "No such file or directory")
    device.plug()
    wait_for(lambda: len(samples.items) >= 100, "samples")
    assert device.unit.measuring, "the unit was commanded to measure"
    message = samples.last
    assert message.header.frame_id == "imu"
    assert message.angular_velocity.z == pytest.approx(0.25)
    assert message.linear_acceleration.z == pytest.approx(9.81, abs=1e-5)
    assert (message.orientation.w, message.orientation_covariance[0]) == pytest.approx((1.0, 0.004**2))
    stamps = [time_to_s(item.header.stamp) for item in samples.messages[-50:]]
    # By the unit's clock, independent of delays of a busy machine; a lost sample leaves a whole gap.
    steps = [(later - earlier) / PERIOD_S for earlier, later in pairwise(stamps)]
    assert all(abs(step - round(step)) < 0.2 and round(step) >= 1 for step in steps), steps
    assert abs(stamps[-1] - time.time()) < 30.0
    assert mountings.wait(lambda message: message.transforms, "the mounting").transforms[0].child_frame_id == "imu"
    says(diagnostics, "xsens_driver", "samples arrive")
    # Garbage and a corrupt frame are counted, and the next sample arrives. A line that is full loses some of them.
    device.extra = b"\x00\x01" + frame(0x36, b"\x10\x60\x04\x00")[:-1] + b"\x00"
    wait_for(lambda: int(says(diagnostics, "xsens_driver", "samples arrive")["frames corrupt"]) > 0, "a corrupt frame")
    device.extra = b""
    # The unit stops sending on an open line.
    device.send = False
    says(diagnostics, "xsens_driver", "no data arrives")
    count = len(samples.items)
    says(diagnostics, "xsens_driver", "no samples")
    assert len(samples.items) == count
    device.send = True
    wait_for(lambda: len(samples.items) > count + 10, "samples again")
    # The cable is pulled, and plugged in again.
    device.pull()
    says(diagnostics, "xsens_driver", "no samples: ")
    count = len(samples.items)
    device.unit.measuring = False
    device.plug()
    wait_for(lambda: len(samples.items) > count + 10, "samples again")
    assert int(says(diagnostics, "xsens_driver", "samples arrive")["opened"].split()[0]) >= 2


def test_missing_unit_outputs_are_reported(start: Start, peer: Peer, device: Device) -> None:
    samples, diagnostics = peer.listen(topics.IMU), peer.listen(topics.DIAGNOSTICS)
    device.send = False
    device.plug()
    start("xsens_driver", "-p", "serial.port:=imu")
    wait_for(lambda: device.unit.measuring, "the greeting")
    with device._turn:
        device.line.send(frame(0x36, b"\x10\x60\x04\x00\x00\x00\x01"))
    says(diagnostics, "xsens_driver", "MTData2 has 0x1060, expected also Quaternion (0x2010)")
    assert not samples.items
