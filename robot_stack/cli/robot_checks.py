"""The checks of ``robot-stack doctor --robot``: what a program can check of the steps of docs/commissioning.md."""

from __future__ import annotations

import grp
import math
import os
import pwd
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_stack.cli.checks import Finding, Level
from robot_stack.cli.topics import TOLERANCE, running_plan
from robot_stack.core.config import ConfigError, load

if TYPE_CHECKING:
    from robot_stack.core.robot import Robot
    from robot_stack.core.site_files import SiteFile
    from robot_stack.supervisor.profile import Plan
    from robot_stack.wmx.axes import StatusSnapshot
    from robot_stack.wmx.config import ClientConfig

ETC = Path("/etc")
SERVICE_FOLDER = Path("/run/robot_stack")
"""Runtime folder of the service, which systemd removes when it stops."""
_SHIPPED = Path(__file__).resolve().parents[2] / "launch_scripts"
_INSTALLED = {
    "robot-stack.service": "systemd/system/robot-stack.service",
    "robot-stack-kiosk.service": "systemd/system/robot-stack-kiosk.service",
    "robot-stack.sysusers": "sysusers.d/robot-stack.conf",
}
_PROFILE, _USER = "robot", "robot"
_SAME_PROFILES = (_PROFILE, "robot_simulated")  # the second one extends the first
# Groups of Debian whose members may open a driver's device.
_GROUPS = {
    "xsens_driver": "dialout",
    "pylontech_driver": "dialout",
    "modbus_battery_driver": "dialout",
    "ehmi_bridge": "dialout",
    "v4l2_camera_driver": "video",
    "joystick_driver": "input",
}
_PUBLIC_PIN = "2468"  # of the simulation
_GRAVITY_MPS2, _GRAVITY_TOLERANCE_MPS2 = 9.81, 0.5
_LEVEL_DEG = 5.0  # mounting and ground together
_RECEIVE_S = 5.0
_WINDOW_S = 6.0  # six messages of the slowest row
_START = "start the stack (robot-stack up --profile robot), then run this again"


def robot_checks() -> tuple[Callable[[], Iterable[Finding]], ...]:
    """In the order of the guide."""
    return (service_user, unit_files, engine, sensors, level, display, staff_pin, self_test, site_map, docks, zones)


# --- 1, 11: computer and service --------------------------------------------------------------------------------------


def service_user() -> Iterator[Finding]:
    """The service's user, and that it may open the devices of the profile."""
    from robot_stack.supervisor.profile import load_plan

    drivers = [process.name for process in load_plan(_PROFILE).processes]
    try:
        primary = pwd.getpwnam(_USER).pw_gid
    except KeyError:
        advice = "copy launch_scripts/robot-stack.sysusers to /etc/sysusers.d/robot-stack.conf, run systemd-sysusers"
        yield Finding("user", Level.BAD, f"there is no user {_USER}, as which the service runs", advice)
        return
    members = {group.gr_name for group in grp.getgrall() if _USER in group.gr_mem or group.gr_gid == primary}
    yield from group_findings(drivers, members)


def group_findings(drivers: Sequence[str], members: set[str]) -> Iterator[Finding]:
    """members: the groups of the service's user."""
    for group in sorted({_GROUPS[driver] for driver in drivers if driver in _GROUPS}):
        users = ", ".join(driver for driver in drivers if _GROUPS.get(driver) == group)
        if group in members:
            yield Finding("user", Level.OK, f"{_USER} is in the group {group}, for {users}")
        else:
            yield Finding("user", Level.BAD, f"{_USER} is not in the group {group}", f"usermod -aG {group} {_USER}")


def unit_files(etc: Path = ETC) -> Iterator[Finding]:
    for name, place in _INSTALLED.items():
        path = etc / place
        if not path.is_file():
            yield Finding("unit files", Level.BAD, f"{path} is not there", f"sudo cp launch_scripts/{name} {path}")
        elif path.read_bytes() != (_SHIPPED / name).read_bytes():
            advice = f"after an update: sudo cp launch_scripts/{name} {path}, sudo systemctl daemon-reload"
            yield Finding("unit files", Level.NOTE, f"{path} differs from launch_scripts/{name}", advice)
        else:
            yield Finding("unit files", Level.OK, f"{path}")


# --- 2, 4, 5: engine, axes, home --------------------------------------------------------------------------------------


def engine() -> Iterator[Finding]:
    """The motion engine as the running stack uses it: its parameters, the axes, the emergency-stop input."""
    from robot_stack.core.robot import load_robot
    from robot_stack.wmx import EngineError, connect
    from robot_stack.wmx.api import error_name
    from robot_stack.wmx.config import ENGINE_VARIABLE, STALE_VARIABLE, load_client_config
    from robot_stack.wmx.read_back import differences
    from robot_stack.wmx.robot_parameters import robot_parameters

    plan = running_plan()
    if plan is None or plan.name not in _SAME_PROFILES:
        yield not_checked("engine", plan)
        return
    robot = load_robot()
    client = load_client_config(plan.environment.get(ENGINE_VARIABLE))
    if STALE_VARIABLE in plan.environment:
        client = client.model_copy(update={"status_stale_s": float(plan.environment[STALE_VARIABLE])})
    absent = engine_absent(client)
    if absent is not None:
        yield absent
        return
    try:
        with connect("doctor", client, timeout_s=0.0) as device:
            code, snapshot = device.read_status()
            names = {axis.number: name for name, axis in robot.axes.items()}
            different = list(differences(device, robot_parameters(robot), names))
    except EngineError as error:
        yield Finding("engine", Level.BAD, str(error), "see the log of swerve_hardware_interface; docs/wmx_vendor.md")
        return
    if code:
        yield Finding("engine", Level.BAD, f"status: {error_name(code)} (error {code})", "start the engine again")
        return
    for text in different:
        yield Finding("axes", Level.BAD, text, "correct config/robot.yaml or the drive, start the stack again")
    if not different:
        yield Finding("axes", Level.OK, f"{len(names)} axes have the parameters of config/robot.yaml")
    yield from axis_findings(snapshot, robot)


def engine_absent(client: ClientConfig) -> Finding | None:
    """Reads the status page, because a new device may start an engine. None if one runs, or has no page."""
    from robot_stack.wmx.api import EngineState, error_name
    from robot_stack.wmx.simulated.channel import StatusView
    from robot_stack.wmx.simulated.client import engine_folder

    if client.engine == "vendor" and not client.bridged:
        return None
    code, snapshot = StatusView(engine_folder(client.device_path), client.status_stale_s).read()
    if not code and snapshot.engine_state not in (EngineState.Idle, EngineState.Unknown):
        return None
    what = f"status: {error_name(code)} (error {code})" if code else "it does not run"
    return Finding("engine", Level.BAD, what, "see the log of swerve_hardware_interface; docs/wmx_vendor.md")


def axis_findings(snapshot: StatusSnapshot, robot: Robot) -> Iterator[Finding]:
    from robot_stack.contract.frames import JOINTS, STEER_AXES
    from robot_stack.wmx.axes import Flag

    if not snapshot.communicating:
        yield Finding("engine", Level.BAD, "it does not communicate with the drives", "power, cables, docs/wmx.md")
        return
    alarms = [
        f"{name} 0x{int(snapshot.amp_alarm_code[axis.number]):04X}"
        for name, axis in robot.axes.items()
        if snapshot.amp_alarm[axis.number]
    ]
    if alarms:
        yield Finding("axes", Level.BAD, f"alarm of {', '.join(alarms)}", "the drive's manual names the code")
    flags = {
        Flag.SERVO_OFFLINE: ("offline", "the drive's cable and power; docs/wmx.md"),
        Flag.FOLLOWING_ERROR_ALARM: ("following error", "brakes, load and gear of the axis; then clear its alarm"),
    }
    for flag, (what, advice) in flags.items():
        set_in = [name for name, axis in robot.axes.items() if snapshot.flags[flag, axis.number]]
        if set_in:
            yield Finding("axes", Level.BAD, f"{what}: {', '.join(set_in)}", advice)
    steering = [JOINTS[joint] for joint in STEER_AXES]
    lost = [name for name in steering if not snapshot.home_done[robot.axes[name].number]]
    if lost:
        yield Finding("home", Level.BAD, f"no home: {', '.join(lost)}", "align the wheels, robot-stack wmx home")
    else:
        yield Finding("home", Level.OK, "all steering axes have a home")
    byte, bit = robot.estop_input_byte, robot.estop_input_bit
    if snapshot.input_bit(byte, bit):
        yield Finding("hardware stop", Level.OK, f"input byte {byte} bit {bit} reports it released")
    else:
        advice = "release all buttons; else check the wire, and estop_input_byte and _bit in config/robot.yaml"
        yield Finding("hardware stop", Level.BAD, f"input byte {byte} bit {bit}: pressed, or not wired", advice)


# --- 6: sensors -------------------------------------------------------------------------------------------------------


def sensors() -> Iterator[Finding]:
    """The topics of every driver of the running profile, compared with the contract."""
    from robot_stack.contract import topics
    from robot_stack.supervisor.profile import load_plan
    from robot_stack.system_monitor.nodes.topic_meter import Meter
    from robot_stack.system_monitor.topic_check import judge_all, rows_of

    plan = running_plan()
    if plan is None or plan.name not in _SAME_PROFILES:
        yield not_checked("sensors", plan)
        return
    drivers = _drivers(plan)
    yield from driver_findings(_drivers(load_plan(plan.name)), drivers)
    of_profile = rows_of(plan.machine, plan.use_sim_time)
    rows = [row for row in of_profile if drivers & set(row.publishers) and row.rate_hz is not None]
    with Meter([*rows, *(row for row in of_profile if row is topics.CLOCK)]) as meter:
        meter.settle()
        meter.run(_WINDOW_S)
        found = judge_all(rows, meter.seen(), frozenset(drivers), TOLERANCE)
    for item in found:
        source = ", ".join(sorted(drivers & set(item.row.publishers)))
        if item.problems:
            advice = f"robot-stack status, and the log of {source}; docs/drivers.md"
            yield Finding("sensors", Level.BAD, f"{item.row.name}: {'; '.join(item.problems)}", advice)
        else:
            rate_hz = item.seen.traffic.rate_hz
            yield Finding("sensors", Level.OK, f"{item.row.name} from {source}, {rate_hz or 0.0:.1f} Hz")


def _drivers(plan: Plan) -> set[str]:
    return {process.name for process in plan.processes if str(process.module).startswith("robot_stack.drivers.")}


def driver_findings(wanted: set[str], running: set[str]) -> Iterator[Finding]:
    """Drivers of the profile that the running stack was started without."""
    for name in sorted(wanted - running):
        yield Finding("sensors", Level.BAD, f"{name} was not started", "start the whole profile")


def level() -> Iterator[Finding]:
    """The inertial unit's mounting, by gravity."""
    from robot_stack.contract import topics

    message = _received("inertial unit", topics.IMU)
    if isinstance(message, Finding):
        yield message
        return
    a = message.linear_acceleration
    yield level_finding(a.x, a.y, a.z)


def level_finding(x: float, y: float, z: float) -> Finding:
    """x, y, z: acceleration of a robot that stands on level ground, base_link, m/s2."""
    size = math.hypot(x, y, z)
    tilt_deg = math.degrees(math.atan2(math.hypot(x, y), z))
    what = f"gravity is {size:.2f} m/s2, {tilt_deg:.1f} deg from upright"
    if not abs(size - _GRAVITY_MPS2) <= _GRAVITY_TOLERANCE_MPS2:  # NaN is bad
        return Finding("inertial unit", Level.BAD, what, "the robot must stand; else the unit is defective")
    if not tilt_deg <= _LEVEL_DEG:
        advice = "the robot must stand on level ground; else correct rpy_deg of its driver, or the mount"
        return Finding("inertial unit", Level.BAD, what, advice)
    return Finding("inertial unit", Level.OK, what)


def display() -> Iterator[Finding]:
    from robot_stack.contract import topics

    message = _received("external display", topics.EHMI_STATUS)
    if isinstance(message, Finding):
        yield message
    elif not message.linked:
        yield Finding("external display", Level.BAD, "it does not answer", "power, cable, config/ehmi_bridge.yaml")
    elif message.firmware_fault:
        yield Finding("external display", Level.BAD, f"it reports {message.firmware_fault}", "docs/ehmi.md")
    else:
        yield Finding("external display", Level.OK, f"it shows state {message.acknowledged_state}")


# --- 7, 9, 10: screen, map, docks -------------------------------------------------------------------------------------


def staff_pin() -> Iterator[Finding]:
    from robot_stack.ui.params import TouchUiParams
    from robot_stack.ui.pin import verify_pin

    pin_hash = load(TouchUiParams, "touch_ui").access.pin_hash
    if not pin_hash:
        advice = "robot-stack pin, and enter the hash in config/touch_ui.yaml"
        yield Finding("staff PIN", Level.BAD, "none is set: staff cannot log in", advice)
    elif verify_pin(pin_hash, _PUBLIC_PIN):
        yield Finding("staff PIN", Level.BAD, "it is the one of the simulation, which is public", "robot-stack pin")
    else:
        yield Finding("staff PIN", Level.OK, "set")


def self_test() -> Iterator[Finding]:
    """The guided self test presses every stop, and a person confirms it: the newest one that passed."""
    from robot_stack.ui.nodes.self_test_file import SelfTestFile
    from robot_stack.ui.params import TouchUiParams
    from robot_stack.ui.self_test_record import failed, is_due

    memory, due_h = SelfTestFile().memory, load(TouchUiParams, "touch_ui").self_test.due_h
    advice = "run it on the page self test of the touch screen; it tests every stop button"
    if failed(memory):
        assert memory.last is not None
        yield Finding("self test", Level.BAD, f"the last one failed, {memory.last.at}, step {memory.last.step}", advice)
    elif memory.passed is None:
        yield Finding("self test", Level.BAD, "none has passed: no stop button is tested", advice)
    elif is_due(memory, datetime.now().timestamp(), due_h):
        yield Finding("self test", Level.NOTE, f"due: the last one passed at {memory.passed.at}", advice)
    else:
        yield Finding("self test", Level.OK, f"passed at {memory.passed.at}, {memory.passed.who}")


def site_map() -> Iterator[Finding]:
    """The map, and that all nodes with a map use the same one."""
    from robot_stack.core.config import chosen_site, config_dir, read_yaml

    if site := chosen_site():
        yield from map_findings({"site": site})
        return
    used = {
        node: str(read_yaml(config_dir() / f"{node}.yaml").get("map", ""))
        for node in ("ndt_localization", "navigation_controller", "mission_manager", "black_box")
    }
    used["touch_ui"] = str(read_yaml(config_dir() / "touch_ui.yaml")["pages"]["map"])
    yield from map_findings(used)


def map_findings(used: Mapping[str, str]) -> Iterator[Finding]:
    """used: the name of the map, empty for none, by node."""
    from robot_stack.core.site_map import map_checksum

    if len(set(used.values())) > 1:
        names = ", ".join(f"{node}: {name or 'none'}" for node, name in used.items())
        yield Finding("map", Level.BAD, f"the nodes use different maps: {names}", "enter the same in all of config/")
    for name in sorted(set(used.values())):
        if not name:
            advice = "robot-stack map teach; without a map the pose drifts with the wheels"
            yield Finding("map", Level.BAD, "no map is chosen", advice)
            continue
        try:
            yield Finding("map", Level.OK, f"{name}, {map_checksum(name)[:12]}")
        except ConfigError as error:
            yield Finding("map", Level.BAD, str(error), "robot-stack map teach, map check; docs/mapping.md")


def docks() -> Iterator[Finding]:
    from robot_stack.core.docks import load_docks

    try:
        found = load_docks().docks
    except ConfigError as error:
        yield Finding("docks", Level.BAD, str(error), "correct config/docks.yaml")
        return
    if found:
        yield Finding("docks", Level.OK, ", ".join(f"{name} ({dock.kind})" for name, dock in found.items()))
    else:
        yield Finding("docks", Level.BAD, "none", "measure the boards, enter them in config/docks.yaml")


def zones() -> Iterator[Finding]:
    """The files of zones and lanes, and docks, safe places and missions, compared with the keepout zones of
    navigation's map.
    """
    from robot_stack.core.config import chosen_site, config_dir, read_yaml
    from robot_stack.core.docks import DocksFile
    from robot_stack.core.keepout import keepout_problems, load_keepout, site_keepout_problems
    from robot_stack.core.mission import aboard_at_start
    from robot_stack.core.mission_library import MissionError, mission_library
    from robot_stack.core.robot import load_robot
    from robot_stack.core.route_graph import graph_files, load_graph
    from robot_stack.core.safe_places import SafePlaces
    from robot_stack.core.zones import zone_files

    try:
        map_name = chosen_site() or str(read_yaml(config_dir() / "navigation_controller.yaml").get("map", ""))
        if map_name:
            yield _edited_file("zone file", zone_files(map_name))
            yield _edited_file("lane file", graph_files(map_name))
            load_graph(map_name)
        robot, docks_file = load_robot(), load(DocksFile, "docks")
        keepout = load_keepout(map_name, robot)
        places = load(SafePlaces, "safe_places")
        found = [f"{where}: {text}" for where, text in site_keepout_problems(docks_file, places, keepout, robot)]
    except ConfigError as error:
        yield Finding("zones", Level.BAD, str(error), "docs/navigation.md#zones")
        return
    kinds, library = {name: dock.kind for name, dock in docks_file.docks.items()}, mission_library()
    for mission_id in library.ids():
        try:
            mission = library.find(mission_id)
        except MissionError as error:
            found.append(str(error))
            continue
        found += [text for _, text in keepout_problems(mission, kinds, keepout, aboard_at_start(mission, False))]
    for text in found:
        yield Finding("zones", Level.BAD, text, "move the place, or correct the zones; docs/navigation.md#zones")
    if not found:
        count = len(keepout.zones)
        yield Finding("zones", Level.OK, f"{count} keepout zones, no dock, safe place or mission lies in one")


def _edited_file(check: str, files: SiteFile) -> Finding:
    """The file in force, and whether the touch screen can save it."""
    path = files.in_force
    if path == files.own:
        text = f"{path}, edited on this robot, instead of {files.site}"
    else:
        text = f"{path}{'' if path.exists() else ' (none)'}"
    folder = files.own.parent
    while not os.path.exists(folder):
        folder = folder.parent
    if not os.access(folder, os.W_OK):
        advice = "for zones and lanes drawn on the touch screen; run as the service's user, with its XDG_DATA_HOME"
        return Finding(check, Level.BAD, f"{text}; {files.own} cannot be written", advice)
    return Finding(check, Level.OK, f"{text}; edits are saved in {files.own}")


# --- the running stack ------------------------------------------------------------------------------------------------


def not_checked(check: str, plan: Plan | None) -> Finding:
    """plan: what runs, not a robot's; None: nothing that this user can ask."""
    from robot_stack.core.runtime import runtime_dir

    if plan is not None:
        advice = f"stop it, start profile {_PROFILE}, then run this again"
        return Finding(check, Level.BAD, f"not checked: profile {plan.name} runs", advice)
    if SERVICE_FOLDER.is_dir() and runtime_dir().resolve() != SERVICE_FOLDER.resolve():
        advice = (
            f"run this as {_USER} with the environment of robot-stack.service: ROBOT_STACK_RUNTIME_DIR={SERVICE_FOLDER}"
        )
        return Finding(
            check, Level.BAD, "not checked: the service runs, with another runtime folder than this command", advice
        )
    return Finding(check, Level.NOTE, "not checked: the stack does not run", _START)


def _received(check: str, row: Any) -> Any:
    """A message of the running robot, or the finding that there is none."""
    from robot_stack.cli.nodes.operator import Operator

    plan = running_plan()
    if plan is None or plan.name not in _SAME_PROFILES:
        return not_checked(check, plan)
    with Operator() as operator:
        message = operator.receive(row, _RECEIVE_S)
    if message is not None:
        return message
    advice = "robot-stack status, and the log of its driver"
    return Finding(check, Level.BAD, f"no {row.name} in {_RECEIVE_S:.0f} s", advice)
