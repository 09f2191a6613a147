"""How long navigation may stand with a goal, from its own parameters, for those who judge its progress."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from robot_stack.core.config import config_dir, read_yaml, validate

_Seconds = Annotated[float, Field(gt=0.0, le=600.0)]


class _Part(BaseModel):
    # The other parameters are navigation's own.
    model_config = ConfigDict(extra="ignore", frozen=True)


class _Passage(_Part):
    wait_s: _Seconds


class _Follow(_Part):
    give_up_s: _Seconds


class NavigationWaits(_Part):
    """Of ``config/navigation_controller.yaml``."""

    passage: _Passage
    follow: _Follow

    @property
    def longest_s(self) -> float:
        """Without progress: for a person at a narrow place, and then without a path until it gives up."""
        return self.passage.wait_s + self.follow.give_up_s


def load_navigation_waits() -> NavigationWaits:
    """Raises ConfigError."""
    path = config_dir() / "navigation_controller.yaml"
    return validate(NavigationWaits, read_yaml(path), str(path))
