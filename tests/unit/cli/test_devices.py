"""doctor finds and names the devices of the real robot's drivers."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from robot_stack.cli.devices import Device, devices
from robot_stack.core.config import config_dir
from sim.devices.serial_line import SerialLine
from tests.support.devices.modbus import Registers, TcpDevice
from tests.support.ouster_packets import Os


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the configuration whose ports lie in the test's folder."""
    folder = tmp_path / "config"
    shutil.copytree(config_dir(), folder, ignore=shutil.ignore_patterns("maps", "worlds"))
    monkeypatch.setenv("ROBOT_STACK_CONFIG", str(folder))
    xsens = folder / "xsens_driver.yaml"
    xsens.write_text(xsens.read_text().replace("/dev/robot_imu", str(tmp_path / "imu")))
    return folder


def found() -> dict[str, Device]:
    return {device.driver: device for device in devices()}


def test_every_driver_of_the_robots_profile_is_named(config: Path) -> None:
    drivers = found()
    assert "/ouster/points in frame os_lidar" in drivers["point_cloud_adapter"].what
    assert "/livox/lidar" in drivers["overhead_lidar_adapter"].what
    assert "xsens_driver" in drivers


def test_adapters_name_the_topics_that_they_expect(config: Path) -> None:
    profile = config / "profiles" / "robot.yaml"
    text = profile.read_text()
    replaced = {
        "v4l2_camera_driver": ("camera_adapter", "/rear_camera/image_raw in frame rear_camera_optical"),
        "xsens_driver": ("imu_adapter", "/imu/data in frame imu_link"),
        "pylontech_driver": ("battery_adapter", "/battery/state"),
    }
    for driver, (adapter, _) in replaced.items():
        text = text.replace(f"  - {driver}\n", f"  - {adapter}\n")
    profile.write_text(text)
    for adapter, what in replaced.values():
        assert found()[adapter].there
        assert what in found()[adapter].what


def test_serial_port_presence_is_reported_with_advice(config: Path) -> None:
    port = config.parent / "imu"
    missing = found()["xsens_driver"]
    assert not missing.there
    assert missing.what == f"{port} is not there"
    assert "serial ports here" in missing.advice
    line = SerialLine(port)
    line.plug()
    try:
        assert found()["xsens_driver"] == Device("xsens_driver", True, f"{port}: a serial line")
    finally:
        line.pull()


def test_can_interface_presence_is_reported_with_advice(
    config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The kernel's folder of network interfaces is a fake, since the machine may have no such adapter."""
    network = tmp_path / "net"
    monkeypatch.setattr("robot_stack.cli.devices._NETWORK", network)

    def interface(name: str, kind: int, state: str) -> None:
        (network / name).mkdir(parents=True, exist_ok=True)
        (network / name / "type").write_text(f"{kind}\n")
        (network / name / "operstate").write_text(f"{state}\n")

    interface("lo", 772, "unknown")
    missing = found()["pylontech_driver"]
    assert (missing.there, missing.what) == (False, "there is no CAN interface can0")
    assert missing.advice.endswith("CAN interfaces here: none")
    interface("can1", 280, "up")
    assert found()["pylontech_driver"].advice.endswith("CAN interfaces here: can1")
    interface("can0", 1, "up")
    assert found()["pylontech_driver"].what == "can0 is no CAN interface"
    interface("can0", 280, "down")
    assert found()["pylontech_driver"] == Device(
        "pylontech_driver", False, "CAN interface can0 is down", "ip link set can0 up type can bitrate 500000"
    )
    interface("can0", 280, "up")
    assert found()["pylontech_driver"] == Device("pylontech_driver", True, "CAN interface can0 is up")


def test_lidar_reachability_is_reported(config: Path) -> None:
    profile, file = config / "profiles" / "robot.yaml", config / "velodyne_driver.yaml"
    profile.write_text(profile.read_text().replace("  - point_cloud_adapter ", "  - velodyne_driver ", 1))
    file.write_text(file.read_text().replace("192.168.1.201", "203.0.113.7"))
    missing = found()["velodyne_driver"]
    assert (missing.there, missing.what) == (False, "no network interface reaches 203.0.113.7")
    file.write_text(file.read_text().replace("203.0.113.7", "127.0.0.9"))
    assert found()["velodyne_driver"].what == "127.0.0.9 is reached by lo (127.0.0.1), port 2368"


def test_ouster_is_identified_by_metadata_or_error_is_reported(config: Path) -> None:
    profile, file = config / "profiles" / "robot.yaml", config / "ouster_driver.yaml"
    profile.write_text(profile.read_text().replace("  - point_cloud_adapter ", "  - ouster_driver ", 1))
    file.write_text(file.read_text().replace("192.168.1.202", "127.0.0.9"))
    missing = found()["ouster_driver"]
    assert not missing.there
    assert missing.what.startswith(f"{config}/ouster_metadata.json: cannot be read: No such file or directory; curl -o")
    metadata = config / "ouster_metadata.json"
    for sensor, what in (
        (Os(beams=128), "the sensor has 128 beams, expected at most 64"),
        (Os(profile="OFF"), "udp_profile_lidar is OFF, expected one of"),
    ):
        metadata.write_text(sensor.metadata())
        assert not found()["ouster_driver"].there
        assert what in found()["ouster_driver"].what
    metadata.write_text(Os(beams=64).metadata())
    assert found()["ouster_driver"] == Device(
        "ouster_driver",
        True,
        "OS-1-64 122201000998, 512x10, RNG19_RFL8_SIG16_NIR16: 127.0.0.9 is reached by lo (127.0.0.1), port 7502",
    )


def test_joystick_presence_is_reported(config: Path) -> None:
    profile, file = config / "profiles" / "robot.yaml", config / "joystick_driver.yaml"
    profile.write_text(profile.read_text().replace("processes:\n", "processes:\n  - joystick_driver\n", 1))
    device = config.parent / "js"
    file.write_text(file.read_text().replace("/dev/input/js0", str(device)))
    assert found()["joystick_driver"].what == f"{device} is not there"
    device.touch()
    assert found()["joystick_driver"] == Device("joystick_driver", True, str(device))


def test_modbus_battery_reachability_is_reported_with_advice(config: Path) -> None:
    profile, file = config / "profiles" / "robot.yaml", config / "modbus_battery_driver.yaml"
    profile.write_text(profile.read_text().replace("  - pylontech_driver\n", "  - modbus_battery_driver\n", 1))
    device = TcpDevice(Registers(225, {}))
    file.write_text(file.read_text().replace("192.168.0.20", "127.0.0.1").replace("502\n", f"{device.port}\n", 1))
    assert found()["modbus_battery_driver"] == Device("modbus_battery_driver", True, f"127.0.0.1:{device.port} is open")
    device.close()
    missing = found()["modbus_battery_driver"]
    assert (missing.there, missing.what.split(":")[0]) == (False, "127.0.0.1")
    assert "switch Modbus/TCP on" in missing.advice


def test_an_adapter_on_a_serial_line(config: Path) -> None:
    file = config / "pylontech_driver.yaml"
    port = config.parent / "can"
    file.write_text(file.read_text().replace("socketcan ", "slcan ", 1).replace("channel: can0", f"channel: {port}"))
    assert found()["pylontech_driver"].what == f"{port} is not there"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may open everything")
def test_a_port_that_may_not_be_opened(config: Path) -> None:
    port = config.parent / "imu"
    port.touch(mode=0o000)
    assert "may not be opened" in found()["xsens_driver"].what


def test_invalid_driver_configuration_is_reported(config: Path) -> None:
    (config / "xsens_driver.yaml").write_text("baud_rate: 12\n")
    device = found()["xsens_driver"]
    assert not device.there
    assert "baud_rate" in device.what


def test_camera_presence_is_reported_with_advice(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernel's folder of cameras is a fake, since the machine may have none."""
    cameras = tmp_path / "video4linux"
    monkeypatch.setattr("robot_stack.cli.devices._CAMERAS", cameras)
    (cameras / "video0").mkdir(parents=True)
    (cameras / "video0" / "name").write_text("USB camera\n")
    file = config / "v4l2_camera_driver.yaml"
    text = file.read_text()
    missing = found()["v4l2_camera_driver"]
    assert (missing.there, missing.what) == (False, "/dev/robot_front_camera is not there")
    assert missing.advice.endswith("cameras here: /dev/video0, USB camera")
    front, rear = tmp_path / "front", tmp_path / "rear"
    front.touch()
    rear.touch()
    file.write_text(text.replace("/dev/robot_front_camera", str(front)).replace("/dev/robot_rear_camera", str(rear)))
    assert found()["v4l2_camera_driver"] == Device("v4l2_camera_driver", True, f"{front} and {rear}")
