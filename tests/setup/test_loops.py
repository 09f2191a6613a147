"""The set-up compiles every loop and reports a failure."""

from __future__ import annotations

import numba
import pytest

from sim import compile as module


def test_every_loop_of_the_packages_is_compiled() -> None:
    loops = module.loops()
    assert len(loops) > 150
    assert module.missing(loops) == []


def test_a_loop_that_no_warm_up_reaches_fails_the_set_up(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @numba.njit(cache=True)
    def forgotten(x: float) -> float:
        return 2.0 * x

    monkeypatch.setattr(module, "loops", lambda: {"robot_stack.forgotten": forgotten})
    monkeypatch.setattr(module, "warm_ups", lambda: ["sim.arm.warm_up"])
    assert module.main() == 1
    assert "no warm_up() reaches: robot_stack.forgotten" in capsys.readouterr().err
