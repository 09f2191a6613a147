"""The safety kernel: every branch is tested, and a sample of mutants is detected."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.mutation.safety_kernel import ROOT, check_mutants

# Tracing triples the time of a test. Those of random examples and the stories take the longest, and the others reach
# every branch.
UNTRACED = "hypothesis or test_stories"
SAMPLE = 3  # of one small module, which shows that the tool works; the whole kernel takes hours


@pytest.mark.timeout(3600)  # takes three minutes at the lowest priority
def test_every_branch_of_the_kernel_is_tested(tmp_path: Path) -> None:
    coverage = [sys.executable, "-m", "coverage"]
    data = f"--data-file={tmp_path / 'coverage'}"
    run = [*coverage, "run", data, "--branch", "--source=robot_stack.safety", "--omit=*/safety/nodes/*"]
    # Under coverage and load a single test may take minutes, so only this test's own limit applies.
    tests = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "--timeout=0", "tests/unit/safety", "-k"]
    subprocess.run([*run, *tests, f"not ({UNTRACED})"], cwd=ROOT, check=True)
    subprocess.run([sys.executable, *tests, UNTRACED], cwd=ROOT, check=True)
    report = [*coverage, "report", data, "--show-missing", "--fail-under=100"]
    result = subprocess.run(report, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_sample_of_mutants_is_noticed(tmp_path: Path) -> None:
    result = check_mutants(tmp_path, SAMPLE, module="timing")
    assert result.checked == SAMPLE
    assert not result.unexplained, "\n".join(map(str, result.unexplained))
