"""A ride at a site without a map: the distance until the safety monitor stops it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from robot_stack.core.config import load
from robot_stack.core.geometry import ZERO_TWIST, Twist2
from robot_stack.safety.params import SafetyParams
from robot_stack.supervisor.profile import load_plan
from tests.unit.localization.stories import Story, params, story

_WAY_M, _SPEED_MPS = 80.0, 0.9
_HALF = "quality.position_half_sigma_m"


def quality_after(half_sigma_m: float) -> float:
    """Returns the quality after 80 m straight ahead, preceded by 3 s at rest."""
    changed = {**params().quality.model_dump(), "position_half_sigma_m": half_sigma_m}
    ride: Story = story(params={"map": "", "quality": changed}, bias_radps=0.005, noise_radps=0.003)
    ride.drive(ZERO_TWIST, 3.0).drive(Twist2(_SPEED_MPS, 0.0, 0.0), _WAY_M / _SPEED_MPS)
    return ride.localizer.estimate(ride.t_s).quality


@pytest.fixture(scope="module")
def documented() -> dict[str, object]:
    """The parameters of ndt_localization that docs/mapping.md sets for such a ride."""
    text = (Path(__file__).resolve().parents[3] / "docs" / "mapping.md").read_text(encoding="utf-8")
    settings = re.findall(r"--set '?(\w+\.[\w.]+=[^'\s]+)'?", text)
    parameters = load_plan("robot", settings=settings).parameters
    assert parameters["navigation_controller"]["map"] == ""
    return parameters["ndt_localization"]


def test_dead_reckoning_is_soon_called_lost(documented):
    lost = load(SafetyParams, "safety_monitor").lost_quality
    assert quality_after(params().quality.position_half_sigma_m) < lost


def test_documented_settings_keep_quality_without_map(documented):
    assert documented["map"] == ""
    assert quality_after(documented[_HALF]) > 0.9
