"""Each declared dependency is used: imported, called by a script or a setting, or required by a build."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
RUN, GROUPS = PROJECT["project"]["dependencies"], PROJECT["dependency-groups"]

# Distributions that no module imports, and a text in a file that uses them.
CALLED = {
    "pip": ("launch_scripts/lib/set_up.py", "pip"),
    "uv": ("launch_scripts/lib/set_up.py", "uv"),
    "setuptools": ("pyproject.toml", "setuptools.build_meta"),
    "cmake": ("launch_scripts/lib/interfaces.py", "cmake"),
    "ninja": ("launch_scripts/lib/interfaces.py", "Ninja"),
    "pytest-timeout": ("pyproject.toml", "timeout = "),
    "pytest-xdist": ("launch_scripts/lib/tests.sh", "--numprocesses"),
    "pytest-cov": ("pyproject.toml", "[tool.coverage.run]"),
    "ruff": ("pyproject.toml", "[tool.ruff]"),
    "mypy": ("pyproject.toml", "[tool.mypy]"),
    "import-linter": ("pyproject.toml", "[tool.importlinter]"),
    "mutmut": ("tests/mutation/safety_kernel.py", "mutmut"),
    "types-pyyaml": ("robot_stack/core/config.py", "import yaml"),
    "types-psutil": ("robot_stack/supervisor/client.py", "import psutil"),
    "types-pyserial": ("robot_stack", "import serial"),
    "colcon-core": ("tests/setup/test_colcon.py", "colcon"),
    "colcon-ros": ("tests/setup/test_colcon.py", "colcon"),
    "colcon-cmake": ("tests/setup/test_colcon.py", "colcon"),
    "colcon-common-extensions": ("tests/setup/test_colcon.py", "colcon"),
    "ros-jazzy-common-interfaces": ("robot_stack/package.xml", "std_msgs"),
    "ros-jazzy-rmw-fastrtps-cpp": ("config/fastdds.xml", "dds"),
}


def name_of(entry: str) -> str:
    return re.sub(r"[-_.]+", "-", re.split(r"[^A-Za-z0-9_.-]", entry)[0]).lower()


@cache
def modules() -> dict[str, set[str]]:
    """The modules of each distribution; a distribution without file information gets the module of its own name."""
    found: dict[str, set[str]] = {}
    for module, distributions in packages_distributions().items():
        for distribution in distributions:
            found.setdefault(name_of(distribution), set()).add(module)
    return found


@cache
def imported(*folders: str) -> frozenset[str]:
    """First names of all modules imported in these folders."""
    names: set[str] = set()
    for path in (path for folder in folders for path in (ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names.add(node.module.partition(".")[0])
    return frozenset(names)


@cache
def build_files() -> str:
    """Build descriptions of our packages, and of the installed packages that they are built with."""
    installed = (
        path for pattern in ("*/package.xml", "*/cmake/**/*.cmake", "*/cmake/**/*.py") for path in share().glob(pattern)
    )
    ours = [*ROOT.glob("*/package.xml"), *ROOT.glob("*/CMakeLists.txt"), *(ROOT / "launch_scripts/lib").glob("*.*")]
    return "\n".join(path.read_text(encoding="utf-8", errors="replace") for path in (*ours, *installed))


def share() -> Path:
    return Path(sys.prefix) / "share"


def called(name: str) -> bool:
    where, text = CALLED.get(name, ("", ""))
    path = ROOT / where
    files = path.rglob("*.py") if path.is_dir() else [path]
    return bool(where) and any(text in file.read_text(encoding="utf-8") for file in files)


def used(name: str, folders: tuple[str, ...]) -> bool:
    own = name.removeprefix("ros-jazzy-").replace("-", "_")
    return called(name) or bool((modules().get(name, set()) | {own}) & imported(*folders))


@pytest.mark.parametrize("entry", RUN)
def test_the_stack_or_its_simulation_uses_it(entry: str) -> None:
    assert used(name_of(entry), ("robot_stack", "sim"))


@pytest.mark.parametrize("entry", GROUPS["dev"])
def test_the_tests_or_a_tool_use_it(entry: str) -> None:
    assert used(name_of(entry), ("robot_stack", "sim", "tests", "launch_scripts"))


@pytest.mark.parametrize("entry", GROUPS["build"])
def test_the_build_uses_it(entry: str) -> None:
    """ROS packages: a dependency or a find_package of our packages or of their build dependencies."""
    name = name_of(entry)
    package = name.removeprefix("ros-jazzy-").replace("-", "_")
    assert called(name) or re.search(rf"\b{package}\b", build_files())


def test_list_of_unimported_dependencies_contains_only_declared_ones() -> None:
    declared = {name_of(entry) for entry in (*RUN, *GROUPS["dev"], *GROUPS["build"])}
    assert set(CALLED) <= declared
