"""``robot-stack docking replay``: reads, evaluates, prints, draws."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from robot_stack.cli.errors import CommandError, writing
from robot_stack.cli.recordings import read_all, recording_files
from robot_stack.cli.tables import progress_bar
from robot_stack.contract import topics
from robot_stack.core.config import load
from robot_stack.core.docks import load_docks
from robot_stack.docking.params import DockingParams
from robot_stack.docking.tools.collector import TOPICS, Collector, Waits
from robot_stack.docking.tools.plots import course
from robot_stack.docking.tools.report import lines, numbers
from robot_stack.docking.tools.shots import strip
from robot_stack.docking.tools.trace import Trace
from robot_stack.docking.tools.verdict import Limits

_DPI = 120


def replay_recording(recording: Path, output: Path | None, json_file: Path | None) -> None:
    """Raises CommandError if there is no docking or no folder for the pictures."""
    params = load(DockingParams, "docking_controller")
    files = recording_files(recording)
    folder = output if output is not None else Path(f"docking_{recording.absolute().stem}")
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.touch()
        probe.unlink()
    traces, damages = collect(files, params)
    for damage in damages:
        print(f"warning: {damage}; the report ends there", file=sys.stderr)
    limits, docks = limits_of(params), load_docks()
    found = [numbers(trace, limits, docks) for trace in traces]
    for number, (trace, docking) in enumerate(zip(traces, found, strict=True), 1):
        docking["pictures"] = _draw(folder, number, trace, limits, docking["verdict"], docks.marker_size_m)
        print("\n".join(lines(number, docking, _date(trace.start_s))))
        print("  pictures: " + ", ".join(docking["pictures"]))
    if json_file is not None:
        document = {"recording": str(recording), "damages": damages, "dockings": found}
        with writing(json_file):
            json_file.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")


def collect(files: Sequence[Path], params: DockingParams) -> tuple[list[Trace], list[str]]:
    """(dockings, errors of files). Raises CommandError if there is no docking."""
    latch = params.latch
    # The controller closes the latch, waits for its contact, and then evaluates one more sighting of the board.
    collector = Collector(Waits(latch_s=latch.confirm_timeout_s + latch.learn_s + 1.0))
    damages = []
    with progress_bar("reading") as progress:
        for item in read_all(files, TOPICS, progress):
            if isinstance(item, str):
                damages.append(item)
            else:
                collector.feed(item.topic, item.at_s, item.decode)
    traces = collector.finish()
    if not traces:
        found = f"{collector.statuses} messages" if collector.statuses else "nothing"
        cut = f"; {damages[0]}" if damages else ""
        raise CommandError(f"there is no docking in the recording ({found} on {topics.DOCKING_STATUS.name}){cut}")
    return traces, damages


def limits_of(params: DockingParams) -> Limits:
    return Limits(
        aligned_m=params.servo.aligned_m,
        aligned_rad=params.servo.aligned_rad,
        lost_s=params.servo.hold_after_s,
        silent_s=topics.FRONT_IMAGE.stale_s or params.detections_timeout_s,
        jump_m=params.target.jump_m,
    )


def _draw(folder: Path, number: int, trace: Trace, limits: Limits, verdict: str, marker_size_m: float) -> list[str]:
    title = f"docking {number}, {_date(trace.start_s)}: {verdict}"
    figures = {f"docking_{number}.png": course(trace, limits, title)}
    images = strip(trace, marker_size_m)
    if images is not None:
        figures[f"docking_{number}_images.png"] = images
    for name, figure in figures.items():
        with writing(folder / name):
            figure.savefig(folder / name, dpi=_DPI)
    return [str(folder / name) for name in figures]


def _date(at_s: float) -> str:
    return time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(at_s))
