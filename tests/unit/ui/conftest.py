"""Parameters of the touch screen as configured, with a PIN."""

from __future__ import annotations

import pytest

from robot_stack.core.config import load
from robot_stack.ui.params import TouchUiParams
from robot_stack.ui.pin import hash_pin

PIN = "2468"


@pytest.fixture(scope="session")
def params() -> TouchUiParams:
    plain = load(TouchUiParams, "touch_ui")
    return plain.model_copy(update={"access": plain.access.model_copy(update={"pin_hash": hash_pin(PIN)})})
