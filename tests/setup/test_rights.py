"""Rights of an ordinary user: the requested ones, the missing ones, and how to grant them."""

from __future__ import annotations

import resource
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from robot_stack.cli import checks
from robot_stack.cli import rights as module
from robot_stack.cli.rights import Right, rights
from robot_stack.supervisor.params import load_params

SCRIPTS = Path(__file__).resolve().parents[2] / "launch_scripts"
FILE = Path("etc/security/limits.d/robot_stack-@operators.conf")


def grant(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([SCRIPTS / "grant_rights", *arguments], capture_output=True, text=True, check=False)


def lines(who: str) -> list[str]:
    return [f"{who} - {right.item} {right.value}" for right in rights(load_params())]


def allow(monkeypatch: pytest.MonkeyPatch, limits: Mapping[int, int], capabilities: int = 0) -> None:
    monkeypatch.setattr(module, "_capabilities", lambda: capabilities)
    monkeypatch.setattr(resource, "getrlimit", lambda limit: (limits[limit], limits[limit]))


NOTHING = {resource.RLIMIT_RTPRIO: 0, resource.RLIMIT_NICE: 0, resource.RLIMIT_MEMLOCK: 8 << 20}
EVERYTHING = {resource.RLIMIT_RTPRIO: 5, resource.RLIMIT_NICE: 35, resource.RLIMIT_MEMLOCK: resource.RLIM_INFINITY}


def test_missing_rights_of_ordinary_user_are_reported_with_advice(monkeypatch: pytest.MonkeyPatch) -> None:
    allow(monkeypatch, NOTHING)
    found = list(checks.rights())
    assert [finding.what.partition(":")[0] for finding in found] == [
        "no real-time priority",
        "no nice values below 0",
        "no locked memory",
    ]
    for finding in found:
        assert finding.level is checks.Level.NOTE  # the simulation works without
        assert "grant_rights" in finding.advice
        assert "the simulation works without" in finding.advice


@pytest.mark.parametrize(("limits", "capabilities"), [(EVERYTHING, 0), (NOTHING, 1 << 14 | 1 << 23)])
def test_sufficient_limits_or_capabilities_are_reported_ok(
    monkeypatch: pytest.MonkeyPatch, limits: dict[int, int], capabilities: int
) -> None:
    allow(monkeypatch, limits, capabilities)
    assert [finding.level for finding in checks.rights()] == [checks.Level.OK]


@pytest.mark.parametrize("limit", list(EVERYTHING))
def test_each_limit_counts_for_itself(monkeypatch: pytest.MonkeyPatch, limit: int) -> None:
    allow(monkeypatch, {**EVERYTHING, limit: EVERYTHING[limit] - 1 if EVERYTHING[limit] > 0 else 1 << 40})
    assert len([right for right in rights(load_params()) if not right.granted]) == 1


def test_granted_rights_match_configuration() -> None:
    shown = grant("--print", "--root", "/nowhere", "@operators")
    assert shown.stdout.splitlines()[1:] == lines("@operators")


def test_the_systemd_unit_has_the_same_limits() -> None:
    unit = (SCRIPTS / "robot-stack.service").read_text()
    by_item: dict[str, Right] = {right.item: right for right in rights(load_params())}
    assert f"LimitRTPRIO={by_item['rtprio'].value}\n" in unit
    assert f"LimitNICE={by_item['nice'].value}\n" in unit
    assert "LimitMEMLOCK=infinity\n" in unit


def test_granting_twice_is_granting_once_and_can_be_undone(tmp_path: Path) -> None:
    assert grant("--root", str(tmp_path), "@operators").returncode == 0
    again = grant("--root", str(tmp_path), "@operators")
    assert again.returncode == 0
    assert "log in again" in again.stdout
    assert [path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()] == [FILE]
    assert (tmp_path / FILE).read_text().splitlines() == lines("@operators")
    assert grant("--root", str(tmp_path), "--undo", "@operators").returncode == 0
    assert grant("--root", str(tmp_path), "--undo", "@operators").returncode == 0
    assert not (tmp_path / FILE).exists()


@pytest.mark.parametrize(
    ("who", "said"),
    [
        ("a b", "is neither a user nor a group"),
        ("../../etc/x", "is neither a user nor a group"),
        ("no_such_user_here", "there is no no_such_user_here"),
        ("@no_such_group_here", "there is no @no_such_group_here"),
    ],
)
def test_grant_rejects_invalid_or_unknown_user(who: str, said: str) -> None:
    done = grant("--print", who)
    assert done.returncode == 2
    assert said in done.stderr
