"""Validates the files of config/."""

from __future__ import annotations

import ast
import importlib
import inspect
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from robot_stack.contract.processes import available
from robot_stack.core.config import ConfigError, config_dir, load, read_yaml
from robot_stack.core.mission_library import MissionError, MissionLibrary
from robot_stack.core.robot import load_robot
from robot_stack.supervisor.params import load_params
from robot_stack.supervisor.profile import load_plan


def examine_configuration() -> tuple[list[str], int]:
    """The problems of all configuration files, one line each, and the number of files."""
    folder = config_dir()
    problems = [problem for problem in map(_problem, _checks(folder)) if problem]
    files = sorted(folder.rglob("*.yaml"))
    problems += [problem for path in files if (problem := _problem(lambda path=path: read_yaml(path)))]
    return list(dict.fromkeys(problems)), len(files)


def _checks(folder: Path) -> list[Any]:
    missions = MissionLibrary(folder / "missions", *folder.glob("sites/*/missions"))
    return [
        load_robot,
        load_params,
        *(lambda name=path.stem: load_plan(name) for path in (folder / "profiles").glob("*.yaml")),
        *(lambda mission_id=mission_id: missions.find(mission_id) for mission_id in missions.ids()),
        *(lambda name=name, model=model: load(model, name) for name, model in parameter_models().items()),
    ]


def _problem(check: Any) -> str | None:
    try:
        check()
    except (ConfigError, MissionError) as error:
        return str(error)
    return None


def parameter_models() -> dict[str, type[BaseModel]]:
    """Node name -> model of its parameters, for the built nodes, from the calls of the node base's constructor."""
    models: dict[str, type[BaseModel]] = {}
    for process in available():
        assert process.module is not None
        try:
            module = importlib.import_module(process.module)
        except ImportError:
            continue  # the check of the processes reports it
        for name, model_name in _super_calls(inspect.getsource(module)):
            model = getattr(module, model_name, None)
            if isinstance(model, type) and issubclass(model, BaseModel):
                models[name] = model
    return models


def _super_calls(source: str) -> list[tuple[str, str]]:
    """The (node name, model name) of each ``super().__init__("name", Model)``."""
    found = []
    for call in ast.walk(ast.parse(source)):
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "super().__init__" and len(call.args) == 2:
            name, model = call.args
            if isinstance(name, ast.Constant) and isinstance(name.value, str) and isinstance(model, ast.Name):
                found.append((name.value, model.id))
    return found
