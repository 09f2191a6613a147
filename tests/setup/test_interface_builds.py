"""Which changes of an interface package trigger a build."""

from __future__ import annotations

import importlib
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = ROOT / "launch_scripts/lib"


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(LIBRARY))
    return importlib.import_module("steps")


def test_files_of_removed_definitions_are_uninstalled(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """CMake's part is played: each installation writes the files and the manifest."""
    monkeypatch.syspath_prepend(str(LIBRARY))
    interfaces = importlib.import_module("interfaces")
    installations = [["a", "b"], ["b", "c"]]

    def run(command: list[str], _: dict[str, str], __: Path) -> None:
        if "--build" in command:
            files = [tmp_path / name for name in installations.pop(0)]
            for file in files:
                file.touch()
            manifest = tmp_path / "build/messages/install_manifest.txt"
            manifest.write_text("".join(f"{file}\n" for file in files))

    def fail(*_: object) -> None:
        raise RuntimeError

    monkeypatch.setattr(interfaces, "run_logged", run)

    def build() -> None:
        assert list(interfaces.build_all([Path("messages")], tmp_path, {})) == [Path("messages")]

    build()
    left = tmp_path / "build/messages/a.o"
    left.touch()
    monkeypatch.setattr(interfaces, "run_logged", fail)
    with pytest.raises(RuntimeError):
        build()
    monkeypatch.setattr(interfaces, "run_logged", run)
    build()
    assert [name for name in "abc" if (tmp_path / name).exists()] == ["b", "c"]
    assert not left.exists(), "nothing of an earlier build is linked"


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
