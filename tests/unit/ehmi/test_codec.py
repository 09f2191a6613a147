"""The line protocol: for any corruption of the bytes, no command other than the sent one is decoded."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.contract.display import LANGUAGES
from robot_stack.ehmi import codec
from robot_stack.ehmi.codec import Command, Decoder, Fault, Kind, Ok, Ready, Refused

COMMANDS = [
    *(codec.state_command(state) for state in sorted(codec.STATES)),
    *(codec.language_command(language) for language in LANGUAGES),
    *(codec.volume_command(volume) for volume in range(codec.HIGHEST_VOLUME + 1)),
    codec.PING,
]
commands = st.sampled_from(COMMANDS)
texts = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E, exclude_characters="*"), min_size=1, max_size=77)


def decoded(data: bytes, *, checksum: bool = True) -> list[str]:
    return Decoder(checksum=checksum).feed(data)


# --- lines -----------------------------------------------------------------------------------------------------------


def test_golden_lines():
    assert codec.encode("STATE 21") == b"STATE 21*74\n"
    assert codec.encode("LANG ja") == b"LANG ja*2F\n"
    assert codec.encode("VOL 5") == b"VOL 5*40\n"
    assert codec.encode("PING") == b"PING*10\n"
    assert codec.encode("READY", checksum=False) == b"READY\n"


@given(texts, st.booleans())
def test_round_trip(text, checksum):
    assert decoded(codec.encode(text, checksum=checksum), checksum=checksum) == [text]


@given(st.lists(texts, max_size=6), st.data())
def test_any_split(lines, data):
    stream = b"".join(codec.encode(text) for text in lines)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    decoder, found = Decoder(), []
    for begin, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += decoder.feed(stream[begin:end])
    assert found == lines
    assert not decoder.rejected


@pytest.mark.parametrize("end", [b"\n", b"\r", b"\r\n", b"\n\r\n\n"])
def test_every_end_of_a_line(end):
    line = codec.encode("PING").rstrip(b"\n")
    assert decoded(line + end + line + end) == ["PING", "PING"]


def test_checksums_may_be_in_small_letters_and_an_optional_one_is_verified():
    assert decoded(b"LANG ja*2f\n") == ["LANG ja"]
    assert decoded(b"PING\nPING*10\nPING*11\n", checksum=False) == ["PING", "PING"]


@given(commands, st.data())
def test_a_changed_byte_gives_no_other_command(command, data):
    """The line is between two valid ones, to cover line ends that are added or lost."""
    line = codec.encode(command.text)
    place = data.draw(st.integers(0, len(line) - 1))
    value = data.draw(st.integers(0, 255).filter(lambda byte: byte != line[place]))
    changed = line[:place] + bytes([value]) + line[place + 1 :]
    before, after = codec.encode("VOL 1"), codec.encode("VOL 2")
    found = [codec.parse_command(text) for text in decoded(before + changed + after)]
    allowed = {codec.volume_command(1), codec.volume_command(2), command, None}
    assert set(found) <= allowed
    assert found[0] == codec.volume_command(1)


@given(st.lists(st.binary(max_size=200), max_size=10), commands)
def test_junk_never_raises_and_ends_with_its_line(junk, command):
    decoder = Decoder()
    for piece in junk:
        for text in decoder.feed(piece):
            codec.parse_answer(text)
            codec.parse_command(text)
    decoder.feed(b"\n")
    assert decoder.feed(codec.encode(command.text)) == [command.text]


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (b"PING", "no checksum"),
        (b"PING*11", "wrong checksum"),
        (b"PING*1", "wrong checksum"),
        (b"PING*010", "wrong checksum"),
        (b"PING*+1", "wrong checksum"),
        (b"PING* 1", "wrong checksum"),
        (b"*00", "wrong checksum"),
        (b"A*41*2A", "wrong checksum"),
        (b"PI\x00NG*10", "not ASCII"),
        ("PİNG*10".encode(), "not ASCII"),
        (b"A" * 81, "too long"),
        (b"A" * 5000, "too long"),
    ],
)
def test_malformed_line_is_counted_and_dropped(line, problem):
    decoder = Decoder()
    assert decoder.feed(line + b"\n") == []
    assert dict(decoder.rejected) == {problem: 1}
    assert decoder.feed(codec.encode("PING")) == ["PING"]


def test_the_longest_line():
    text = "A" * (codec.LONGEST_LINE - 3)
    assert decoded(codec.encode(text)) == [text]
    with pytest.raises(ValueError, match="too long"):
        codec.encode(text + "A")


def test_a_half_line_is_forgotten_on_a_new_connection():
    decoder = Decoder()
    decoder.feed(b"STATE 2")
    decoder.reset()
    assert decoder.feed(codec.encode("PING")) == ["PING"]
    decoder.feed(b"A" * 100)
    decoder.reset()
    assert decoder.feed(codec.encode("PING")) == ["PING"]


@pytest.mark.parametrize("text", ["", "A*B", "A\nB", "é", "A\x7f"])
def test_unencodable_text_is_rejected(text):
    with pytest.raises(ValueError, match=r"cannot be sent|ascii"):
        codec.encode(text)


# --- content of lines ------------------------------------------------------------------------------------------------


@given(commands)
def test_a_command_is_parsed_to_itself(command):
    assert codec.parse_command(command.text) == command
    assert codec.parse_answer(f"OK {command.text}") == Ok(command)


@pytest.mark.parametrize(
    "text",
    ["", "STATE", "STATE ", "STATE 11", "STATE 20", "STATE 29", "STATE 021", "STATE +1", "STATE  1", "STATE 1 ",
     "STATE -1", "STATE 1_0", "STATE ２", "STATE 999999999999", "state 1", "LANG de", "LANG", "VOL 11", "VOL 05",
     "VOL x", "PING 1", "PING ", "FLY 1"],
)  # fmt: skip
def test_malformed_command_is_not_parsed(text):
    assert codec.parse_command(text) is None
    assert codec.parse_answer(f"OK {text}") is None


@pytest.mark.parametrize(
    ("text", "answer"),
    [
        ("OK PING", Ok(Command(Kind.PING))),
        ("ERROR unknown command", Refused("unknown command")),
        ("ERROR", Refused("")),
        ("READY", Ready()),
        ("READY now", None),
        ("FAULT LED_DRIVER", Fault("LED_DRIVER")),
        ("FAULT NONE", Fault("")),
        ("FAULT", None),
        ("HELLO", None),
        ("", None),
    ],
)
def test_answers(text, answer):
    assert codec.parse_answer(text) == answer


@pytest.mark.parametrize(
    ("make", "value"),
    [
        (codec.state_command, 11),
        (codec.state_command, 29),
        (codec.state_command, -1),
        (codec.language_command, "de"),
        (codec.volume_command, 11),
    ],
)
def test_commands_that_do_not_exist(make, value):
    with pytest.raises(ValueError, match="no command"):
        make(value)
