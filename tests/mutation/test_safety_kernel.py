"""The safety kernel: every branch is tested, and a sample of mutants is detected."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutation.safety_kernel import ROOT, check_mutants

# The slowest tests. Tracing triples their time, and the other tests reach every branch.
UNTRACED = (
    "tests/unit/safety/test_stories.py",
    *(
        f"tests/unit/safety/test_release.py::{name}"
        for name in (
            "TestTwoKeys",
            "test_a_button_that_is_not_expected_is_not_missed",
            "test_a_limit_that_is_not_obeyed_is_an_emergency",
            "test_a_release_from_before_a_restart_does_not_count",
            "test_a_reset_before_the_release_does_not_count",
        )
    ),
    "tests/unit/safety/test_slope.py::test_downhill_motion_is_permitted_after_any_history",
)
SAMPLE = 3  # of one small module, which shows that the tool works; the whole kernel takes hours


@pytest.mark.timeout(3600)  # takes three minutes at the lowest priority
def test_every_branch_of_the_kernel_is_tested(tmp_path: Path) -> None:
    coverage = [sys.executable, "-m", "coverage"]
    data = f"--data-file={tmp_path / 'coverage'}"
    run = [*coverage, "run", data, "--branch", "--source=robot_stack.safety", "--omit=*/safety/nodes/*"]
    # Under coverage and load a single test may take minutes, so only this test's own limit applies.
    tests = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "--timeout=0"]
    traced = ["tests/unit/safety", *(f"--deselect={name}" for name in UNTRACED)]
    subprocess.run([*run, *tests, *traced], cwd=ROOT, check=True)
    subprocess.run([sys.executable, *tests, *UNTRACED], cwd=ROOT, check=True)
    report = [*coverage, "report", data, "--show-missing", "--fail-under=100"]
    result = subprocess.run(report, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_sample_of_mutants_is_noticed(tmp_path: Path) -> None:
    result = check_mutants(tmp_path, SAMPLE, module="timing")
    assert result.checked == SAMPLE
    assert not result.unexplained, "\n".join(map(str, result.unexplained))
