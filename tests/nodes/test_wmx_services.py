"""The optional services of the motion engine, called by a plain ROS client."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import Bool

from robot_stack.contract import services, topics
from robot_stack.contract.model import Service
from robot_stack.ros.interfaces import interface_class
from robot_stack.wmx.api import Motion_JogCommand, Profile
from robot_stack.wmx.config import ENGINE_CONFIG_VARIABLE
from tests.support.engine import TestEngine
from tests.support.peer import Peer
from tests.support.processes import NodeProcess
from tests.support.waiting import wait_for

NO_ENGINE = "Error=301 (there is no open device)"


class Rig:
    """An engine of four position axes that communicates, and a client."""

    def __init__(self, start: Callable[..., NodeProcess], peer: Peer, folder: Path) -> None:
        self.start, self.peer = start, peer
        self.engine = TestEngine(start, folder)

    def start_engine(self) -> None:
        self.engine.run()
        assert self.engine.device.api.StartCommunication(20000) == 0

    def call(self, row: Service, **fields: Any) -> Any:
        return self.peer.call(row, interface_class(row.type).Request(**fields))

    def wait_connected(self, row: Service, **fields: Any) -> None:
        wait_for(lambda: NO_ENGINE not in self.call(row, **fields).message, "the node to find the engine")


@pytest.fixture
def rig(
    start: Callable[..., NodeProcess], peer: Peer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Rig]:
    monkeypatch.setenv(ENGINE_CONFIG_VARIABLE, "wmx_engine_general")
    rig = Rig(start, peer, tmp_path)
    yield rig
    rig.engine.close()


def said(response: Any) -> tuple[bool, str]:
    return response.success, response.message


def test_digital_io(rig: Rig) -> None:
    node = rig.start("wmx_io_node")
    assert said(rig.call(services.IO_GET_INPUT_BIT)) == (False, f"Failed to read input bit. {NO_ENGINE}")
    assert said(rig.call(services.IO_SET_OUTPUT_BYTES, data=[1])) == (False, f"Failed to set output bytes. {NO_ENGINE}")
    rig.start_engine()
    rig.wait_connected(services.IO_GET_INPUT_BIT)

    rig.engine.set(input0=0b0110)
    wait_for(lambda: bytes(rig.call(services.IO_GET_INPUT_BYTES, byte=0, length=1).data) == b"\x06", "the inputs")
    bits = [rig.call(services.IO_GET_INPUT_BIT, byte=0, bit=bit).value for bit in range(4)]
    assert bits == [0, 1, 1, 0]
    assert said(rig.call(services.IO_GET_INPUT_BIT, byte=0, bit=1)) == (True, "Input bit 0.1 is 1")

    assert said(rig.call(services.IO_SET_OUTPUT_BIT, byte=1, bit=2, value=1)) == (True, "Set output bit 1.2 to 1")
    wait_for(lambda: rig.call(services.IO_GET_OUTPUT_BIT, byte=1, bit=2).value == 1, "the output")
    assert said(rig.call(services.IO_SET_OUTPUT_BYTES, byte=6, data=[255, 7])) == (True, "Set 2 output bytes from 6")
    wait_for(lambda: bytes(rig.call(services.IO_GET_OUTPUT_BYTES, byte=5, length=3).data) == b"\0\xff\x07", "outputs")

    for row, fields, says in (
        (services.IO_GET_INPUT_BIT, {"bit": 8}, "Failed to read input bit 0.8: bit must be in 0..7, is 8"),
        (services.IO_GET_OUTPUT_BIT, {"byte": -1}, "Failed to read output bit -1.0: byte must be in 0..7999, is -1"),
        (services.IO_GET_INPUT_BYTES, {}, "Failed to read 0 input bytes from 0: length must be in 1..8000, is 0"),
        (
            services.IO_GET_OUTPUT_BYTES,
            {"byte": 7, "length": 2},
            "Failed to read 2 output bytes from 7. Error=1551 (the I/O size is out of range)",
        ),
        (
            services.IO_GET_INPUT_BIT,
            {"byte": 8},
            "Failed to read input bit 8.0. Error=1550 (the I/O address is out of range)",
        ),
        (services.IO_SET_OUTPUT_BIT, {"value": 2}, "Failed to set output bit 0.0 to 2: value must be 0 or 1, is 2"),
        (services.IO_SET_OUTPUT_BYTES, {}, "Failed to set 0 output bytes from 0: length must be in 1..8000, is 0"),
        (
            services.IO_SET_OUTPUT_BYTES,
            {"byte": 7, "data": [1, 2]},
            "Failed to set 2 output bytes from 7. Error=1551 (the I/O size is out of range)",
        ),
    ):
        assert said(rig.call(row, **fields)) == (False, says)
    assert bytes(rig.call(services.IO_GET_OUTPUT_BYTES, byte=7, length=1).data) == b"\x07", (
        "a refused write writes nothing"
    )

    # An emergency stop forbids what may move something, and a lost bus has no inputs.
    rig.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    stopped = (False, "Failed to set outputs: /emergency_stop is in force")
    wait_for(lambda: said(rig.call(services.IO_SET_OUTPUT_BIT, byte=1, bit=2, value=1)) == stopped, "the refusal")
    assert said(rig.call(services.IO_SET_OUTPUT_BYTES, byte=1, data=[0])) == stopped
    assert rig.call(services.IO_GET_OUTPUT_BIT, byte=1, bit=2).value == 1
    rig.engine.set(connected=False)
    lost = "Failed to read input bit 0.1. Error=1537 (communication is not started)"
    wait_for(lambda: said(rig.call(services.IO_GET_INPUT_BIT, byte=0, bit=1)) == (False, lost), "the lost bus")

    rig.engine.kill()
    wait_for(lambda: not rig.call(services.IO_GET_OUTPUT_BIT).success, "the dead engine")
    assert node.running()


def test_parameters(rig: Rig, tmp_path: Path) -> None:
    rig.start("wmx_params_node")
    assert said(rig.call(services.PARAMS_LOAD, file_path="/p.xml")) == (
        False,
        f"Failed to load parameters. {NO_ENGINE}",
    )
    assert said(rig.call(services.PARAMS_GET)) == (False, f"Failed to get parameters. {NO_ENGINE}")
    rig.start_engine()
    rig.wait_connected(services.PARAMS_GET)

    every = rig.call(services.PARAMS_GET)
    assert [text.splitlines()[0] for text in every.params_dump] == [f"axis: {axis}" for axis in range(4)]
    shown = rig.call(services.PARAMS_GET, index=[2])
    assert said(shown) == (True, "Parameters of axis 2; ")
    assert shown.params_dump[0].splitlines()[:3] == ["axis: 2", "gear ratio: 16384 / 6.28318530718", "polarity: 1"]
    unknown = rig.call(services.PARAMS_GET, index=[4, 0])
    assert not unknown.success
    assert unknown.message.startswith(
        "Failed to get gear ratio of axis 4. Error=1547 (the axis number is out of range); "
    )
    assert unknown.params_dump[0] == ""

    file = str(tmp_path / "all.xml")
    config = rig.engine.device.core_motion.config
    assert config.GetAndExportAll(file) == 0
    assert config.SetAxisPolarity(2, -1) == 0
    assert "polarity: -1" in rig.call(services.PARAMS_GET, index=[2]).params_dump[0]
    assert said(rig.call(services.PARAMS_LOAD, file_path=file)) == (True, f"Loaded parameters from {file}")
    assert rig.call(services.PARAMS_GET).params_dump == every.params_dump

    missing = rig.call(services.PARAMS_LOAD, file_path=f"{file}.none")
    assert said(missing)[0] is False
    assert missing.message.startswith(f"Failed to load parameters from '{file}.none'. Error=1562 (")
    assert "file_path must be absolute" in rig.call(services.PARAMS_LOAD, file_path="all.xml").message
    motion = rig.engine.device.core_motion
    assert motion.axisControl.SetServoOn(1, 1) == 0
    wait_for(lambda: rig.engine.device.read_status()[1].servo_on[1], "the servo")
    assert motion.motion.StartJog(Motion_JogCommand(1, Profile.SetupTrapezoidal(0.1, 5.0, 5.0))) == 0
    moving = (False, f"Failed to load parameters from '{file}': axes 1 are moving")
    wait_for(lambda: said(rig.call(services.PARAMS_LOAD, file_path=file)) == moving, "the refusal while it moves")


def test_ethercat_network(rig: Rig) -> None:
    rig.start("wmx_ethercat_node")
    for row, failed in (
        (services.ECAT_GET_NETWORK_STATE, "Failed to get network state"),
        (services.ECAT_REGISTER_READ, "Failed to read registers"),
        (services.ECAT_RESET_STATISTICS, "Failed to reset statistics"),
        (services.ECAT_START_HOTCONNECT, "Failed to start hot connect"),
    ):
        assert said(rig.call(row)) == (False, f"{failed}. {NO_ENGINE}")
    rig.start_engine()
    rig.wait_connected(services.ECAT_GET_NETWORK_STATE)

    state = rig.call(services.ECAT_GET_NETWORK_STATE)
    assert said(state) == (True, "Master 0 with 4 slaves")
    assert (state.master_state, state.comm_period, state.total_axes, state.num_of_slaves) == (8, 1_000_000, 4, 4)
    assert (list(state.slave_ids), list(state.slave_states)) == ([0, 1, 2, 3], [8, 8, 8, 8])
    assert list(state.slave_offline) == [False] * 4
    read = rig.call(services.ECAT_REGISTER_READ, slave_id=1, reg_address=0x130, length=2)
    assert said(read) == (True, "Read 2 register bytes of slave 1 from 0x130")
    assert bytes(read.data) == b"\x08\0"
    assert said(rig.call(services.ECAT_RESET_STATISTICS)) == (True, "Statistics reset of master 0")
    assert said(rig.call(services.ECAT_START_HOTCONNECT)) == (True, "Hot connect started of master 0")

    for row, fields, says in (
        (services.ECAT_GET_NETWORK_STATE, {"master_id": 1}, "master_id must be 0, is 1"),
        (services.ECAT_RESET_STATISTICS, {"master_id": -1}, "master_id must be 0, is -1"),
        (services.ECAT_START_HOTCONNECT, {"master_id": 1}, "master_id must be 0, is 1"),
        (services.ECAT_REGISTER_READ, {"master_id": 1, "length": 1}, "master_id must be 0, is 1"),
        (services.ECAT_REGISTER_READ, {"length": 0}, "length must be in 1..4096, is 0"),
        (services.ECAT_REGISTER_READ, {"reg_address": 4095, "length": 2}, "must be at most 0x1000, are 0x1001"),
        (services.ECAT_REGISTER_READ, {"slave_id": 4, "length": 1}, "Error=1555 (an argument is out of range)"),
    ):
        answer = rig.call(row, **fields)
        assert not answer.success
        assert answer.message.endswith(says)

    rig.engine.set(connected=False)
    lost = "Error=8194 (no slave can be connected without communication)"
    wait_for(lambda: rig.call(services.ECAT_START_HOTCONNECT).message.endswith(lost), "the lost bus")
    state = rig.call(services.ECAT_GET_NETWORK_STATE)
    assert (state.success, state.master_state) == (True, 1)
    assert state.packet_timeout == 1
