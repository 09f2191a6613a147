"""A ride to look at: ``python -m sim.demo`` starts the stack in the simulation, sends a mission and tells how it goes.

Ends with one line of result, the paths of its plots, and exit code 0 if the robot arrived.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from robot_stack.core.config import ConfigError, config_dir
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from robot_stack.mission.library import MissionError, MissionLibrary
from robot_stack.mission.model import Kind, Mission
from robot_stack.supervisor import client
from robot_stack.supervisor.control import NotRunning
from sim.ride import Carriage, Figures, Ride, carriage, figures
from sim.settings import WORLDLY, own_map, pose_settings, world_settings
from sim.worldfile import load_world

_READY_S = 60.0
_SILENCE_S = 5.0
_TELL_EVERY_S = 2.0
_TELL_AT_REST_EVERY_S = 10.0
_REDRAW_EVERY_S = 0.2
_MOVING_MPS = 0.05
_PATIENCE_S = 60.0  # for somebody who resets an emergency stop and resumes the mission in another terminal
_SETTLE_S = 30.0
_OVERCOME = 20
_DELAYS = frozenset({"JOINT_STATES_TIMEOUT", "DRIVE_FAULT"})
_OVER = ("COMPLETED", "FAILED", "ABORTED", "IDLE")


class DemoError(Exception):
    """The ride did not come about. The message says why."""


def main() -> int:
    options = _options()
    # SIGTERM ends the demo as Ctrl-C does, with the stack stopped, also where a shell has SIGINT ignored.
    signal.signal(signal.SIGTERM, _interrupt)
    signal.signal(signal.SIGINT, _interrupt)
    try:
        mission = MissionLibrary(config_dir() / "missions").find(options.mission)
        load_world(options.world)
        client.refuse_second()
        folder = _folder(options.output)
        return _ride(options, mission, folder)
    except (DemoError, MissionError, ConfigError, client.StartError, TimeoutError, OSError) as error:
        print(f"\ndemo: {error}", file=sys.stderr)
        return 1
    except (KeyboardInterrupt, RuntimeError):
        if not _interrupted:
            raise
        print("\ndemo: interrupted; the stack is stopped", file=sys.stderr)
        return 130


_interrupted = False


def _interrupt(*_: object) -> None:
    """An interrupt inside the middleware comes out as a RuntimeError: so it is noted as well."""
    global _interrupted
    _interrupted = True
    raise KeyboardInterrupt


def _ride(options: argparse.Namespace, mission: Mission, folder: Path) -> int:
    print(f"starting the stack in the world {options.world} ...", flush=True)
    launch = client.Launch("sim", _settings(options, folder), speed=options.speed, log_dir=folder / "logs")
    try:
        status = client.start(launch, _READY_S)
        print(f"{len(status['processes'])} processes are ready after {status['ready_after_s']:.1f} s", flush=True)
        ride, outcome, delays = _drive(mission)
    finally:
        _stop()
    if delays:
        print(f"the safety monitor stopped the robot {delays} times because this machine was too slow")
    return _report(options, mission, folder, ride, outcome)


def _settings(options: argparse.Namespace, folder: Path) -> list[str]:
    start = load_world(options.world).start.pose()
    off_m, off_rad = options.start_error_m, math.radians(options.start_error_deg)
    believed = Pose2(start.x + 0.8 * off_m, start.y - 0.6 * off_m, start.yaw + off_rad)
    return [
        *world_settings(options.world),
        *(f"{node}.seed={options.seed}" for node in WORLDLY),
        # Without a map nobody can find out that the robot stands elsewhere.
        *pose_settings("ndt_localization.start", believed if own_map(options.world) else start),
        # Files of its own: this ride neither meets nor leaves an unfinished mission, nor what another robot learnt.
        f"mission_manager.journal_file={folder / 'mission.db'}",
        f"docking_controller.corrections_file={folder / 'docking_corrections.yaml'}",
    ]


def _drive(mission: Mission) -> tuple[Ride, Any, int]:
    """The ride, the mission's last status, and how often a busy machine made the safety monitor stop the robot."""
    from sim.nodes.rider import Rider

    with Rider() as rider:
        rider.board()
        delays = _Delays(rider)
        delays.settle()
        print(f"START_MISSION {mission.id}: {mission.name_in('en')}, {len(mission.waypoints)} waypoints", flush=True)
        try:
            rider.start(mission.id)
        except ValueError as error:
            raise DemoError(f"the mission was refused: {error}") from error
        display = Display(sys.stdout)
        progress_s = rider.now_s()
        while rider.mission is None or rider.mission.state not in _OVER:
            rider.wait(lambda: False, _REDRAW_EVERY_S)
            display.show(rider)
            now_s, last = rider.now_s(), rider.ride.samples[-1]
            if now_s - rider.heard_s > _SILENCE_S:
                raise DemoError("the world has fallen silent")
            if last.speed_mps > _MOVING_MPS or rider.docking_now() or delays.overcome():
                progress_s = now_s
            if now_s - progress_s > _PATIENCE_S:
                raise DemoError(f"no progress for {_PATIENCE_S:.0f} s: {describe(rider)}")
        rider.wait(lambda: False, 0.5)  # the last centimetres
        display.end()
        return rider.ride, rider.mission, delays.count


class _Delays:
    """A machine that is too busy misses deadlines of the safety monitor, which stops the robot and latches.

    The demo then acts as the operator: it resets and resumes, a few times, and says so. A stop that somebody asked for
    (``robot-stack estop``) is left to whoever asked.
    """

    def __init__(self, rider: Any) -> None:
        self._rider = rider
        self.count = 0

    def settle(self) -> None:
        """Waits until nothing stops the robot. Raises DemoError if that does not come about."""
        if not self._rider.wait(self._released, _SETTLE_S):
            raise DemoError(f"the robot may not move: {', '.join(self._rider.safety.active_faults)}")

    def _released(self) -> bool:
        if self._rider.safety.emergency_stop_active:
            self._reset()
            return False
        return bool(self._rider.safety.safety_state == "NORMAL")

    def overcome(self) -> bool:
        """Resets and resumes after a stop by delay. True if it did."""
        safety = self._rider.safety
        faults = set(safety.active_faults)
        asked_for = "ESTOP_PRESSED" in faults  # by whatever: nobody but whoever asked may release it
        if not safety.emergency_stop_active or asked_for or not faults & _DELAYS or self.count >= _OVERCOME:
            return False
        self.count += 1
        print(f"\nthis machine was too slow ({', '.join(safety.active_faults)}): reset and resume", flush=True)
        self.settle()
        self._rider.resume()
        return True

    def _reset(self) -> None:
        from robot_stack.cli.nodes.wishes import reset

        granted, reason = reset(_READY_S)
        if not granted:
            print(f"  not released yet: {reason}", flush=True)
            self._rider.wait(lambda: False, 1.0)
        self._rider.wait(lambda: not self._rider.safety.emergency_stop_active, 1.0)


class Display:
    """Where the robot is, on one line that is drawn again on a terminal, else now and then on a new one."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._live = out.isatty()
        self._told_s = 0.0
        self._text = ""

    def show(self, rider: Any) -> None:
        text = describe(rider)
        moving = rider.ride.samples[-1].speed_mps > _MOVING_MPS
        if self._live:
            self._out.write(f"\r{text:<{len(self._text)}}")
            self._text = text
        elif time.monotonic() - self._told_s >= (_TELL_EVERY_S if moving else _TELL_AT_REST_EVERY_S):
            self._told_s = time.monotonic()
            self._out.write(text + "\n")
        self._out.flush()

    def end(self) -> None:
        if self._live:
            self._out.write("\n")


def describe(rider: Any) -> str:
    """One line: time, waypoint, distance, speed, safety."""
    mission, safety, last = rider.mission, rider.safety, rider.ride.samples[-1]
    docking = rider.docking.state if rider.docking is not None else "IDLE"
    doing = f"  {docking}" if docking not in ("IDLE", "DOCKED") else "  with passenger" if docking == "DOCKED" else ""
    state = safety.safety_state + (f" ({', '.join(safety.active_faults)})" if safety.active_faults else "")
    advice = "; `robot-stack reset`, then `robot-stack mission resume`" if safety.emergency_stop_active else ""
    way = f"{mission.waypoints_completed}/{mission.total_waypoints} to {mission.current_waypoint or '-':<12}"
    motion = f"{rider.moved_m:6.1f} m  {last.speed_mps:4.2f} m/s"
    return f"{rider.now_s():5.0f} s  {mission.state:<8} {way} {motion}  {state}{doing}{advice}"


def _report(options: argparse.Namespace, mission: Mission, folder: Path, ride: Ride, outcome: Any) -> int:
    from sim.ride_plots import draw_course, draw_map

    goal = mission.waypoints[-1].pose
    found = figures(ride, goal)
    carried = carriage(ride, _dock_pose(mission), _destination(mission))
    waypoints: list[tuple[str, Pose2]] = [(item.name, item.pose) for item in mission.waypoints]
    draw_map(folder / "map.png", load_world(options.world), ride, waypoints)
    draw_course(folder / "course.png", ride)
    arrived = outcome.state == "COMPLETED"
    result = {"mission": mission.id, "world": options.world, "seed": options.seed, "state": outcome.state}
    result |= {"reason": outcome.reason, "figures": asdict(found), "wheelchair": carried and asdict(carried)}
    (folder / "figures.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    print(result_line(arrived, outcome.reason, found))
    print(estimate_line(found, ride.touched))
    if carried is not None and math.isfinite(carried.docked_mm):
        print(carriage_line(carried))
    for name in ("map.png", "course.png", "figures.json"):
        print(f"  {folder / name}")
    return 0 if arrived else 1


def result_line(arrived: bool, reason: str, found: Figures) -> str:
    """The ride in one line."""
    head = "reached the goal" if arrived else f"did NOT reach the goal ({reason or 'no reason given'})"
    return (
        f"{head}: {found.distance_m:.1f} m in {found.time_s:.1f} s, up to {found.top_speed_mps:.2f} m/s; "
        f"off the goal by {1e3 * found.final_error_m:.0f} mm and {found.final_error_deg:.1f} deg, "
        f"off the plan by {1e3 * found.tracking_rms_m:.0f} mm rms, {1e3 * found.tracking_max_m:.0f} mm at most"
    )


def estimate_line(found: Figures, touched: tuple[str, ...]) -> str:
    """What the robot believed, and what it touched."""
    return (
        f"believed pose off by {1e3 * found.estimate_rms_m:.0f} mm rms, {1e3 * found.estimate_p95_m:.0f} mm and "
        f"{found.estimate_p95_deg:.2f} deg p95; touched {', '.join(touched) or 'nothing'}"
    )


def carriage_line(carried: Carriage) -> str:
    """What became of the wheelchair, in one line."""
    return (
        f"wheelchair: docked to {carried.docked_mm:.1f} mm and {carried.docked_deg:.2f} deg before the latch closed, "
        f"carried {carried.carried_m:.1f} m, put down {1e3 * carried.beside_m:.0f} mm and {carried.beside_deg:.1f} deg "
        "beside its place"
    )


def _destination(mission: Mission) -> Pose2 | None:
    """Where the mission puts the wheelchair down, base_link in map."""
    return next((item.pose for item in mission.waypoints if item.action.kind is Kind.UNDOCK), None)


def _dock_pose(mission: Mission) -> Pose2:
    docks = load_docks().docks
    names = [item.action.dock_id for item in mission.waypoints if item.action.kind is Kind.DOCK]
    dock = docks[names[0]] if names else next(iter(docks.values()))
    return dock.dock_pose.pose()


def _stop() -> None:
    # A second Ctrl-C must not leave half a stack behind.
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        client.stop()
    except NotRunning:
        pass
    finally:
        signal.signal(signal.SIGINT, before)


def _folder(output: Path) -> Path:
    """A new folder for this ride, and ``latest`` that points to it."""
    folder = output / f"demo-{time.strftime('%Y%m%d-%H%M%S')}"
    folder.mkdir(parents=True)
    link = output / "demo-latest"
    link.unlink(missing_ok=True)
    link.symlink_to(folder.name)
    return folder.resolve()


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="demo", description="Starts the stack in the simulation and rides a mission.")
    parser.add_argument("--mission", default="site_transport", help="a mission of config/missions/")
    parser.add_argument("--world", default="yard", help="a world of config/worlds/")
    parser.add_argument("--seed", type=int, default=1, help="of the simulation's noise")
    parser.add_argument("--speed", type=float, default=None, help="of the world; below 1 on a slow machine")
    parser.add_argument("--start-error-m", type=float, default=1.0, help="how wrong the believed start is")
    parser.add_argument("--start-error-deg", type=float, default=10.0, help="how wrong its heading is")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder for plots and figures")
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
