"""``robot-stack simulate``: a scenario on the deterministic scheduler, ``python -m sim.stack.simulate --help``."""

from __future__ import annotations

import argparse
import math
import shlex
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from robot_stack.core.config import ConfigError
from sim.plant.faults import FaultRefused
from sim.plant.world import SimulationDiverged
from sim.replay.stored import stored_configuration
from sim.run.scenario import Scenario
from sim.stack.campaign import planned_faults, shrunk
from sim.stack.choice import choose_scenario
from sim.stack.faults import plan_text
from sim.stack.moment import EVENT_LEAD_S, RecordedMoment, moment_in, parse_moment, read_moment
from sim.stack.progress import RunProgress
from sim.stack.result_folder import ResultFolder
from sim.stack.run import RunFailed, RunOptions, RunResult, ScheduledRun

EXIT_UNFULFILLED, EXIT_REFUSED, EXIT_INVARIANT, EXIT_INTERRUPTED = 1, 2, 3, 130
_HELP: Final = """\
Runs the whole stack with the simulated world in one process and in virtual time. The same seed gives the same run,
message by message: compare the digests. A breakpoint in a node stops the world.

SCENARIO is a YAML file, the name of one in config/scenarios/, mission:<id> for a mission from the start of its world,
demo for the ride of launch_scripts/demo, demo:short for that of launch_scripts/demo --short, or random for a ride drawn
from the seed. --from instead of it begins at a moment of a recording: the output lists what is as recorded, what not.

The results are in <output>/<scenario>-<time>: figures.json, plots, the effective scenario and configuration, log.txt
and nodes.log. Ctrl-C ends the run with its figures so far."""
_EPILOG: Final = """\
exit codes: 0 as expected; 1 an expectation is not fulfilled, a process failed, or the run could not be carried out;
2 wrong use or configuration; 3 an invariant was broken; 130 interrupted"""


@dataclass(frozen=True, slots=True)
class Job:
    """The run to carry out. faults: value of ``--faults``. argument: SCENARIO, or --from with its value, as given."""

    scenario: Scenario
    name: str
    argument: tuple[str, ...]
    options: RunOptions
    faults: str | None = None
    world: str | None = None

    def command(self) -> str:
        """The command that repeats the run."""
        until_s, options = self.options.until_s, self.options
        words = [
            *("robot-stack", "simulate", *self.argument, "--seed", str(self.scenario.seed)),
            *(("--world", self.world) if self.world else ()),
            *(("--faults", self.faults) if self.faults else ()),
            *(("--until", f"{until_s:g}") if math.isfinite(until_s) else ()),
            *(("--light",) if options.light else ()),
        ]
        return shlex.join(words)


@dataclass(slots=True)
class Outcome:
    """cut: ``--until`` or Ctrl-C ended the run before the scenario did. real_s: without the start of the stack."""

    result: RunResult
    cut: bool
    interrupted: bool
    ready_s: float
    real_s: float

    def problems(self, scenario: Scenario) -> list[str]:
        """Expectations that are not fulfilled; of a run that was cut, none is judged."""
        if self.cut:
            return []
        return [problem for item in scenario.expect if (problem := item.problem(self.result.figures)) is not None]


def main(arguments: Sequence[str] | None = None) -> int:
    try:
        chosen = read_options(arguments)
        with moment_of(chosen) as moment:
            job = make_job(chosen, moment)
            folder = ResultFolder(chosen.output, job.name)
            return _run(job, folder, plots=not chosen.no_plots, shrinks=chosen.shrink)
    except ConfigError as error:
        print(f"simulate: {error}", file=sys.stderr)
        return EXIT_REFUSED
    except KeyboardInterrupt:
        print("simulate: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED


def read_options(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="robot-stack simulate",
        description=_HELP,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "scenario", metavar="SCENARIO", nargs="?", help="a file, a name, mission:<id>, demo, demo:short or random"
    )
    parser.add_argument(
        "--from",
        dest="begin",
        metavar="FILE[@SECONDS]",
        help="begin at this moment of a recording: an MCAP file, or the folder of a recording or event; "
        f"default: {EVENT_LEAD_S:g} s before an event's first trigger, 1 s after the begin of another recording",
    )
    parser.add_argument(
        "--present-config", action="store_true", help="with --from: the present configuration, not the stored one"
    )
    parser.add_argument("--seed", type=_seed, metavar="N", help="of all noise, delays and faults; default: scenario's")
    parser.add_argument("--world", metavar="NAME", help="a world of config/worlds/ instead of the scenario's")
    parser.add_argument("--faults", metavar="FILE|random[:N]", help="faults of a YAML file, or of the seed")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="record MCAP into this new folder, as `record`")
    parser.add_argument("--until", type=_seconds, metavar="S", default=math.inf, help="end after S simulated seconds")
    parser.add_argument("--light", action="store_true", help="fewer LiDAR beams; camera images only while docking")
    parser.add_argument("--shrink", action="store_true", help="after a broken invariant: drop faults it does not need")
    parser.add_argument("--serial", action="store_true", help="use one core; changes no result")
    parser.add_argument("--output", type=Path, metavar="FOLDER", default=Path("results"), help="where results go")
    parser.add_argument("--no-plots", action="store_true", help="figures only")
    options = parser.parse_args(arguments)
    if (options.scenario is None) == (options.begin is None):
        parser.error("give either SCENARIO or --from")
    if options.shrink and options.faults is None:
        parser.error("--shrink needs --faults")
    if options.record is not None and options.record.exists():
        parser.error(f"--record {options.record}: exists already; give the name of a new folder")
    return options


@contextmanager
def moment_of(options: argparse.Namespace) -> Iterator[RecordedMoment | None]:
    """The moment of ``--from``, with the configuration stored with the recording in force. Raises ConfigError."""
    if options.begin is None:
        yield None
        return
    path, at_s = parse_moment(options.begin)
    recorded, at_s = read_moment(path, at_s)
    stored = None if options.present_config else recorded.configuration
    with nullcontext() if stored is None else stored_configuration(stored):
        yield moment_in(recorded, at_s)


def make_job(options: argparse.Namespace, moment: RecordedMoment | None = None) -> Job:
    """Raises ConfigError."""
    if moment is None:
        scenario, name = choose_scenario(options.scenario, options.seed, options.world)
        argument: tuple[str, ...] = (options.scenario,)
    else:
        scenario, name = moment.scenario(options.seed, options.world), f"from-{moment.path.resolve().stem}"
        argument = ("--from", options.begin, *(("--present-config",) if options.present_config else ()))
    faults = planned_faults(options.faults or "", scenario.seed, scenario, options.until)
    run_options = RunOptions(options.light, options.record, not options.serial, options.until, faults, moment=moment)
    return Job(scenario, name, argument, run_options, options.faults, options.world)


def carry_out(job: Job, log: Callable[[str], None], progress: RunProgress, node_log: Any) -> Outcome:
    """One run. Raises RunFailed, SimulationDiverged, FaultRefused, ValueError, ConfigError.

    node_log: receives the list of the nodes' log lines, at the end and after a failure.
    """

    def show(line: str) -> None:
        progress.end_line()
        log(line)

    begun_s = time.monotonic()
    with ScheduledRun(job.scenario, job.scenario.seed, job.options, progress.show, show) as run:
        try:
            with _stop_on_signals(run) as stopped:
                run.start()
                ready_s, ready_real_s = run.stack.scheduler.now_s, time.monotonic()
                show(f"ready after {ready_s:.1f} s of simulated time ({ready_real_s - begun_s:.1f} s)")
                ended = run.ride()
            real_s = time.monotonic() - ready_real_s
            progress.end_line()
            cut = not ended and (bool(stopped) or run.now_s < job.scenario.limit_s - 1e-6)
            return Outcome(run.result(), cut, bool(stopped), ready_s, real_s)
        finally:
            progress.end_line()
            node_log(run.stack.scheduler.log)


def _run(job: Job, folder: ResultFolder, *, plots: bool, shrinks: bool) -> int:
    def log(line: str) -> None:
        print(line, flush=True)
        folder.append_log(line)

    scenario = job.scenario
    log(f"{job.name}: {scenario.description}")
    log(f"world {scenario.world}, seed {scenario.seed}: {job.command()}")
    for line in job.options.moment.lines() if job.options.moment is not None else ():
        log(line)
    folder.write_inputs(scenario)
    try:
        outcome = carry_out(job, log, RunProgress(sys.stdout), folder.write_node_log)
    except (RunFailed, FaultRefused, SimulationDiverged, ValueError, OSError) as error:
        log(f"FAILED to run: {error}")
        log(f"log of the nodes: {folder.path / 'nodes.log'}")
        return EXIT_UNFULFILLED
    problems, result = outcome.problems(scenario), outcome.result
    conditions = {
        "world": scenario.world,
        "seed": scenario.seed,
        "light": job.options.light,
        "cut": outcome.cut,
        "command": job.command(),
        "ready_s": outcome.ready_s,
        "real_time_s": outcome.real_s,
        "speed": result.simulated_s / outcome.real_s,
    }
    folder.write_figures(job.name, result, [*problems, *(item.describe() for item in result.broken)], conditions)
    if plots:
        folder.draw(scenario, result)
    for line in describe_outcome(outcome):
        log(line)
    code = _judge(job, outcome, problems, log)
    if result.broken and shrinks:
        _shrink(job, result, folder, log)
    log(f"results in {folder.path}")
    return code


def describe_outcome(outcome: Outcome) -> Iterator[str]:
    """Figures, failures of processes, the digest, and the speed."""
    result = outcome.result
    for name, value in result.figures.items():
        yield f"  {name:28} {value:.6g}" if isinstance(value, float) else f"  {name:28} {value}"
    for failure in result.failures:
        yield f"process {failure.process} failed at {1e-9 * failure.time_ns - outcome.ready_s:.2f} s:"
        yield failure.text.rstrip()
    speed = result.simulated_s / outcome.real_s
    yield f"{result.simulated_s:.1f} simulated s in {outcome.real_s:.1f} s: {speed:.2f} simulated seconds per second"
    yield f"digest {result.digest} over {result.messages} messages and the ground truth"


def _judge(job: Job, outcome: Outcome, problems: list[str], log: Callable[[str], None]) -> int:
    scenario, broken = job.scenario, outcome.result.broken
    for problem in problems:
        log(f"NOT as expected: {problem}")
    for item in broken:
        log(f"INVARIANT BROKEN: {item.describe()}")
    if broken or problems or outcome.result.failures:
        log(f"reproduce it: {job.command()}")
    if broken:
        return EXIT_INVARIANT
    if outcome.interrupted:
        log(f"{job.name}: interrupted; expectations are not judged")
        return EXIT_INTERRUPTED
    if problems:
        log(f"{job.name}: {len(problems)} of {len(scenario.expect)} expectations NOT fulfilled")
    elif outcome.cut:
        log(f"{job.name}: ended by --until; expectations are not judged")
    else:
        log(f"{job.name}: as expected")
    return EXIT_UNFULFILLED if problems or outcome.result.failures else 0


def _shrink(job: Job, result: RunResult, folder: ResultFolder, log: Callable[[str], None]) -> None:
    """Repeats the run with fewer faults as long as it breaks one of the same invariants."""
    names = {item.name for item in result.broken}
    fewer = shrunk(job.scenario, job.scenario.seed, replace(job.options, record=None), names, log)
    file = folder.path / "faults.yaml"
    file.write_text(plan_text(fewer), encoding="utf-8")
    log(f"{len(fewer)} faults are enough: {replace(job, faults=str(file)).command()}")


@contextmanager
def _stop_on_signals(run: ScheduledRun) -> Iterator[list[int]]:
    """Ctrl-C and SIGTERM end the run after the present event; the second one ends the program. Yields the signals."""
    came: list[int] = []

    def stop(number: int, _: object) -> None:
        if came:
            raise KeyboardInterrupt
        came.append(number)
        run.stack.scheduler.stop()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield came
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"a seed is a whole number from 0 on, is {text!r}")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"must be a number of seconds above 0, is {text!r}")
    return value


if __name__ == "__main__":
    raise SystemExit(main())
