"""The launch files, executed with a stand-in for ``launch`` and ``launch_ros``, which PyPI does not have.

The stand-in records every call. It shows what the files describe, not that ROS's launch accepts it.
"""

from __future__ import annotations

import ast
import importlib.util
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from robot_stack.contract import topics
from robot_stack.core.config import config_dir
from robot_stack.ros import transport
from robot_stack.supervisor.profile import load_plan

FOLDER = Path(__file__).resolve().parents[2] / "launch_scripts" / "launch"
FILES = sorted(FOLDER.glob("*.py"))
MODULES = (
    "launch",
    "launch.actions",
    "launch.conditions",
    "launch.launch_description_sources",
    "launch.substitutions",
    "launch_ros",
    "launch_ros.actions",
    "launch_ros.substitutions",
)


class Call(SimpleNamespace):
    """One call of the stand-in's API. A LaunchConfiguration performs to its value in ``context``."""

    kind: str
    args: tuple[Any, ...]
    options: dict[str, Any]

    def perform(self, context: dict[str, str]) -> str:
        return context[self.args[0]]


class StandIn(ModuleType):
    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *args, **options: Call(kind=name, args=args, options=options)


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in MODULES:
        monkeypatch.setitem(sys.modules, name, StandIn(name))
    monkeypatch.delenv(transport.PROFILE, raising=False)
    monkeypatch.delenv(transport.REACH, raising=False)


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name.replace(".", "_"), FOLDER / name)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def calls(value: Any) -> Iterator[Call]:
    """Every call within a description, at any depth."""
    if isinstance(value, Call):
        yield value
        yield from calls([*value.args, *value.options.values()])
    elif isinstance(value, dict):
        yield from calls(list(value.values()))
    elif isinstance(value, (list, tuple)) or type(value).__name__ == "dict_items":
        for item in value:
            yield from calls(item)


def described(name: str) -> list[Call]:
    return list(calls(load(name).generate_launch_description()))


def of_kind(found: list[Call], kind: str) -> list[Call]:
    return [call for call in found if call.kind == kind]


def command(profile: str, options: str) -> list[str]:
    """The supervisor's command line."""
    (process,) = load("stack.launch.py").supervisor({"profile": profile, "options": options})
    assert process.kind == "ExecuteProcess"
    return list(process.options["cmd"])


def test_there_are_files() -> None:
    assert [path.name for path in FILES] == ["nav2.launch.py", "node.launch.py", "stack.launch.py"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_files_import_the_launch_packages_and_the_standard_library_alone(path: Path) -> None:
    """The interpreter of an installed ROS executes them; it need not have the stack's packages."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        names += [item.name for item in node.names] if isinstance(node, ast.Import) else []
        assert all(name in MODULES or name in sys.stdlib_module_names for name in names), names


@pytest.mark.usefixtures("stand_in")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_argument_used_is_declared_once(path: Path) -> None:
    found = described(path.name)
    declared = [call.args[0] for call in of_kind(found, "DeclareLaunchArgument")]
    used = {call.args[0] for call in of_kind(found, "LaunchConfiguration")}
    assert len(declared) == len(set(declared))
    assert used <= set(declared)
    assert all(call.options["description"] for call in of_kind(found, "DeclareLaunchArgument"))


@pytest.mark.usefixtures("stand_in")
def test_single_node_is_one_of_the_package() -> None:
    (node,) = of_kind(described("node.launch.py"), "Node")
    assert node.options["package"] == "robot_stack"
    assert node.options["executable"].args == ("node",)
    assert "name" not in node.options, "a process with several nodes keeps their names"


@pytest.mark.usefixtures("stand_in")
def test_stack_runs_in_the_foreground_with_its_options() -> None:
    assert command("robot", "--set 'a.b=1 2'") == [
        *("robot-stack", "up", "--foreground", "--profile", "robot", "--set", "a.b=1 2"),
    ]


@pytest.mark.usefixtures("stand_in")
def test_rviz_gets_the_configuration_the_name_and_the_transport_of_the_contract() -> None:
    (node,) = of_kind(described("stack.launch.py"), "Node")
    assert node.options["name"] in topics.INITIAL_POSE.publishers
    config, *parts = node.options["arguments"][1].args[0]
    assert (config_dir() / Path(*parts)).is_file()
    assert config.args[0][1:] == ["config"]
    environment = node.options["additional_env"]
    assert set(environment) == {transport.PROFILE, transport.REACH}
    assert (config_dir() / environment[transport.PROFILE].args[0][1]).is_file()


@pytest.mark.usefixtures("stand_in")
def test_a_chosen_transport_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(transport.REACH, "SUBNET")
    nodes = [*of_kind(described("stack.launch.py"), "Node"), *of_kind(described("nav2.launch.py"), "Node")]
    assert all(node.options["additional_env"] == {} for node in nodes)


@pytest.mark.usefixtures("stand_in")
def test_nav2_takes_the_place_of_processes_of_both_profiles() -> None:
    module = load("nav2.launch.py")
    (include,) = of_kind(list(calls(module.generate_launch_description())), "IncludeLaunchDescription")
    given = dict(include.options["launch_arguments"])
    stack = {call.args[0] for call in of_kind(described("stack.launch.py"), "DeclareLaunchArgument")}
    assert set(given) <= stack
    first, *rest = given["options"]
    assert first.args == ("options",)
    left_out = shlex.split("".join(rest))
    assert left_out[::2] == ["--without"] * len(module.REPLACED)
    for profile in ("sim", "robot"):
        plan = load_plan(profile, without=left_out[1::2])
        assert not {process.name for process in plan.processes} & set(module.REPLACED)


@pytest.mark.usefixtures("stand_in")
def test_nav2_servers_are_managed_and_share_the_smoother() -> None:
    module = load("nav2.launch.py")
    *servers, manager = module.nav2()
    names = manager.options["parameters"][1]["node_names"]
    assert names == [server.options["executable"] for server in servers]
    remaps = {server.options["executable"]: dict(server.options["remappings"]) for server in servers}
    moving = {name for name, remap in remaps.items() if remap.get("cmd_vel") == "cmd_vel_nav"}
    assert moving == {"controller_server", "behavior_server", "velocity_smoother"}
    assert remaps["velocity_smoother"]["cmd_vel_smoothed"] == topics.CMD_VEL.name.removeprefix("/")
