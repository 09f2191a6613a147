"""Digital I/O services against a process image of eight bytes."""

from __future__ import annotations

import pytest

from robot_stack.wmx.api import ErrorCode, error_text
from robot_stack.wmx.services.digital_io import read_bit, read_bytes, write_bit, write_bytes


class FakeIo:
    """Eight bytes in and out. ``code``: what every call answers instead."""

    def __init__(self) -> None:
        self.inputs = bytearray([0b1010, 1, 2, 3, 4, 5, 6, 7])
        self.outputs = bytearray(8)
        self.code = 0
        self.calls = 0

    def _code(self, byte: int, size: int = 1) -> int:
        self.calls += 1
        return self.code or (0 if byte + size <= 8 else int(ErrorCode.IOAddressOutOfRange))

    def _bit(self, image: bytearray, byte: int, bit: int) -> tuple[int, int]:
        code = self._code(byte)
        return (code, 0) if code else (0, image[byte] >> bit & 1)

    def _bytes(self, image: bytearray, byte: int, size: int) -> tuple[int, list[int]]:
        code = self._code(byte, size)
        return (code, []) if code else (0, list(image[byte : byte + size]))

    def GetInBit(self, byte: int, bit: int) -> tuple[int, int]:
        return self._bit(self.inputs, byte, bit)

    def GetOutBit(self, byte: int, bit: int) -> tuple[int, int]:
        return self._bit(self.outputs, byte, bit)

    def GetInBytes(self, byte: int, size: int) -> tuple[int, list[int]]:
        return self._bytes(self.inputs, byte, size)

    def GetOutBytes(self, byte: int, size: int) -> tuple[int, list[int]]:
        return self._bytes(self.outputs, byte, size)

    def SetOutBit(self, byte: int, bit: int, value: int) -> int:
        code = self._code(byte)
        if not code:
            self.outputs[byte] = self.outputs[byte] & ~(1 << bit) | value << bit
        return code

    def SetOutBytes(self, byte: int, size: int, data: list[int]) -> int:
        assert size == len(data)
        code = self._code(byte, size)
        if not code:
            self.outputs[byte : byte + size] = bytes(data)
        return code

    @staticmethod
    def ErrorToString(code: int) -> str:
        return error_text(code, ErrorCode)


@pytest.fixture
def io() -> FakeIo:
    return FakeIo()


def test_input_bits(io: FakeIo) -> None:
    assert [read_bit(io, "input", 0, bit).value for bit in range(8)] == [0, 1, 0, 1, 0, 0, 0, 0]
    answer = read_bit(io, "input", 0, 3).answer
    assert (answer.success, answer.message) == (True, "Input bit 0.3 is 1")


def test_written_bit_is_read_back_and_its_neighbours_stay(io: FakeIo) -> None:
    io.outputs[2] = 0b1001
    answer = write_bit(io, 2, 1, 1)
    assert (answer.success, answer.message) == (True, "Set output bit 2.1 to 1")
    assert io.outputs[2] == 0b1011
    assert read_bit(io, "output", 2, 1).value == 1
    assert write_bit(io, 2, 0, 0).success
    assert io.outputs[2] == 0b1010


def test_bytes(io: FakeIo) -> None:
    read = read_bytes(io, "input", 1, 3)
    assert (read.data, read.answer.message) == (bytes([1, 2, 3]), "Read 3 input bytes from 1")
    answer = write_bytes(io, 6, bytes([255, 0]))
    assert (answer.success, answer.message) == (True, "Set 2 output bytes from 6")
    assert read_bytes(io, "output", 5, 3).data == bytes([0, 255, 0])


@pytest.mark.parametrize(
    ("byte", "bit", "value", "says"),
    [
        (-1, 0, 1, "byte must be in 0..7999, is -1"),
        (8000, 0, 1, "byte must be in 0..7999, is 8000"),
        (0, -1, 1, "bit must be in 0..7, is -1"),
        (0, 8, 1, "bit must be in 0..7, is 8"),
        (0, 0, 2, "value must be 0 or 1, is 2"),
        (0, 0, -1, "value must be 0 or 1, is -1"),
    ],
)
def test_what_is_out_of_range_does_not_reach_the_engine(io: FakeIo, byte: int, bit: int, value: int, says: str) -> None:
    answer = write_bit(io, byte, bit, value)
    assert not answer.success
    assert answer.message == f"Failed to set output bit {byte}.{bit} to {value}: {says}"
    if value == 1:
        read = read_bit(io, "input", byte, bit)
        assert (read.answer.success, read.value) == (False, 0)
        assert read.answer.message == f"Failed to read input bit {byte}.{bit}: {says}"
    assert io.calls == 0


@pytest.mark.parametrize("length", [0, -1, 8001])
def test_lengths_out_of_range(io: FakeIo, length: int) -> None:
    read = read_bytes(io, "output", 0, length)
    assert (read.answer.success, read.data) == (False, b"")
    assert f"length must be in 1..8000, is {length}" in read.answer.message
    assert io.calls == 0


def test_nothing_to_write_is_refused(io: FakeIo) -> None:
    assert "length must be in 1..8000, is 0" in write_bytes(io, 0, b"").message


def test_refusals_of_the_engine_carry_number_and_text(io: FakeIo) -> None:
    text = "Error=1550 (the I/O address is out of range)"
    assert read_bit(io, "input", 9, 0).answer.message == f"Failed to read input bit 9.0. {text}"
    assert read_bytes(io, "output", 7, 2).answer.message == f"Failed to read 2 output bytes from 7. {text}"
    assert write_bit(io, 9, 0, 1).message == f"Failed to set output bit 9.0 to 1. {text}"
    io.code = int(ErrorCode.CommNotStarted)
    assert read_bit(io, "input", 0, 0).answer.message.endswith("Error=1537 (communication is not started)")


def test_answer_of_the_wrong_length_is_none(io: FakeIo) -> None:
    io._bytes = lambda image, byte, size: (0, [1])  # type: ignore[method-assign]
    read = read_bytes(io, "input", 0, 2)
    assert (read.answer.success, read.data) == (False, b"")
