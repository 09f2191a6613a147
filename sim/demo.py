"""A ride to look at: ``python -m sim.demo`` starts the stack in the simulation, sends a mission, reports progress.

Ends with one line of result, the paths of its plots, and exit code 0 if the robot arrived. The state of its stack
(latched stop, journal, corrections, missions) lies in the folder of the results: no earlier run stops a demo, and a
demo leaves nothing that stops a later stack.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import shutil
import signal
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from robot_stack.contract.model import SafetyState
from robot_stack.contract.states import ENDED, MissionState
from robot_stack.core.config import ConfigError
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from robot_stack.core.mission import Kind, Mission
from robot_stack.core.mission_library import MissionError, MissionLibrary, mission_library
from robot_stack.core.runtime import (
    environment_with_home,
    own_missions_dir,
    runtime_dir,
    state_shadow_dir,
    touch_screen_url,
)
from robot_stack.supervisor import client, progress
from robot_stack.supervisor.control import NotRunning
from robot_stack.supervisor.profile import WORLD_NODES
from sim.devices import v4l2
from sim.devices.udp import free_port
from sim.run.demo_display import MOVING_MPS, Display, describe
from sim.run.demo_recording import Recording, film_of
from sim.run.result_page import Result, result_page
from sim.run.ride import Carriage, Figures, Ride, arrivals, carriage, figures, stops
from sim.settings import (
    DEMO_MISSION,
    SHORT_MISSION,
    SHORT_START,
    START_ERROR_DEG,
    START_ERROR_M,
    own_map,
    pose_settings,
    wire_settings,
    world_settings,
    wrong_start,
)
from sim.worldfile import load_world

_READY_S = 60.0
_SILENCE_S = 5.0
_REDRAW_EVERY_S = 0.2
_PATIENCE_S = 60.0  # of the world's time without progress
_SETTLE_S = 30.0
_STOP_S = 2.0  # standing for this long counts as a stop
_RECORDING_S = 15.0  # a ride without a recording is better than none
_OVER = ENDED | {MissionState.IDLE}


class DemoError(Exception):
    """The ride did not come about. The message says why, and what to do."""


def main() -> int:
    options = _options()
    # SIGTERM ends the demo like Ctrl-C, with the stack stopped, also if a shell ignores SIGINT.
    signal.signal(signal.SIGTERM, _interrupt)
    signal.signal(signal.SIGINT, _interrupt)
    folder: Path | None = None
    try:
        load_world(options.world)
        library = _library(options.mission)
        mission = library.find(options.mission)
        _refuse_second()
        folder = _folder(options.output)
        _bring_missions(library, folder)
        return _ride(options, mission, folder)
    except (DemoError, MissionError, ConfigError, client.StartError, TimeoutError, OSError) as error:
        print(f"\ndemo: {error}", file=sys.stderr)
        if folder is not None:
            print(_evidence(folder), file=sys.stderr)
        return 1
    except (KeyboardInterrupt, RuntimeError):
        if not _interrupted:
            raise
        print("\ndemo: interrupted; the stack is stopped", file=sys.stderr)
        return 130


_interrupted = False


def _interrupt(*_: object) -> None:
    """Records an interrupt: inside the middleware it is raised as a RuntimeError."""
    global _interrupted
    _interrupted = True
    raise KeyboardInterrupt


def _library(mission_id: str) -> MissionLibrary:
    """The missions that come with the software; those made on this computer only if the mission is one of them.

    A mission that was saved here under a shipped mission's id stops `up`, but not a demo.
    """
    library = mission_library()
    shipped = MissionLibrary(*library.folders[:1])
    return shipped if mission_id in shipped.ids() else library


def _bring_missions(library: MissionLibrary, folder: Path) -> None:
    """Copies missions that were made on this computer to where the demo's stack looks for them."""
    for own in library.folders[1:]:
        if own.is_dir():
            shutil.copytree(own, own_missions_dir(environment_with_home(folder)))


def _refuse_second() -> None:
    """Raises DemoError if a stack runs in this ROS domain: two robots would answer each other."""
    try:
        client.refuse_second()
    except client.StartError as error:
        raise DemoError(
            f"not started: {error}. To end that stack: `launch_scripts/stack down`, then run this command again. "
            "To leave it running: `ROS_DOMAIN_ID=N launch_scripts/demo` with another number N in 1..101"
        ) from error


def _evidence(folder: Path) -> str:
    """Sources for the analysis of a failure, one line each."""
    recording = folder / "recording"
    recorded = any(recording.glob("*.mcap"))
    lines = [f"  recording: {recording if recorded else 'none, the ride did not begin'}"]
    if recorded:
        lines.append(f"  look at it: `.venv/bin/robot-stack film {recording}`, or open its .mcap file in Foxglove")
    if (folder / "logs").is_dir():
        lines.append(f"  logs of the processes: {folder / 'logs' / 'latest'}")
    lines.append("  run it again: this run leaves no state outside the folder above")
    return "\n".join(lines)


def _ride(options: argparse.Namespace, mission: Mission, folder: Path) -> int:
    print(f"starting the stack in the world {options.world} ...", flush=True)
    recording: Recording | None = None
    profile, settings = "sim", _settings(options)
    if options.devices:
        profile, settings = "robot_simulated", [*settings, *wire_settings(free_port())]
        os.environ.update(v4l2.environment(v4l2.build_library(folder), runtime_dir() / "cameras"))
    launch = client.Launch(profile, settings, speed=options.speed, log_dir=folder / "logs", home=folder)
    try:
        with progress.shown() as show:
            status = client.start(launch, _READY_S, show)
        print(f"{len(status['processes'])} processes are ready after {status['ready_after_s']:.1f} s", flush=True)
        recording = Recording(folder)
        print(f"follow and drive it from the touch screen: {touch_screen_url()}   (staff PIN 2468)", flush=True)
        ride, outcome = _drive(mission, recording)
    finally:
        _stop(recording)
        shutil.rmtree(state_shadow_dir(launch.environment()), ignore_errors=True)
    return _report(options, mission, folder, ride, outcome)


def _settings(options: argparse.Namespace) -> list[str]:
    start = options.start or load_world(options.world).start.pose()
    estimated = wrong_start(start, options.start_error_m, options.start_error_deg)
    return [
        *world_settings(options.world),
        *(pose_settings("sim_world.start", start) if options.start else []),
        *(f"{node}.seed={options.seed}" for node in WORLD_NODES),
        # Without a map localization cannot correct a wrong start.
        *pose_settings("ndt_localization.start", estimated if own_map(options.world) else start),
    ]


def _drive(mission: Mission, recording: Recording) -> tuple[Ride, Any]:
    """The ride, and the mission's last status."""
    from sim.nodes.mission_observer import MissionObserver

    with MissionObserver() as observer:
        observer.board()
        _settle(observer)
        observer.wait(recording.under_way, _RECORDING_S)
        print(f"START_MISSION {mission.id}: {mission.name_in('en')}, {len(mission.waypoints)} waypoints", flush=True)
        try:
            observer.start(mission.id)
        except ValueError as error:
            raise DemoError(f"the mission was refused: {error}") from error
        display = Display(sys.stdout)
        try:
            _follow(observer, display)
        finally:
            display.end()
        observer.wait(lambda: False, 0.5)  # the last centimetres
        return observer.ride, observer.mission


def _follow(observer: Any, display: Display) -> None:
    """Shows the ride until the mission is over. Raises DemoError if it does not get on."""
    progress_s, waited_s = observer.world_s, -math.inf
    while observer.mission is None or observer.mission.state not in _OVER:
        observer.wait(lambda: False, _REDRAW_EVERY_S)
        display.show(observer)
        if observer.waiting_for:
            waited_s = time.monotonic()
        if observer.now_s() - observer.received_s > _SILENCE_S and time.monotonic() - waited_s > _SILENCE_S:
            raise DemoError(f"no message from the simulated world for {_SILENCE_S:.0f} s: see sim_world.log below")
        if observer.ride.samples[-1].speed_mps > MOVING_MPS or observer.docking_now():
            progress_s = observer.world_s
        if observer.world_s - progress_s > _PATIENCE_S:
            raise DemoError(
                f"the robot has not moved for {_PATIENCE_S:.0f} s of the world's time: {describe(observer)}; "
                "the recording below shows what stopped it"
            )


def _settle(observer: Any) -> None:
    """Waits until nothing stops the robot. Raises DemoError on a timeout."""
    begun_s = observer.world_s
    while not observer.may_move():
        observer.wait(observer.may_move, 1.0)
        if observer.world_s - begun_s > _SETTLE_S or observer.safety.safety_state == SafetyState.EMERGENCY_STOP.name:
            faults = ", ".join(observer.safety.active_faults) or "no fault is shown"
            raise DemoError(
                f"the robot may not move before the mission starts: {observer.safety.safety_state} ({faults}); "
                "docs/safety.md says what raises each fault, the logs below what happened in this run"
            )


def _report(options: argparse.Namespace, mission: Mission, folder: Path, ride: Ride, outcome: Any) -> int:
    found, carried = evaluate(mission, ride)
    result = Result(
        mission=mission.name_in("en"),
        world=options.world,
        seed=options.seed,
        state=outcome.state,
        reason=outcome.reason,
        figures=found,
        carried=carried,
        arrivals=arrivals(ride.steps),
        stops=stops(ride, MOVING_MPS, _STOP_S),
        touched=ride.touched,
    )
    _plot(options.world, mission, folder, ride, result)
    arrived = outcome.state == MissionState.COMPLETED
    print(result_line(arrived, outcome.reason, result.figures))
    if not arrived:
        print(_evidence(folder))
    print(estimate_line(result.figures, ride.touched))
    if carried is not None and math.isfinite(carried.docked_mm):
        print(carriage_line(carried))
    print("drawing the film ...", flush=True)
    missing = film_of(folder / "recording", folder / "film.gif", own_map(options.world))
    page = folder / "result.html"
    page.write_text(result_page(result, "" if missing else "film.gif"), encoding="utf-8")
    print("results:")
    for name in ("map.png", "course.png", "figures.json", "recording", *(() if missing else ("film.gif",))):
        print(f"  {folder / name}")
    if missing:
        print(f"  no film: {missing}")
    print(f"all of it on one page: {page.as_uri()}")
    return 0 if arrived else 1


def evaluate(mission: Mission, ride: Ride) -> tuple[Figures, Carriage | None]:
    """The figures of a ride of ``mission``, and of its wheelchair, if there is one."""
    return figures(ride, mission.waypoints[-1].pose), carriage(ride, _dock_pose(mission), _destination(mission))


def _plot(world: str, mission: Mission, folder: Path, ride: Ride, result: Result) -> None:
    """The plots, and the figures as JSON."""
    from sim.pictures.ride_plots import draw_course, draw_map

    waypoints: list[tuple[str, Pose2]] = [(item.name, item.pose) for item in mission.waypoints]
    draw_map(folder / "map.png", load_world(world), ride, waypoints, result.stops)
    draw_course(folder / "course.png", ride)
    figures = {
        "mission": mission.id,
        "world": world,
        "seed": result.seed,
        "state": result.state,
        "reason": result.reason,
    }
    figures |= {"figures": asdict(result.figures), "wheelchair": result.carried and asdict(result.carried)}
    figures |= {"stops": [asdict(stop) for stop in result.stops]}
    (folder / "figures.json").write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


def result_line(arrived: bool, reason: str, found: Figures) -> str:
    """The ride in one line."""
    head = "reached the goal" if arrived else f"did NOT reach the goal ({reason or 'no reason given'})"
    return (
        f"{head}: {found.distance_m:.1f} m in {found.time_s:.1f} s, up to {found.top_speed_mps:.2f} m/s; "
        f"off the goal by {1e3 * found.final_error_m:.0f} mm and {found.final_error_deg:.1f} deg, "
        f"off the plan by {1e3 * found.tracking_rms_m:.0f} mm rms, {1e3 * found.tracking_max_m:.0f} mm at most"
    )


def estimate_line(found: Figures, touched: tuple[str, ...]) -> str:
    """The error of the robot's estimate, and its contacts."""
    return (
        f"estimated pose off by {1e3 * found.estimate_rms_m:.0f} mm rms, {1e3 * found.estimate_p95_m:.0f} mm and "
        f"{found.estimate_p95_deg:.2f} deg p95; touched {', '.join(touched) or 'nothing'}"
    )


def carriage_line(carried: Carriage) -> str:
    """The result of the wheelchair's transport, in one line."""
    return (
        f"wheelchair: docked to {carried.docked_mm:.1f} mm and {carried.docked_deg:.2f} deg before the latch closed, "
        f"carried {carried.carried_m:.1f} m, put down {1e3 * carried.beside_m:.0f} mm and {carried.beside_deg:.1f} deg "
        "beside its place"
    )


def _destination(mission: Mission) -> Pose2 | None:
    """Destination of the wheelchair in the mission, base_link in map."""
    return next((item.pose for item in mission.waypoints if item.action.kind is Kind.UNDOCK), None)


def _dock_pose(mission: Mission) -> Pose2:
    docks = load_docks().docks
    names = [item.action.dock_id for item in mission.waypoints if item.action.kind is Kind.DOCK]
    dock = docks[names[0]] if names else next(iter(docks.values()))
    return dock.dock_pose.pose()


def _stop(recording: Recording | None) -> None:
    # A second Ctrl-C must not leave processes of the stack behind.
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        if recording is not None:
            recording.finish()
        client.stop()
    except NotRunning:
        pass
    finally:
        signal.signal(signal.SIGINT, before)


def _folder(output: Path) -> Path:
    """A new folder for this ride, and ``latest`` that points to it."""
    folder = output / f"demo-{time.strftime('%Y%m%d-%H%M%S')}"
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise DemoError(f"the folder for the results cannot be made: {error}; choose another with --output") from error
    link = output / "demo-latest"
    with contextlib.suppress(OSError):  # a convenience; another user's demo may have made the link
        link.unlink(missing_ok=True)
        link.symlink_to(folder.name)
    return folder.resolve()


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="demo", description="Starts the stack in the simulation and rides a mission.")
    parser.add_argument("--mission", default=DEMO_MISSION, help="a mission of config/missions/")
    parser.add_argument("--world", default="yard", help="a world of config/worlds/")
    parser.add_argument("--seed", type=int, default=1, help="of the simulation's noise")
    parser.add_argument("--speed", type=float, default=None, help="maximum speed of the world relative to real time")
    parser.add_argument("--start-error-m", type=float, default=START_ERROR_M, help="position error of the start pose")
    parser.add_argument("--start-error-deg", type=float, default=START_ERROR_DEG, help="yaw error of the start pose")
    parser.add_argument("--output", type=Path, default=Path("results"), help="folder for plots and figures")
    parser.add_argument("--short", action="store_true", help="the wheelchair's transport alone, in about a minute")
    parser.add_argument(
        "--devices", action="store_true", help="the robot's own drivers, on devices simulated byte by byte"
    )
    parser.set_defaults(start=None)
    if parser.parse_known_args()[0].short:
        parser.set_defaults(mission=SHORT_MISSION, start=SHORT_START, start_error_m=0.0, start_error_deg=0.0)
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
