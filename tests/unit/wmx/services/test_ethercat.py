"""EtherCAT services: every field of the answer has its place in the engine's record, and refusals are named."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import EcStateMachine, ErrorCode
from robot_stack.wmx.services.ethercat import (
    MASTER,
    SLAVE_FLAGS,
    SLAVES,
    network_state,
    read_registers,
    reset_statistics,
    start_hotconnect,
)
from tests.unit.wmx.harness import N_AXES, Harness
from wmx_ros2_message.srv import EcatGetNetworkState


@pytest.fixture
def engine(harness: Harness) -> Iterator[MotionEngine]:
    yield harness.communicating()
    harness.end_test()


def test_every_field_of_the_answer_is_filled() -> None:
    fields = set(EcatGetNetworkState.Response.get_fields_and_field_types())
    assert set(MASTER) | set(SLAVES) | set(SLAVE_FLAGS) == fields - {"success", "message"}


def test_network_of_the_simulated_engine(engine: MotionEngine) -> None:
    state = network_state(engine.ecat, 0)
    assert (state.answer.success, state.answer.message) == (True, "Master 0 with 5 slaves")
    assert state.master["master_state"] == EcStateMachine.Op
    assert state.master["comm_period"] == 1_000_000
    assert state.master["total_axes"] == state.master["num_of_slaves"] == N_AXES
    assert state.slaves["slave_ids"] == list(range(N_AXES))
    assert state.slaves["slave_states"] == [8] * N_AXES
    assert state.slaves["slave_offline"] == [False] * N_AXES
    assert all(len(values) == N_AXES for values in state.slaves.values())


def test_registers(engine: MotionEngine) -> None:
    read = read_registers(engine.ecat, 0, 2, 0x0130, 2)
    assert (read.answer.message, read.data) == ("Read 2 register bytes of slave 2 from 0x130", b"\x08\0")
    assert len(read_registers(engine.ecat, 0, 0, 0, 0x1000).data) == 0x1000


@pytest.mark.parametrize(
    ("slave", "address", "length", "says"),
    [
        (-1, 0, 1, "slave_id must not be negative, is -1"),
        (0, -1, 1, "reg_address must be in 0..0xfff, is -0x1"),
        (0, 0x1000, 1, "reg_address must be in 0..0xfff, is 0x1000"),
        (0, 0, 0, "length must be in 1..4096, is 0"),
        (0, 0, 4097, "length must be in 1..4096, is 4097"),
        (0, 0xFFF, 2, "reg_address and length together must be at most 0x1000, are 0x1001"),
        (N_AXES, 0, 1, "Error=1555 (an argument is out of range)"),
    ],
)
def test_registers_that_are_none(engine: MotionEngine, slave: int, address: int, length: int, says: str) -> None:
    read = read_registers(engine.ecat, 0, slave, address, length)
    assert (read.answer.success, read.data) == (False, b"")
    assert read.answer.message.endswith(says)


def test_counters_and_hot_connect(engine: MotionEngine) -> None:
    assert reset_statistics(engine.ecat, 0).message == "Statistics reset of master 0"
    assert start_hotconnect(engine.ecat, 0).message == "Hot connect started of master 0"


def test_another_master_is_refused(engine: MotionEngine) -> None:
    answers = [
        network_state(engine.ecat, 1).answer,
        read_registers(engine.ecat, 1, 0, 0, 1).answer,
        reset_statistics(engine.ecat, 1),
        start_hotconnect(engine.ecat, 1),
    ]
    assert not any(answer.success for answer in answers)
    assert all(answer.message.endswith("master_id must be 0, is 1") for answer in answers)


def test_refusals_of_the_engine_carry_number_and_text(engine: MotionEngine) -> None:
    assert engine.api.StopCommunication(20000) == ErrorCode.PyNone
    refused = start_hotconnect(engine.ecat, 0)
    assert (refused.success, refused.message) == (
        False,
        "Failed to start hot connect of master 0. Error=8194 (no slave can be connected without communication)",
    )
    engine.close()
    assert "Failed to get network state of master 0. Error=301 (" in network_state(engine.ecat, 0).answer.message
