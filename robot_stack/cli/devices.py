"""doctor: the devices that the real robot's profile requires, each by its driver's configured port."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterable
from ipaddress import ip_address, ip_interface
from pathlib import Path
from typing import Any, NamedTuple

import psutil

from robot_stack.contract import frames
from robot_stack.core.config import ConfigError, config_dir, load, read_yaml
from robot_stack.core.robot import load_robot
from robot_stack.core.runtime import runtime_dir
from robot_stack.drivers.joystick.params import JoystickDriverParams
from robot_stack.drivers.modbus.params import ModbusBatteryDriverParams
from robot_stack.drivers.nodes.ouster_metadata import check, load_metadata
from robot_stack.drivers.ouster.layouts import layout_of
from robot_stack.drivers.ouster.params import OusterDriverParams
from robot_stack.drivers.packet_lidar_params import PacketLidarParams
from robot_stack.drivers.point_cloud.params import PointCloudAdapterParams
from robot_stack.drivers.pylontech.params import PylontechDriverParams
from robot_stack.drivers.v4l2.params import V4l2CameraDriverParams
from robot_stack.drivers.velodyne.params import VelodyneDriverParams
from robot_stack.drivers.vendor.battery import BatteryAdapterParams
from robot_stack.drivers.vendor.image import CameraAdapterParams
from robot_stack.drivers.vendor.imu import ImuAdapterParams
from robot_stack.drivers.xsens.params import XsensDriverParams

_PROFILE = "robot"
_NETWORK = Path("/sys/class/net")
_CAMERAS = Path("/sys/class/video4linux")
_ARPHRD_CAN = "280"  # linux/if_arp.h


class Device(NamedTuple):
    """driver: its node. there: found as configured. what: its description. advice: what to do if it is missing."""

    driver: str
    there: bool
    what: str
    advice: str = ""


def devices() -> Iterable[Device]:
    """The device of each driver in the real robot's profile. Raises ConfigError."""
    for name in read_yaml(config_dir() / "profiles" / f"{_PROFILE}.yaml").get("processes", []):
        look = _LOOKS.get(name)
        if look is not None:
            try:
                yield look(name)
            except ConfigError as error:
                yield Device(name, False, str(error), "correct the file")


def _vendor_cloud(name: str) -> Device:
    params = load(PointCloudAdapterParams, name)
    what = (
        f"expects {params.topic} in frame {params.frame_id} from the LiDAR's own ROS driver, which is not started here"
    )
    return Device(name, True, what)


def _vendor_cameras(name: str) -> Device:
    params = load(CameraAdapterParams, name)
    given = [camera for camera in (params.front, params.rear) if camera is not None]
    what = " and ".join(f"{camera.topic} in frame {camera.frame_id}" for camera in given)
    return Device(name, True, f"expects {what} from the cameras' own ROS drivers, which are not started here")


def _vendor_imu(name: str) -> Device:
    params = load(ImuAdapterParams, name)
    what = (
        f"expects {params.topic} in frame {params.frame_id} from the unit's own ROS driver, which is not started here"
    )
    return Device(name, True, what)


def _vendor_battery(name: str) -> Device:
    topic = load(BatteryAdapterParams, name).topic
    return Device(name, True, f"expects {topic} from the battery's own ROS driver, which is not started here")


def _xsens(name: str) -> Device:
    params = load(XsensDriverParams, name)
    return _serial(name, str(runtime_dir() / params.serial.port))


def _pylontech(name: str) -> Device:
    can = load(PylontechDriverParams, name).can
    if can.interface == "slcan":
        return _serial(name, str(runtime_dir() / can.channel))
    interface = _NETWORK / can.channel
    if not interface.is_dir():
        there = ", ".join(sorted(path.name for path in _NETWORK.iterdir() if _is_can(path))) or "none"
        advice = f"plug the adapter in, or name another in config/{name}.yaml; CAN interfaces here: {there}"
        return Device(name, False, f"there is no CAN interface {can.channel}", advice)
    if not _is_can(interface):
        return Device(name, False, f"{can.channel} is no CAN interface", f"name another in config/{name}.yaml")
    state = (interface / "operstate").read_text().strip()
    advice = f"ip link set {can.channel} up type can bitrate {can.bitrate}"
    return Device(name, state != "down", f"CAN interface {can.channel} is {state}", advice if state == "down" else "")


def _modbus_battery(name: str) -> Device:
    modbus = load(ModbusBatteryDriverParams, name).modbus
    if modbus.transport == "rtu":
        return _serial(name, str(runtime_dir() / modbus.serial_port))
    try:
        with socket.create_connection((modbus.host, modbus.port), modbus.timeout_s):
            return Device(name, True, f"{modbus.host}:{modbus.port} is open")
    except OSError as error:
        advice = f"switch Modbus/TCP on in the device, or name another in config/{name}.yaml"
        return Device(name, False, f"{modbus.host}:{modbus.port}: {error}", advice)


def _is_can(interface: Path) -> bool:
    return (interface / "type").read_text().strip() == _ARPHRD_CAN


def _velodyne(name: str) -> Device:
    return _packet_lidar(name, load(VelodyneDriverParams, name))


def _ouster(name: str) -> Device:
    params = load(OusterDriverParams, name)
    metadata, source = load_metadata(params)
    check(metadata, source, load_robot().range_sensors[frames.LIDAR])
    layout_of(metadata, source)
    found = _packet_lidar(name, params)
    return found._replace(what=f"{metadata.describe()}: {found.what}")


def _packet_lidar(name: str, params: PacketLidarParams) -> Device:
    near = [
        f"{card} ({address.address})"
        for card, addresses in psutil.net_if_addrs().items()
        for address in addresses
        if address.family == socket.AF_INET and address.netmask and _reaches(address, str(params.device_ip))
    ]
    if not near:
        advice = f"give the interface to it an address of its network: ip addr add ... ; see config/{name}.yaml"
        return Device(name, False, f"no network interface reaches {params.device_ip}", advice)
    return Device(name, True, f"{params.device_ip} is reached by {', '.join(near)}, port {params.port}")


def _reaches(address: Any, device_ip: str) -> bool:
    network = ip_interface(f"{address.address}/{address.netmask}").network
    return ip_address(device_ip) in network


def _joystick(name: str) -> Device:
    path = Path(str(runtime_dir() / load(JoystickDriverParams, name).device))
    if not path.exists():
        there = ", ".join(sorted(map(str, Path("/dev/input").glob("js*")))) or "none (modprobe joydev?)"
        return Device(name, False, f"{path} is not there", f"plug it in; joysticks here: {there}")
    if not os.access(path, os.R_OK):
        return Device(name, False, f"{path} may not be opened", "add yourself to its group: usermod -aG input $USER")
    return Device(name, True, str(path))


def _cameras(name: str) -> Device:
    configured = load(V4l2CameraDriverParams, name).devices
    devices = [str(runtime_dir() / device) for device in (configured.front, configured.rear) if device]
    for device in devices:
        if not Path(device).exists():
            there = ", ".join(f"{_camera(path)}" for path in sorted(_CAMERAS.glob("video*"))) or "none"
            return Device(name, False, f"{device} is not there", f"plug it in, or name another; cameras here: {there}")
        if not os.access(device, os.R_OK | os.W_OK):
            advice = "add yourself to its group: usermod -aG video $USER"
            return Device(name, False, f"{device} may not be opened", advice)
    return Device(name, True, " and ".join(devices))


def _camera(path: Path) -> str:
    return f"/dev/{path.name}, {(path / 'name').read_text().strip()}"


def _serial(name: str, port: str) -> Device:
    path = Path(port)
    if not path.exists():
        return Device(name, False, f"{port} is not there", _udev(path))
    if not os.access(path, os.R_OK | os.W_OK):
        return Device(name, False, f"{port} may not be opened", "add yourself to its group: usermod -aG dialout $USER")
    return Device(name, True, f"{port}: {_description(path.resolve())}")


def _udev(path: Path) -> str:
    others = ", ".join(f"{port} ({_description(Path(port))})" for port in _ports()) or "none"
    return f"plug it in, or name another port in config/; serial ports here: {others}"


def _ports() -> list[str]:
    from serial.tools.list_ports import comports

    return sorted(item.device for item in comports())


def _description(path: Path) -> str:
    """The adapter's own name."""
    from serial.tools.list_ports import comports

    found = {item.device: item for item in comports()}.get(str(path))
    return found.description if found is not None and found.description != "n/a" else "a serial line"


_LOOKS: dict[str, Callable[[str], Device]] = {
    "point_cloud_adapter": _vendor_cloud,
    "overhead_lidar_adapter": _vendor_cloud,
    "camera_adapter": _vendor_cameras,
    "imu_adapter": _vendor_imu,
    "battery_adapter": _vendor_battery,
    "velodyne_driver": _velodyne,
    "ouster_driver": _ouster,
    "v4l2_camera_driver": _cameras,
    "joystick_driver": _joystick,
    "xsens_driver": _xsens,
    "pylontech_driver": _pylontech,
    "modbus_battery_driver": _modbus_battery,
}
