"""The checks of ``robot-stack doctor``. Each check returns findings; none of them changes anything."""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import psutil

from robot_stack.core.config import ConfigError, config_dir
from robot_stack.core.cxx import cxx_compiler
from robot_stack.core.runtime import ros_domain_id, runtime_dir

_GIB = 2**30
_MIB = 2**20
# Fast DDS holds a segment of this size for each process or tool that exchanges clouds or images (config/fastdds.xml).
_SEGMENT_BYTES = 36 * _MIB
_PROCESSES = 12
_SOCKET_BUFFER_BYTES = 2 * _MIB


class Level(Enum):
    OK = "ok"
    NOTE = "note"  # works, but not as well as it could
    BAD = "bad"  # does not work


@dataclass(frozen=True, slots=True)
class Finding:
    check: str
    level: Level
    what: str
    advice: str = ""


def examine(more: Iterable[Callable[[], Iterable[Finding]]] = ()) -> list[Finding]:
    """Runs all checks, and ``more``; a check that fails itself is a finding too."""
    findings: list[Finding] = []
    for check in (*CHECKS, *more):
        name = check.__name__
        try:
            findings += list(check())
        except Exception as error:
            findings.append(Finding(name, Level.BAD, f"the check failed: {error}", "report this"))
    return findings


def python() -> Iterable[Finding]:
    fit = (3, 11) <= sys.version_info[:2] < (3, 14)
    level = Level.OK if fit else Level.BAD
    advice = "" if fit else "use Python 3.11 to 3.13: PYTHON=/path/to/python launch_scripts/setup"
    yield Finding("python", level, f"{platform.python_version()} in {sys.prefix}", advice)


def compiler() -> Iterable[Finding]:
    found = cxx_compiler()
    if found:
        yield Finding("compiler", Level.OK, found)
    else:
        yield Finding("compiler", Level.NOTE, "no C++ compiler", "launch_scripts/setup needs one: apt install g++")


def cores() -> Iterable[Finding]:
    count = len(os.sched_getaffinity(0))
    advice = "" if count >= 2 else "provide two cores: stack and simulation together need more than one"
    yield Finding("cores", Level.OK if count >= 2 else Level.NOTE, f"{count} usable", advice)
    governor = Path("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor")
    if governor.is_file() and governor.read_text().strip() == "powersave":
        yield Finding("cpu governor", Level.NOTE, "powersave", "cpupower frequency-set -g performance")


def rights() -> Iterable[Finding]:
    from robot_stack.cli.rights import rights as asked_for
    from robot_stack.supervisor.params import load_params

    missing = [right for right in asked_for(load_params()) if not right.granted]
    for right in missing:
        advice = "sudo launch_scripts/grant_rights, then log in again; the simulation works without"
        yield Finding("rights", Level.NOTE, f"no {right.name}: {right.purpose}", advice)
    if not missing:
        yield Finding("rights", Level.OK, "real-time priority, nice values below 0, locked memory")


def memory() -> Iterable[Finding]:
    available = psutil.virtual_memory().available
    fit = available > 2 * _GIB
    advice = "" if fit else "the whole stack with simulation needs about 1.5 GB"
    yield Finding("memory", Level.OK if fit else Level.NOTE, f"{available / _GIB:.1f} GiB available", advice)


def shared_memory() -> Iterable[Finding]:
    needed = _SEGMENT_BYTES * _PROCESSES
    usage = shutil.disk_usage("/dev/shm")
    what = f"{usage.free / _MIB:.0f} MiB free of {usage.total / _MIB:.0f} in /dev/shm"
    if usage.free >= needed:
        yield Finding("shared memory", Level.OK, what)
    else:
        advice = f"needs {needed / _MIB:.0f} MiB: mount -o remount,size=2G /dev/shm; in a container --shm-size=2g"
        yield Finding("shared memory", Level.BAD, what, advice)


def domain() -> Iterable[Finding]:
    try:
        yield Finding("ROS domain", Level.OK, f"{ros_domain_id()}, runtime folder {runtime_dir()}")
    except ConfigError as error:
        yield Finding("ROS domain", Level.BAD, str(error), "set ROS_DOMAIN_ID or ROBOT_STACK_RUNTIME_DIR")


def clock() -> Iterable[Finding]:
    if time.time() < 1.7e9:  # November 2023: before this software existed
        yield Finding("clock", Level.BAD, time.strftime("%Y-%m-%d %H:%M"), "set the system clock, install chrony")
        return
    # adjtimex(2): 5 is TIME_ERROR, the clock is not synchronised. The structure has at most 208 bytes.
    state = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(512))
    if state == 5:
        yield Finding(
            "clock", Level.NOTE, "not synchronised", "recordings of two computers are not synchronised: install chrony"
        )
    else:
        yield Finding("clock", Level.OK, time.strftime("%Y-%m-%d %H:%M:%S %Z"))


def network() -> Iterable[Finding]:
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if reach in ("LOCALHOST", "OFF"):
        yield Finding("network", Level.OK, f"discovery range {reach}")
    else:
        advice = "unset ROS_AUTOMATIC_DISCOVERY_RANGE unless other computers participate"
        yield Finding(
            "network", Level.NOTE, f"discovery range {reach}: others on the network can move the robot", advice
        )


def socket_buffers() -> Iterable[Finding]:
    for name in ("rmem_max", "wmem_max"):
        path = Path(f"/proc/sys/net/core/{name}")
        if not path.is_file():
            continue
        size = int(path.read_text())
        if size < _SOCKET_BUFFER_BYTES:
            advice = f"for clouds to other computers: sysctl -w net.core.{name}={_SOCKET_BUFFER_BYTES}"
            yield Finding(f"net.core.{name}", Level.NOTE, f"{size / 1024:.0f} KiB", advice)
        else:
            yield Finding(f"net.core.{name}", Level.OK, f"{size / _MIB:.1f} MiB")


def disk() -> Iterable[Finding]:
    from robot_stack.supervisor.logs import default_log_dir

    folder = default_log_dir()
    while not folder.exists():
        folder = folder.parent
    if not os.access(folder, os.W_OK):
        yield Finding("disk", Level.BAD, f"{folder} cannot be written", "choose another: XDG_STATE_HOME, up --log-dir")
        return
    usage = shutil.disk_usage(folder)
    fit = usage.free > 5 * _GIB and usage.used / usage.total < 0.95
    advice = "" if fit else "recordings of a ride with clouds take 1.5 GB a minute: free some space"
    yield Finding("disk", Level.OK if fit else Level.NOTE, f"{usage.free / _GIB:.1f} GiB free at {folder}", advice)


def interfaces() -> Iterable[Finding]:
    from robot_stack.cli.interfaces import examine_interfaces

    missing, different, count = examine_interfaces()
    for type_name in missing:
        yield Finding("interfaces", Level.BAD, f"{type_name} is not installed", "launch_scripts/setup")
    for type_name in different:
        advice = "launch_scripts/setup builds it again"
        yield Finding("interfaces", Level.BAD, f"{type_name} is not built from its definition here", advice)
    if not missing and not different:
        yield Finding("interfaces", Level.OK, f"{count} types of the contract are installed and current")


def configuration() -> Iterable[Finding]:
    from robot_stack.cli.configuration import examine_configuration

    problems, count = examine_configuration()
    for problem in problems:
        yield Finding("configuration", Level.BAD, problem, "correct the file")
    if not problems:
        yield Finding("configuration", Level.OK, f"{count} files of {config_dir()} are valid")


def robot_devices() -> Iterable[Finding]:
    """Devices of the real robot; a computer that simulates it needs none of them."""
    from robot_stack.cli.devices import devices

    for device in devices():
        level = Level.OK if device.there else Level.NOTE
        yield Finding(f"device of {device.driver}", level, device.what, device.advice)


def leftovers() -> Iterable[Finding]:
    from robot_stack.supervisor import orphans
    from robot_stack.supervisor.control import NotRunning, ask

    try:
        status = ask("status")
        yield Finding("stack", Level.OK, f"running, profile {status['profile']}")
    except NotRunning:
        left = orphans.find()
        if left:
            ids = ", ".join(str(process.pid) for process in left)
            yield Finding("stack", Level.BAD, f"a killed supervisor left processes {ids}", "robot-stack down")
        else:
            yield Finding("stack", Level.OK, "not running")
    except TimeoutError:
        yield Finding("stack", Level.BAD, "its supervisor does not answer", "robot-stack down")


CHECKS: tuple[Callable[[], Iterable[Finding]], ...] = (
    python,
    compiler,
    cores,
    rights,
    memory,
    shared_memory,
    domain,
    clock,
    network,
    socket_buffers,
    disk,
    interfaces,
    configuration,
    robot_devices,
    leftovers,
)
