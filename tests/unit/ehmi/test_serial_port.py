"""The display's port: an exception of a library leaves the link able to open the port again."""

from __future__ import annotations

import termios
from typing import NoReturn

import pytest
import serial

from robot_stack.core.config import load
from robot_stack.ehmi.link import Shown
from robot_stack.ehmi.nodes.serial_port import SerialPort
from robot_stack.ehmi.params import EhmiParams
from tests.support.waiting import wait_for

PARAMS = load(EhmiParams, "ehmi_bridge").link.model_copy(update={"back_off_s": 0.001})


def test_port_that_disappears_while_it_is_set_is_opened_again(monkeypatch: pytest.MonkeyPatch) -> None:
    errors: list[Exception] = [termios.error(5, "Input/output error")]

    def open_port(*_arguments: object, **_options: object) -> NoReturn:
        raise errors.pop() if errors else FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(serial, "Serial", open_port)
    port = SerialPort("/dev/display", 115200, PARAMS, Shown(1, "ja", 5))
    try:
        expected = "/dev/display cannot be opened: No such file or directory"
        wait_for(lambda: port.status().text == expected, "the second try")
    finally:
        port.close()
