"""Profiles: ``config/profiles/<name>.yaml`` selects the processes of the contract that run together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import yaml
from pydantic import Field, ValidationError, model_validator

from robot_stack.contract import topics
from robot_stack.contract.model import Criticality, Process, System
from robot_stack.contract.processes import BY_NAME
from robot_stack.core.config import Config, ConfigError, chosen_site, config_dir, read_yaml, validate
from robot_stack.fleet.mqtt_params import BrokerParams
from robot_stack.wmx.config import ENGINE_VARIABLE, HELD_UP_STALE_S, STALE_VARIABLE

_SAFETY_MONITOR, _SYSTEM_MONITOR = "safety_monitor", "system_monitor"
_EXPECTED = "expected_processes"
_FLEET = "fleet_agent"
# Parameters that name the map of a site.
MAP_PARAMETERS: Final = {
    "ndt_localization": "map",
    "navigation_controller": "map",
    "mission_manager": "map",
    "touch_ui": "pages.map",
    "black_box": "map",
    _FLEET: "map",
}
# Nodes that simulate a part of the world, which their parameter ``world`` names.
WORLD_NODES: Final = ("sim_world", "camera_driver", "lidar_driver", "overhead_lidar_driver")
SITE_PARAMETERS: Final = MAP_PARAMETERS | dict.fromkeys(WORLD_NODES, "world")


class Machine(Enum):
    """The machine of a profile; the simulation belongs to either."""

    ROBOT = System.ROBOT.value
    WMX = System.WMX.value


class ExtraProcess(Config):
    """A process defined by a profile, e.g. the driver of a sensor that is not part of this stack."""

    module: str
    criticality: Criticality
    note: str
    max_restarts: Annotated[int, Field(gt=0)] = 5


class ProfileFile(Config):
    """One profile.

    machine: the machine whose processes run; a profile never mixes two.
    use_sim_time: nodes live on the simulated world's time instead of the system clock.
    speed: speed of the simulated world; other than 1 only on its own time. Null where there is no simulated world.
    ready_deadline_s: time from start within which every process must be ready.
    engine: the motion engine of every process; null leaves it to config/wmx_client.yaml.
    processes: process names of the contract. Those that are not built yet are reported as missing.
    extends: a profile whose processes and parameters come first; instead: of these processes, those replaced here.
    parameters: node name -> parameter name -> value, on top of ``config/<node>.yaml``.
    environment: variables for every process.
    extra: processes beyond the contract's table.
    """

    description: str
    machine: Machine
    extends: str | None = None
    instead: dict[str, str] = {}
    use_sim_time: bool
    speed: Annotated[float, Field(gt=0.0)] | None
    ready_deadline_s: Annotated[float, Field(gt=0.0)]
    engine: Literal["simulated", "vendor"] | None
    processes: list[str]
    parameters: dict[str, dict[str, Any]] = {}
    environment: dict[str, str] = {}
    extra: dict[str, ExtraProcess] = {}

    @model_validator(mode="after")
    def _other_speeds_need_the_clock(self) -> ProfileFile:
        if self.speed is not None and self.speed != 1.0 and not self.use_sim_time:
            raise ValueError(f"speed: {self.speed:g} needs use_sim_time: true, the system clock has one speed only")
        return self


@dataclass(frozen=True, slots=True)
class Plan:
    """The processes to run: the profile after all overrides.

    processes: in the order of their start, on which none depends. parameters: node name -> values, of the nodes
    in ``processes`` only.
    missing: named by the profile, but not built.
    """

    name: str
    path: Path
    description: str
    machine: System
    use_sim_time: bool
    ready_deadline_s: float
    processes: tuple[Process, ...]
    missing: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    environment: Mapping[str, str] = field(default_factory=dict)


def profile_path(name: str) -> Path:
    """A profile by name, or by path if ``name`` looks like one. Raises ConfigError that lists the profiles."""
    if name.endswith((".yaml", ".yml")):
        return Path(name)
    folder = config_dir() / "profiles"
    path = folder / f"{name}.yaml"
    if not path.is_file():
        known = ", ".join(sorted(item.stem for item in folder.glob("*.yaml"))) or "none"
        raise ConfigError(f"{path}: there is no profile {name!r}; known profiles: {known}")
    return path


def load_plan(
    name: str,
    *,
    settings: Sequence[str] = (),
    only: Sequence[str] = (),
    without: Sequence[str] = (),
    speed: float | None = None,
    system_time: bool = False,
    fleet: str | None = None,
) -> Plan:
    """A profile with the operator's overrides on top.

    settings: ``node.parameter=value``, the value in YAML. only: the processes to run, all if empty.
    without: processes to leave out, which other software replaces. speed: of the simulated world.
    system_time: nodes run on the system clock although the world is simulated: then it does not wait for nodes, like
    the real one. fleet: URL of a fleet's broker; adds the fleet agent.

    Raises ConfigError in one line that names file, field and the accepted values.
    """
    path = profile_path(name)
    data = _with_speed(_with_base(read_yaml(path), path), speed, path)
    file = validate(ProfileFile, {**data, "use_sim_time": False} if system_time else data, str(path))
    if fleet is not None:
        file, settings = _with_fleet(file, fleet), (f"{_FLEET}.broker.url={fleet}", *settings)
    processes = _processes(file, path)
    built = [process for process in processes if process.available]
    chosen = _named(built, "--only", only) if only else built
    left_out = _named(built, "--without", without)
    chosen = [process for process in chosen if process not in left_out]
    parameters = _parameters(file, settings, processes, path)
    nodes = {node for process in chosen for node in process.nodes}
    _configure_monitors(parameters, chosen)
    return Plan(
        name=path.stem,
        path=path,
        description=file.description,
        machine=System(file.machine.value),
        use_sim_time=file.use_sim_time,
        ready_deadline_s=file.ready_deadline_s,
        processes=tuple(chosen),
        missing=tuple(process.name for process in processes if not process.available),
        parameters={node: values for node, values in parameters.items() if node in nodes},
        environment={**file.environment, **_engine_variables(file)},
    )


def _configure_monitors(parameters: dict[str, dict[str, Any]], chosen: Sequence[Process]) -> None:
    """Sets the monitors' lists to the processes that run here."""
    known = [process.name for process in chosen if process.name in BY_NAME]
    for monitor in (_SAFETY_MONITOR, _SYSTEM_MONITOR):
        expected = [name for name in known if name != monitor]
        parameters.setdefault(monitor, {}).setdefault(_EXPECTED, expected)


def _engine_variables(file: ProfileFile) -> dict[str, str]:
    engine = {ENGINE_VARIABLE: file.engine} if file.engine else {}
    return {**engine, **({STALE_VARIABLE: str(HELD_UP_STALE_S)} if file.use_sim_time else {})}


def _with_fleet(file: ProfileFile, url: str) -> ProfileFile:
    try:
        BrokerParams(url=url, allow_plain=True)  # other parameters may allow what the URL alone may not
    except ValidationError as error:
        raise ConfigError(f"--fleet: {error.errors()[0]['msg'].removeprefix('Value error, ')}") from None
    processes = [*file.processes, *([] if _FLEET in file.processes else [_FLEET])]
    return file.model_copy(update={"processes": processes})


def _with_speed(data: dict[str, Any], speed: float | None, path: Path) -> dict[str, Any]:
    if speed is None:
        return data
    if data.get("speed") is None:
        raise ConfigError(f"{path}: has no simulated world whose speed could be set")
    return {**data, "speed": speed, "use_sim_time": speed != 1.0 or bool(data.get("use_sim_time"))}


def _with_base(data: dict[str, Any], path: Path) -> dict[str, Any]:
    """The profile's data on top of the processes and parameters of the profile that it extends."""
    if not data.get("extends"):
        return data
    file = validate(ProfileFile, data, str(path))
    assert file.extends is not None
    try:
        base_path = profile_path(file.extends)
        base = validate(ProfileFile, read_yaml(base_path), str(base_path))
    except ConfigError as error:
        raise ConfigError(f"{path}: extends: {error}") from error
    if base.extends is not None:
        raise ConfigError(f"{path}: extends: {file.extends} extends {base.extends}; one step is the limit")
    if unknown := sorted(set(file.instead) - set(base.processes)):
        raise ConfigError(f"{path}: instead: {', '.join(unknown)}: no process of the profile {file.extends}")
    kept = [file.instead.get(name, name) for name in base.processes]
    parameters = {
        node: base.parameters.get(node, {}) | file.parameters.get(node, {})
        for node in (*base.parameters, *file.parameters)
    }
    return {**data, "processes": [*kept, *file.processes], "parameters": parameters}


def _processes(file: ProfileFile, path: Path) -> list[Process]:
    twice = sorted({name for name in file.processes if file.processes.count(name) > 1})
    if twice:
        raise ConfigError(f"{path}: processes: {', '.join(twice)}: named twice")
    found = [*(_contract_process(name, file, path) for name in file.processes)]
    for name, extra in file.extra.items():
        if name in BY_NAME:
            raise ConfigError(f"{path}: extra.{name}: the contract has a process of this name")
        found.append(_extra_process(name, extra))
    if not found:
        raise ConfigError(f"{path}: processes: a profile needs at least one process")
    _refuse_shared_nodes(found, path)
    return found


def _extra_process(name: str, extra: ExtraProcess) -> Process:
    return Process(name, extra.module, extra.criticality, extra.note, (name,), max_restarts=extra.max_restarts)


def _contract_process(name: str, file: ProfileFile, path: Path) -> Process:
    process = BY_NAME.get(name)
    if process is None:
        raise ConfigError(f"{path}: processes: {name!r} is no process of the contract; known: {', '.join(BY_NAME)}")
    if process.system not in (System(file.machine.value), System.SIMULATION):
        machines = f"{process.system.value}, not {file.machine.value}"
        raise ConfigError(f"{path}: processes: {name} belongs to the machine {machines}")
    return process


def _refuse_shared_nodes(processes: Sequence[Process], path: Path) -> None:
    owner: dict[str, str] = {}
    for process in processes:
        for node in process.nodes:
            if node in owner:
                both = f"{owner[node]} and {process.name}"
                raise ConfigError(f"{path}: processes: the node {node} would run in both {both}")
            owner[node] = process.name


def _named(built: Sequence[Process], option: str, wanted: Sequence[str]) -> list[Process]:
    names = [process.name for process in built]
    unknown = sorted(set(wanted) - set(names))
    if unknown:
        known = ", ".join(names)
        raise ConfigError(f"{option}: {', '.join(unknown)}: not a built process of this profile; there are {known}")
    return [process for process in built if process.name in wanted]


def _parameters(
    file: ProfileFile, settings: Sequence[str], processes: Sequence[Process], path: Path
) -> dict[str, dict[str, Any]]:
    nodes = {node for process in processes for node in process.nodes}
    unknown = sorted(set(file.parameters) - nodes)
    if unknown:
        raise ConfigError(f"{path}: parameters: {', '.join(unknown)}: no node of this profile")
    merged = {node: dict(values) for node, values in file.parameters.items()}
    if file.speed is not None:
        for node in set(topics.CLOCK.publishers) & nodes:
            merged.setdefault(node, {})["speed"] = file.speed
    if site := chosen_site():
        for node in SITE_PARAMETERS.keys() & nodes:
            merged.setdefault(node, {})[SITE_PARAMETERS[node]] = site
    for setting in settings:
        node, name, value = parse_setting(setting, nodes)
        merged.setdefault(node, {})[name] = value
    for process in processes:
        if file.use_sim_time:
            for node in process.nodes:
                merged.setdefault(node, {})["use_sim_time"] = True
    return merged


def parse_setting(text: str, nodes: set[str]) -> tuple[str, str, Any]:
    """(node, parameter, value) of ``node.parameter=value``, the value in YAML. Raises ConfigError."""
    target, equals, value = text.partition("=")
    node, dot, name = target.partition(".")
    if not (equals and dot and node and name):
        raise ConfigError(f"--set {text}: must read node.parameter=value")
    if node not in nodes:
        raise ConfigError(f"--set {text}: {node!r} is no node of this profile; there are {', '.join(sorted(nodes))}")
    try:
        return node, name, yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise ConfigError(f"--set {text}: the value is not valid YAML: {' '.join(str(error).split())}") from error
