"""Mutation testing of the safety kernel with mutmut: do the tests detect a wrong line?

    python -m tests.mutation.safety_kernel                   every mutant: hours of one core
    python -m tests.mutation.safety_kernel --sample 40       a sample, always the same for the same --seed
    python -m tests.mutation.safety_kernel --module conditions    those of a module, by its own tests, if it has any

Works on a copy in a temporary folder. A mutant that no test reaches survives, like one that passes all tests. All tests
check the mutants that survive a module's own tests. ``equivalent.yaml`` lists the survivors that behave like the
original for every input, each with the reason; any other survivor fails the run. mutmut does not mutate properties,
validators and module-level code; these rely on the branch coverage of 100 % alone.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent.yaml")
ALL_TESTS = "tests/unit/safety"
COPIED = (
    "config",
    "robot_stack/__init__.py",
    "robot_stack/contract",
    "robot_stack/core",
    "robot_stack/safety",
    "tests/__init__.py",
    "tests/support/__init__.py",
    "tests/support/stepped_worker.py",
    "tests/unit/__init__.py",
    ALL_TESTS,
)
SETUP = """
[mutmut]
source_paths=
    robot_stack/safety
pytest_add_cli_args_test_selection=
    {tests}
do_not_mutate=
    {kept}
also_copy=
    robot_stack
    config
    tests
    pytest.ini
"""
PYTEST = """
[pytest]
addopts = --import-mode=importlib -p no:cacheprovider
pythonpath = .
"""
# An arbitrary mutant: before the first run mutmut generates all mutants and finds the tests that reach them.
FIRST = "robot_stack.safety.timing.x_age_s__mutmut_1"
# Exit codes of mutmut: every test passed, or there was no test to run.
SURVIVED = (0, 5, 33)


@dataclass(frozen=True, slots=True)
class Change:
    """The change of a mutant: the function, the removed and the added lines."""

    function: str
    removed: str
    added: str

    def __str__(self) -> str:
        return f"{self.function}\n  - {self.removed}\n  + {self.added}"


@dataclass(frozen=True, slots=True)
class Result:
    """of: number of all mutants; checked, killed: of those that ran; unexplained: survivors that are not listed."""

    of: int
    checked: int
    killed: int
    equivalent: tuple[Change, ...]
    unexplained: tuple[Change, ...]

    @property
    def score(self) -> float:
        """Share of killed mutants among the non-equivalent ones."""
        return self.killed / (self.checked - len(self.equivalent))


class Workshop:
    """A copy of the kernel and its tests for mutmut. module: the only one to mutate. tests: run against the mutants."""

    def __init__(self, folder: Path, module: str | None = None, tests: str = ALL_TESTS) -> None:
        self._folder = folder
        for name in COPIED:
            source, target = ROOT / name, folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__", "nodes"))
            else:
                shutil.copy(source, target)
        kernel = sorted((ROOT / "robot_stack" / "safety").glob("*.py"))
        others = [f"robot_stack/safety/{file.name}" for file in kernel if module and file.stem != module]
        kept = "\n    ".join(["robot_stack/safety/nodes/*", *others])
        (folder / "setup.cfg").write_text(SETUP.format(tests=tests, kept=kept))
        (folder / "pytest.ini").write_text(PYTEST)

    def run(self, names: list[str]) -> None:
        """Runs the named mutants, or all if the list is empty. Raises RuntimeError if mutmut fails."""
        log = self._folder / "mutmut.log"
        command = [sys.executable, "-m", "mutmut", "run", "--max-children", "1", *names]
        with open(log, "wb") as output:
            code = subprocess.run(command, cwd=self._folder, stdout=output, stderr=subprocess.STDOUT).returncode
        if code:
            raise RuntimeError(f"mutmut failed with {code}:\n{log.read_text(errors='replace')[-3000:]}")

    def exit_codes(self) -> dict[str, int | None]:
        """Exit code of the tests by mutant; None if it has not run."""
        codes: dict[str, int | None] = {}
        for file in sorted((self._folder / "mutants").rglob("*.meta")):
            codes |= json.loads(file.read_text())["exit_code_by_key"]
        return codes

    def change(self, name: str) -> Change:
        shown = subprocess.run(
            [sys.executable, "-m", "mutmut", "show", name], cwd=self._folder, capture_output=True, text=True, check=True
        ).stdout.splitlines()
        return Change(name.rpartition("__mutmut_")[0], _lines(shown, "-"), _lines(shown, "+"))


def _lines(diff: list[str], sign: str) -> str:
    return " ".join(line[1:].strip() for line in diff if line.startswith(sign) and not line.startswith(sign * 3))


def listed() -> dict[Change, str]:
    """The listed equivalent mutants with their reasons."""
    entries = yaml.safe_load(EQUIVALENT.read_text()) or []
    return {Change(entry["function"], entry["removed"], entry["added"]): entry["why"] for entry in entries}


def check_mutants(
    folder: Path, sample: int | None = None, seed: int = 0, module: str | None = None, only: str = ""
) -> Result:
    """Checks all mutants or a sample; with ``module`` only those of the module.

    A sample needs the module ``timing``, which contains FIRST. only: a regular expression for the mutant's name.
    """
    known = listed()
    own = f"{ALL_TESTS}/test_{module}.py"
    has_own = (ROOT / own).is_file()
    workshop = Workshop(folder / "first", module, own if has_own else ALL_TESTS)
    every, chosen = _run(workshop, sample, seed, only, whole=module is not None and sample is None)
    survived = {name: workshop.change(name) for name in _survivors(workshop, chosen)}
    equivalent = tuple(change for change in survived.values() if change in known)
    unexplained = [name for name, change in survived.items() if change not in known]
    if unexplained and has_own:
        workshop = Workshop(folder / "second", module)
        workshop.run(unexplained)
        unexplained = _survivors(workshop, unexplained)
    killed = len(chosen) - len(equivalent) - len(unexplained)
    return Result(len(every), len(chosen), killed, equivalent, tuple(survived[name] for name in unexplained))


def _run(workshop: Workshop, sample: int | None, seed: int, only: str, *, whole: bool) -> tuple[list[str], list[str]]:
    """(names of all mutants, names of the chosen mutants, which have run). whole: runs all at once."""
    workshop.run([] if whole else [FIRST])
    every = sorted(workshop.exit_codes())
    chosen = [name for name in every if re.search(only, name)]
    if sample is not None:
        others = [name for name in chosen if name != FIRST]
        chosen = [FIRST, *random.Random(seed).sample(others, min(sample - 1, len(others)))]
    if chosen and chosen != [FIRST] and not whole:
        workshop.run(chosen if chosen != every else [])
    return every, chosen


def _survivors(workshop: Workshop, names: list[str]) -> list[str]:
    codes = workshop.exit_codes()
    missed = [name for name in names if codes[name] is None]
    if missed:
        raise RuntimeError(f"mutmut did not run {', '.join(missed)}")
    return [name for name in names if codes[name] in SURVIVED]


def main() -> int:
    parser = argparse.ArgumentParser(description="Mutation testing of the safety kernel.")
    parser.add_argument("--sample", type=int, help="check so many mutants instead of all")
    parser.add_argument("--module", help="of this module alone, by its own tests if it has any")
    parser.add_argument("--only", default="", help="check those in whose name this regular expression is found")
    parser.add_argument("--seed", type=int, default=0, help="of the sample")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="safety-mutants-") as folder:
        result = check_mutants(Path(folder), arguments.sample, arguments.seed, arguments.module, arguments.only)
    for change in result.unexplained:
        print(f"survived: {change}")
    print(
        f"{result.checked} of {result.of} mutants: {result.killed} killed, {len(result.equivalent)} equivalent, "
        f"{len(result.unexplained)} survived; score {result.score:.1%}"
    )
    return 1 if result.unexplained else 0


if __name__ == "__main__":
    sys.exit(main())
