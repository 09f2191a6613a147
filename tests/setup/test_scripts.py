"""The set-up: behaviour without changes, error messages, and guarantees of the lock."""

from __future__ import annotations

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from tests.support.sourced import source

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "launch_scripts"
LOCK = ROOT / "requirements.lock"


def run_setup(**environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [SCRIPTS / "setup"],
        env={**os.environ, **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )


def locked_packages() -> dict[str, list[str]]:
    """Name -> lines of every package in the lock."""
    packages: dict[str, list[str]] = {}
    name = ""
    for line in LOCK.read_text().splitlines():
        if not line.startswith((" ", "#")):
            name = re.split(r"[=\[ ]", line)[0]
            packages.setdefault(name, [])
        packages[name].append(line)
    return packages


def declared_dependencies() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    groups = [project["project"]["dependencies"], *project["dependency-groups"].values()]
    names = {re.split(r"[^A-Za-z0-9_.-]", entry)[0] for group in groups for entry in group}
    return {re.sub(r"[-_.]+", "-", name).lower() for name in names}


def test_second_run_has_nothing_to_do_also_beside_a_sourced_ros(tmp_path: Path) -> None:
    assert run_setup().returncode == 0
    again = run_setup(**source(tmp_path / "ros", os.environ))

    assert again.returncode == 0
    assert "nothing to do" in again.stdout


def test_unusable_python_is_refused_with_advice() -> None:
    result = run_setup(PYTHON="/bin/false")

    assert result.returncode == 1
    assert "no usable Python among: /bin/false" in result.stderr
    assert "3.11, 3.12 or 3.13" in result.stderr


def test_missing_compiler_is_named_with_advice() -> None:
    result = run_setup(CXX="/no/such/compiler")

    assert result.returncode == 1
    assert "no C++ compiler (/no/such/compiler)" in result.stderr


@pytest.mark.parametrize("code", [0, 1, 3])
def test_nothing_is_repeated(tmp_path: Path, code: int) -> None:
    """Runs ``given_tests`` of launch_scripts/lib/tests.sh; its fake Python exits with ``code`` and records calls."""
    functions = (SCRIPTS / "lib" / "tests.sh").read_text()
    fake = f'python() {{ echo "$@" >>calls; return {code}; }}'
    script = f"set -uo pipefail\n{fake}\n{functions}\ngiven_tests some/test.py\n"
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == code
    assert (tmp_path / "calls").read_text().splitlines() == ["-m pytest -o cache_dir=.pytest_cache/given some/test.py"]


PROGRAMS = sorted(path for path in SCRIPTS.iterdir() if path.is_file() and path.suffix != ".service")


@pytest.mark.parametrize("script", PROGRAMS, ids=lambda p: p.name)
def test_launch_scripts_are_thin(script: Path) -> None:
    assert len(script.read_text().splitlines()) < 40


def test_every_locked_package_is_pinned_and_hashed() -> None:
    packages = locked_packages()

    assert len(packages) > 100
    pinned = r"{}(\[[a-z,]+\])?==\d"  # pip lists a package required with extras under that name
    assert [name for name, lines in packages.items() if not re.match(pinned.format(name), lines[0])] == []
    assert [name for name, lines in packages.items() if not any("--hash=sha256:" in line for line in lines)] == []


def test_lock_holds_every_declared_dependency() -> None:
    """If an entry of pyproject.toml is missing here: run launch_scripts/lock."""
    assert declared_dependencies() - set(locked_packages()) == set()


def test_lock_names_no_host() -> None:
    """Each machine configures its own package index."""
    suspicious = re.compile(r"://|--index-url|--extra-index-url|--find-links|--trusted-host|file:")

    assert [line for line in LOCK.read_text().splitlines() if suspicious.search(line)] == []
