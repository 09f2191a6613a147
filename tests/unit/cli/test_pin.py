"""robot-stack pin: the printed line is a valid configuration of the PIN."""

from __future__ import annotations

import yaml
from typer.testing import CliRunner

from robot_stack.cli.app import app
from robot_stack.ui.pin import verify_pin


def test_the_line_is_for_the_configuration() -> None:
    result = CliRunner().invoke(app, ["pin", "--pin", "1357"])
    assert result.exit_code == 0
    assert verify_pin(yaml.safe_load(result.output)["pin_hash"], "1357")


def test_pin_of_wrong_length_is_rejected() -> None:
    result = CliRunner().invoke(app, ["pin", "--pin", "12"])
    assert result.exit_code != 0
    assert "4 to 12 digits" in str(result.exception)
