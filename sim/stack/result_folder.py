"""The folder of a run's results: figures, plots, the effective scenario and configuration, and logs."""

from __future__ import annotations

import json
import os
import platform
import shutil
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from robot_stack.core.config import ConfigError, config_dir
from sim.run.scenario import Scenario
from sim.scheduler.logs import LogLine
from sim.stack.run import RunResult
from sim.worldfile import load_world


class ResultFolder:
    """A new folder ``<output>/<name>-<time>``; ``<name>-latest`` points to it. Raises ConfigError."""

    def __init__(self, output: Path, name: str) -> None:
        stamp = f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
        path, number = output / stamp, 1
        try:
            while path.exists():
                number += 1
                path = output / f"{stamp}-{number}"
            path.mkdir(parents=True)
            link = output / f"{name}-latest"
            link.unlink(missing_ok=True)
            link.symlink_to(path.name)
        except OSError as error:
            raise ConfigError(f"--output {output}: no folder can be made there: {error.strerror or error}") from error
        self.path = path.resolve()

    def write_inputs(self, scenario: Scenario) -> None:
        """The scenario as understood, and a copy of the configuration it runs with."""
        text = yaml.safe_dump(scenario.model_dump(mode="json", exclude_none=True), sort_keys=False, allow_unicode=True)
        (self.path / "scenario.yaml").write_text(text, encoding="utf-8")
        shutil.copytree(config_dir(), self.path / "config", dirs_exist_ok=True)

    def append_log(self, line: str) -> None:
        with open(self.path / "log.txt", "a", encoding="utf-8") as file:
            file.write(line + "\n")

    def write_node_log(self, lines: Sequence[LogLine]) -> None:
        """What the nodes logged, with virtual time from the start of the stack."""
        with open(self.path / "nodes.log", "w", encoding="utf-8") as file:
            for line in lines:
                file.write(f"{1e-9 * line.time_ns:12.6f} {line.level:5} {line.node}: {line.text}\n")

    def write_figures(
        self, name: str, result: RunResult, problems: Sequence[str], conditions: Mapping[str, Any]
    ) -> None:
        """figures.json."""
        machine = {"python": platform.python_version(), "machine": platform.machine(), "processors": os.cpu_count()}
        failures = [
            {"time_s": 1e-9 * item.time_ns, "process": item.process, "text": item.text} for item in result.failures
        ]
        content = {
            "name": name,
            "figures": result.figures,
            "digest": result.digest,
            "messages": result.messages,
            "simulated_s": result.simulated_s,
            "problems": list(problems),
            "failures": failures,
            "conditions": {**conditions, **machine},
        }
        text = json.dumps(content, indent=2, ensure_ascii=False)
        (self.path / "figures.json").write_text(text + "\n", encoding="utf-8")

    def draw(self, scenario: Scenario, result: RunResult) -> None:
        """The plots. Imports matplotlib."""
        from sim.pictures.scenario_plots import draw_all

        draw_all(self.path, load_world(scenario.world), result.run_log)
