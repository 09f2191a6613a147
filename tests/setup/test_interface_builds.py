"""Which interface packages are built, and which changes trigger a build."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "launch_scripts/lib"


@pytest.fixture
def interfaces(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(LIBRARY))
    return importlib.import_module("interfaces")


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(LIBRARY))
    return importlib.import_module("steps")


def install(underlay: Path, name: str, python: str) -> None:
    package = underlay / "lib" / python / "site-packages" / name
    package.mkdir(parents=True)
    (package / "__init__.py").touch()


def names(packages: list[Path]) -> list[str]:
    return [package.name for package in packages]


def test_all_are_built_without_an_installed_ros(
    interfaces: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)

    everything = ["custom_msgs", "wmx_ros2_message", "control_msgs", "nav2_msgs", "tf2_msgs"]
    assert names(interfaces.needed(ROOT, tmp_path)) == everything


def test_upstream_packages_of_an_installed_ros_are_not_built_again(
    interfaces: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    python = f"python{sys.version_info.major}.{sys.version_info.minor}"
    for name in ("control_msgs", "custom_msgs"):
        install(tmp_path / "ros", name, python)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "ros"))

    assert names(interfaces.needed(ROOT, tmp_path)) == ["custom_msgs", "wmx_ros2_message", "nav2_msgs", "tf2_msgs"]


def test_packages_of_another_python_or_of_the_environment_itself_do_not_count(
    interfaces: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    install(tmp_path / "ros", "control_msgs", "python3.8")
    install(tmp_path / "own", "tf2_msgs", f"python{sys.version_info.major}.{sys.version_info.minor}")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'ros'}:{tmp_path / 'own'}")

    assert "control_msgs" in names(interfaces.needed(ROOT, tmp_path / "own"))
    assert "tf2_msgs" in names(interfaces.needed(ROOT, tmp_path / "own"))


def test_any_change_of_a_definition_is_a_change(steps: ModuleType, tmp_path: Path) -> None:
    message = tmp_path / "A.msg"
    message.write_text("float64 x\n")
    before = steps.digest("tools", [message])

    message.write_text("float64 y\n")
    changed = steps.digest("tools", [message])
    message.rename(tmp_path / "B.msg")
    renamed = steps.digest("tools", [tmp_path / "B.msg"])

    assert len({before, changed, renamed, steps.digest("other tools", [tmp_path / "B.msg"])}) == 4


def test_a_step_that_fails_is_run_again(steps: ModuleType, tmp_path: Path) -> None:
    runs: list[str] = []

    def fail() -> None:
        runs.append("failed")
        raise steps.Fault("no")

    work = steps.Steps(tmp_path / "stamps")
    with pytest.raises(steps.Fault):
        work.run("build", "building", "key", fail)
    work.run("build", "building", "key", lambda: runs.append("done"))
    work.run("build", "building", "key", lambda: runs.append("done for nothing"))

    assert runs == ["failed", "done"]
    assert work.done == 1


def test_a_definition_is_parsed_once_for_all_generators(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(str(LIBRARY))
    generators = importlib.import_module("generate_interfaces")
    parsed: list[str] = []

    def parse(text: str) -> list[str]:
        parsed.append(text)
        return text.split()

    of_first, of_second = (generators.stored(parse, tmp_path / "build") for _ in range(2))
    assert [of_first("a b"), of_second("a b", png_file=None), of_second("c")] == [["a", "b"], ["a", "b"], ["c"]]
    assert parsed == ["a b", "c"]
