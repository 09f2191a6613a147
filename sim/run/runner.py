"""Runs a scenario: ``python -m sim.run.runner FILE`` (or its name in config/scenarios/) writes a result folder.

The folder holds figures.json, the plots, the effective scenario and configuration, and the log. Exit code 0 if every
expectation is fulfilled, 1 if not or if the run failed, 2 if the scenario or the configuration is wrong.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from pathlib import Path
from typing import Any

import yaml

from robot_stack.core.config import ConfigError, config_dir
from sim.plant.faults import FaultRefused
from sim.plant.world import SimulationDiverged
from sim.run.run_log import RunLog
from sim.run.scenario import Scenario, load_scenario
from sim.worldfile import load_world

EXIT_UNFULFILLED, EXIT_REFUSED, EXIT_INTERRUPTED = 1, 2, 130


class Log:
    """Lines on the terminal and in the folder's log."""

    def __init__(self, path: Path) -> None:
        self._file = open(path, "a", encoding="utf-8")  # noqa: SIM115 - lives as long as the run

    def __call__(self, line: str) -> None:
        print(line, flush=True)
        self._file.write(line + "\n")
        self._file.flush()


def main() -> int:
    options = _options()
    try:
        scenario, name = _find(options)
        folder = _folder(options.output, name)
        return run(scenario, name, folder, plots=not options.no_plots)
    except ConfigError as error:
        print(f"scenario: {error}", file=sys.stderr)
        return EXIT_REFUSED
    except KeyboardInterrupt:
        print("scenario: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED


def run(scenario: Scenario, name: str, folder: Path, plots: bool = True) -> int:
    """Carries it out and writes the result into ``folder``. Returns the exit code. Raises ConfigError."""
    log = Log(folder / "log.txt")
    log(f"{name}: {scenario.description}")
    _write_inputs(scenario, folder)
    begun_s = time.monotonic()
    try:
        run_log, figures = _carry_out(scenario, folder, log)
    except (FaultRefused, SimulationDiverged, RuntimeError, ValueError) as error:
        log(f"FAILED to run: {error}")
        return EXIT_UNFULFILLED
    problems = [problem for item in scenario.expect if (problem := item.problem(figures)) is not None]
    _write_figures(scenario, name, folder, figures, problems, time.monotonic() - begun_s)
    if plots:
        from sim.pictures.scenario_plots import draw_all

        draw_all(folder, load_world(scenario.world), run_log)
    for problem in problems:
        log(f"NOT as expected: {problem}")
    verdict = f"{len(problems)} of {len(scenario.expect)} expectations NOT fulfilled" if problems else "as expected"
    log(f"{name}: {verdict}; results in {folder}")
    return EXIT_UNFULFILLED if problems else 0


def _carry_out(scenario: Scenario, folder: Path, log: Log) -> tuple[RunLog, dict[str, Any]]:
    if scenario.kind == "kernel":
        from sim.run.kernel_run import run_kernel

        return run_kernel(scenario, log)
    from sim.run.stack_run import run_stack

    return run_stack(scenario, folder, log)


def _write_inputs(scenario: Scenario, folder: Path) -> None:
    """The scenario as understood, and a copy of the whole configuration it ran with."""
    text = yaml.safe_dump(scenario.model_dump(mode="json", exclude_none=True), sort_keys=False, allow_unicode=True)
    (folder / "scenario.yaml").write_text(text, encoding="utf-8")
    shutil.copytree(config_dir(), folder / "config", dirs_exist_ok=True)


def _write_figures(
    scenario: Scenario, name: str, folder: Path, figures: dict[str, Any], problems: list[str], real_s: float
) -> None:
    conditions = {"kind": scenario.kind, "world": scenario.world, "seed": scenario.seed, "real_time_s": real_s}
    result = {"name": name, "figures": figures, "conditions": conditions, "problems": problems}
    (folder / "figures.json").write_text(json.dumps(result, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _find(options: argparse.Namespace) -> tuple[Scenario, str]:
    named = config_dir() / "scenarios" / f"{options.scenario}.yaml"
    path = named if named.is_file() else Path(options.scenario)
    scenario = load_scenario(path)
    return (scenario if options.seed is None else scenario.model_copy(update={"seed": options.seed})), path.stem


def _folder(output: Path, name: str) -> Path:
    """A new folder for this run, and ``<name>-latest`` that points to it."""
    stamp = f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
    folder, number = output / stamp, 1
    while folder.exists():
        number += 1
        folder = output / f"{stamp}-{number}"
    folder.mkdir(parents=True)
    link = output / f"{name}-latest"
    link.unlink(missing_ok=True)
    link.symlink_to(folder.name)
    return folder.resolve()


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="scenario", description="Runs a scenario in the simulation.")
    parser.add_argument("scenario", help="a YAML file, or its name in config/scenarios/")
    parser.add_argument("--output", type=Path, default=Path("results"), help="where the folder of the run is made")
    parser.add_argument("--seed", type=int, help="another seed than the scenario's")
    parser.add_argument("--no-plots", action="store_true", help="figures only")
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
