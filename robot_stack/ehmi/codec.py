"""The display's line protocol: ASCII lines, each with a checksum ``*hh`` as in NMEA 0183 (XOR of all bytes before it).

To the display: ``STATE 21``, ``LANG ja``, ``VOL 5``, ``PING``. From it: ``OK <echo of the command>``, ``ERROR <text>``,
``READY`` (it has started), ``FAULT <code>`` (``FAULT NONE``: over). The same module serves both ends of the line.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import Enum
from functools import reduce

from robot_stack.contract.display import LANGUAGES, Display

HIGHEST_VOLUME = 10
STATES = frozenset(map(int, Display))
LONGEST_LINE = 80  # bytes with checksum; as in NMEA 0183 a line that is longer is none
NO_FAULT = "NONE"

_PRINTABLE = range(0x20, 0x7F)
_CHECKSUM_LENGTH = len("*hh")


class Kind(Enum):
    """What a command sets; PING sets nothing."""

    STATE = "STATE"
    LANGUAGE = "LANG"
    VOLUME = "VOL"
    PING = "PING"


@dataclass(frozen=True, slots=True)
class Command:
    """One command. value: the part after the keyword, empty for PING."""

    kind: Kind
    value: str = ""

    @property
    def text(self) -> str:
        return f"{self.kind.value} {self.value}" if self.value else self.kind.value


PING = Command(Kind.PING)


@dataclass(frozen=True, slots=True)
class Ok:
    """The display has executed this command."""

    command: Command


@dataclass(frozen=True, slots=True)
class Refused:
    """The display rejected a line: unknown, or not executable."""

    text: str


@dataclass(frozen=True, slots=True)
class Ready:
    """The display has started and has lost all earlier settings."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of the display; an empty code means that it is over."""

    code: str


Answer = Ok | Refused | Ready | Fault


def state_command(state: int) -> Command:
    """Raises ValueError for a number that is not a state."""
    return _checked(Command(Kind.STATE, str(state)))


def language_command(language: str) -> Command:
    """Raises ValueError for a language that the display does not have."""
    return _checked(Command(Kind.LANGUAGE, language))


def volume_command(volume: int) -> Command:
    """Raises ValueError outside 0-10."""
    return _checked(Command(Kind.VOLUME, str(volume)))


def _checked(command: Command) -> Command:
    if parse_command(command.text) != command:
        raise ValueError(f"no command of the display: {command.text!r}")
    return command


def encode(text: str, *, checksum: bool = True) -> bytes:
    """The bytes of one line. Raises ValueError for invalid text."""
    body = text.encode("ascii")
    if not body or b"*" in body or any(byte not in _PRINTABLE for byte in body):
        raise ValueError(f"cannot be sent as a line: {text!r}")
    line = body + b"*%02X" % xor(body) if checksum else body
    if len(line) > LONGEST_LINE:
        raise ValueError(f"{len(line)} bytes are too long for a line: {text!r}")
    return line + b"\n"


def xor(body: bytes) -> int:
    """The checksum of a line's body, 0-255."""
    return reduce(lambda checksum, byte: checksum ^ byte, body, 0)


def parse_command(text: str) -> Command | None:
    """The command in a line, None if it is invalid: numbers have one notation, errors are not corrected."""
    keyword, separator, value = text.partition(" ")
    if text == Kind.PING.value:
        return PING
    if not separator:
        return None
    known = {
        Kind.STATE.value: (Kind.STATE, _number(value) in STATES),
        Kind.LANGUAGE.value: (Kind.LANGUAGE, value in LANGUAGES),
        Kind.VOLUME.value: (Kind.VOLUME, _number(value) in range(HIGHEST_VOLUME + 1)),
    }
    kind, valid = known.get(keyword, (Kind.PING, False))
    return Command(kind, value) if valid else None


def _number(text: str) -> int:
    """-1 unless the text is a number of at most two digits."""
    is_number = text.isascii() and text.isdigit() and len(text) <= 2
    return int(text) if is_number and str(int(text)) == text else -1


def parse_answer(text: str) -> Answer | None:
    """The answer in a line from the display, None if it is unknown."""
    keyword, _, rest = text.partition(" ")
    match keyword:
        case "OK":
            command = parse_command(rest)
            return Ok(command) if command else None
        case "ERROR":
            return Refused(rest)
        case "READY":
            return None if rest else Ready()
        case "FAULT":
            return Fault("" if rest == NO_FAULT else rest) if rest else None
    return None


class Decoder:
    """Splits a byte stream into lines. Invalid lines are counted in ``rejected`` and dropped.

    checksum: every line must carry its own. Otherwise a line without one is accepted; a wrong one is still rejected.
    """

    def __init__(self, *, checksum: bool = True) -> None:
        self._checksum = checksum
        self._buffer = bytearray()
        self._overlong = False
        self.rejected: Counter[str] = Counter()

    def reset(self) -> None:
        """Drops an incomplete line: the next bytes are from another connection."""
        self._buffer.clear()
        self._overlong = False

    def feed(self, data: bytes) -> list[str]:
        """The lines that ``data`` completes, without their checksums. CR, LF and CR LF all end a line."""
        lines = []
        for byte in data:
            if byte not in b"\r\n":
                self._take(byte)
                continue
            text = self._end_line()
            if text is not None:
                lines.append(text)
        return lines

    def _take(self, byte: int) -> None:
        if len(self._buffer) < LONGEST_LINE:
            self._buffer.append(byte)
        else:
            self._overlong = True

    def _end_line(self) -> str | None:
        line, overlong = bytes(self._buffer), self._overlong
        self.reset()
        if not line:
            return None
        text, problem = (None, "too long") if overlong else self._text(line)
        if text is None:
            self.rejected[problem] += 1
        return text

    def _text(self, line: bytes) -> tuple[str | None, str]:
        if any(byte not in _PRINTABLE for byte in line):
            return None, "not ASCII"
        body, star, digits = line.rpartition(b"*")
        if not star:
            return (None, "no checksum") if self._checksum else (line.decode("ascii"), "")
        if not body or b"*" in body or len(digits) + 1 != _CHECKSUM_LENGTH or _hexadecimal(digits) != xor(body):
            return None, "wrong checksum"
        return body.decode("ascii"), ""


def _hexadecimal(digits: bytes) -> int:
    return int(digits, 16) if all(digit in b"0123456789abcdefABCDEF" for digit in digits) else -1
