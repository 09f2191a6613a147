"""The wires of simulated devices: the drivers' kernels read what was measured, and a device waits for its host."""

from __future__ import annotations

import os
import select
import socket
import struct
from pathlib import Path

import can
import cv2
import numpy as np
import pytest

from robot_stack.core.config import load
from robot_stack.drivers.pylontech.pack import Pack
from robot_stack.drivers.pylontech.params import PylontechDriverParams
from robot_stack.drivers.xsens.params import XsensDriverParams
from robot_stack.drivers.xsens.unit import START, Unit
from robot_stack.drivers.xsens.xbus import GO_TO_MEASUREMENT
from sim.devices import host
from sim.devices.battery_line import BatteryLine
from sim.devices.imu_line import ImuLine
from sim.devices.serial_line import SerialLine
from sim.devices.udp import ADDRESS, UdpSender, free_port
from sim.devices.v4l2 import V4l2Camera
from sim.plant.battery import BatteryReading
from sim.plant.imu import ImuSample
from tests.support.waiting import wait_for

SAMPLE = ImuSample(1.25, (0.1, -0.2, 9.8), (0.01, 0.02, -0.03), (0.0, 0.0, 0.6, 0.8))
READING = BatteryReading(48.5, -3.2, 0.87, 26.0, 24.5, charging=False)


def ask(terminal: int, line: ImuLine) -> None:
    """The driver asks the unit to measure, and reads its answer."""
    os.write(terminal, START)
    wait_for(lambda: line.send(SAMPLE) or has_data(terminal), "the unit's answer")
    assert os.read(terminal, 4096)[2] == GO_TO_MEASUREMENT + 1


def has_data(terminal: int) -> bool:
    """The kernel hands over what is written to a pseudo terminal a little later."""
    return bool(select.select([terminal], [], [], 0.2)[0])


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host, "_PATIENCE_S", 0.05)


def test_the_xsens_driver_reads_the_samples_of_the_unit(tmp_path: Path) -> None:
    line = ImuLine(tmp_path / "imu")
    terminal = os.open(tmp_path / "imu", os.O_RDWR | os.O_NOCTTY)
    unit = Unit(load(XsensDriverParams, "xsens_driver", {"latency_s": 0.002}))
    line.send(SAMPLE)  # not asked to measure yet: nothing is sent
    ask(terminal, line)
    line.send(SAMPLE)
    wait_for(lambda: has_data(terminal), "a sample")
    (sample,) = unit.received(os.read(terminal, 4096), 100.0)
    os.close(terminal)
    assert sample.stamp_s == pytest.approx(100.0 - 0.002)
    assert sample.orientation_xyzw == pytest.approx(SAMPLE.orientation_xyzw, abs=1e-6)
    assert sample.acceleration_mps2 == pytest.approx(SAMPLE.acceleration_mps2, abs=1e-5)
    assert sample.rotation_radps == pytest.approx(SAMPLE.rotation_radps, abs=1e-6)


def test_a_host_that_does_not_read_has_to_ask_the_unit_again(tmp_path: Path, impatient: None) -> None:
    line = ImuLine(tmp_path / "imu")
    terminal = os.open(tmp_path / "imu", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    ask(terminal, line)
    line.send(SAMPLE)
    wait_for(lambda: has_data(terminal), "a sample")
    line.send(SAMPLE)  # the one before was not read
    line.send(SAMPLE)
    with pytest.raises(BlockingIOError):
        os.read(terminal, 4096)
    ask(terminal, line)
    line.send(SAMPLE)
    wait_for(lambda: has_data(terminal), "a sample")
    assert os.read(terminal, 4096)
    os.close(terminal)


def test_the_battery_is_read_by_its_can_adapter(tmp_path: Path) -> None:
    line = BatteryLine(tmp_path / "battery")
    pack = Pack(load(PylontechDriverParams, "pylontech_driver").pack)
    with can.Bus(interface="slcan", channel=str(tmp_path / "battery"), bitrate=500000, sleep_after_open=0.0) as bus:

        def read() -> bool:
            line.send(READING)
            while (message := bus.recv(0.02)) is not None:
                pack.received(message.arbitration_id, bytes(message.data), 10.0)
            return pack.reading(10.0) is not None

        wait_for(read, "a reading")
    reading = pack.reading(10.0)
    assert reading is not None
    assert (reading.voltage_v, reading.current_a) == pytest.approx((48.5, -3.2))
    assert (reading.charge, reading.temperature_c) == pytest.approx((0.87, 24.5))


def test_packets_wait_until_they_are_read(impatient: None) -> None:
    port = free_port()
    sender = UdpSender(port)
    sender.send([b"lost"])
    assert not sender.absent  # no socket, nothing waits
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind((ADDRESS, port))
        sender.send([b"one"])
        assert sender.absent
        assert receiver.recv(10) == b"one"
        sender.send([])
        assert not sender.absent
    sender.close()


def test_a_camera_sends_each_frame_with_its_time_to_the_program_that_opened_it(tmp_path: Path, impatient: None) -> None:
    camera = V4l2Camera(tmp_path / "cameras" / "front")
    pixels = np.full((48, 64), 90, np.uint8)
    camera.send(pixels, 1.0)  # nobody has opened it
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as program:
        program.connect(str(tmp_path / "cameras" / "front"))
        camera.send(pixels, 2.5)
        data = program.recv(1 << 20)
    assert struct.unpack_from("<q", data) == (2_500_000,)
    found = cv2.imdecode(np.frombuffer(data[8:], np.uint8), cv2.IMREAD_GRAYSCALE)
    assert found.shape == pixels.shape
    assert np.abs(found.astype(int) - pixels).max() <= 2
    camera.send(pixels, 3.0)  # it has closed it
    camera.close()
    assert not (tmp_path / "cameras" / "front").exists()


def test_a_line_that_is_read_waits_for_nothing(tmp_path: Path, impatient: None) -> None:
    line = SerialLine(tmp_path / "line")
    assert line.wait_read()  # pulled
    line.plug()
    assert line.wait_read()
    terminal = os.open(tmp_path / "line", os.O_RDWR | os.O_NOCTTY)
    line.send(b"abc")
    wait_for(lambda: has_data(terminal), "the bytes")
    assert not line.wait_read()
    assert line.wait_read()  # the bytes were dropped
    os.close(terminal)
    line.pull()
