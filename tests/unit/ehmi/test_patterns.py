"""The table of patterns: complete, calm, and never colour or sound alone; and the page generated from it."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import pytest
from pydantic import ValidationError

from robot_stack.contract.display import LANGUAGES, Display
from robot_stack.core import display_patterns as patterns
from robot_stack.core import display_picture as picture
from robot_stack.core.config import config_dir, read_yaml
from robot_stack.core.display_patterns import SEGMENTS, Pattern, Patterns, load_patterns
from robot_stack.ehmi import codec, docs

PATTERNS = load_patterns()
STEP_S = 0.01


def changed(state: int, **fields) -> Pattern:
    return Pattern.model_validate({**PATTERNS.states[state].model_dump(), **fields})


def test_every_state_of_the_interface_has_its_pattern():
    assert set(PATTERNS.states) == {int(state) for state in Display} == codec.STATES


def test_the_document_is_fresh():
    committed = docs.PATH.read_text(encoding="utf-8")
    assert committed == docs.render(committed, PATTERNS), "run python -m robot_stack.ehmi.docs and commit docs/ehmi.md"


def test_a_document_without_a_place_for_the_table():
    with pytest.raises(ValueError, match="needs the lines"):
        docs.render("# nothing", PATTERNS)


# --- limits for people -----------------------------------------------------------------------------------------------


def test_turquoise_is_for_driving_by_itself_alone():
    turquoise = {Display(number) for number, pattern in PATTERNS.states.items() if pattern.colour == "turquoise"}
    driving = {
        Display.NAVIGATING,
        Display.APPROACHING_CHAIR,
        Display.DOCKING,
        Display.TRANSPORT,
        Display.PASSENGER_DISEMBARK,
    }
    assert turquoise == driving
    assert all(PATTERNS.states[state].motion in ("travel", "fill") for state in driving)


def test_red_is_for_emergency_stop_and_failed_docking_alone():
    red = {Display(number) for number, pattern in PATTERNS.states.items() if pattern.colour == "red"}
    assert red == {Display.EMERGENCY_STOP, Display.DOCKING_FAILED}


def test_states_with_motion_use_departure_chime():
    for state in (Display.NAVIGATING, Display.APPROACHING_CHAIR, Display.TRANSPORT, Display.MANUAL):
        assert PATTERNS.states[state].sound == "departure_chime"


@pytest.mark.parametrize("state", sorted(PATTERNS.states))
def test_no_segment_flashes_three_times_in_any_second(state):
    """A flash is a pair of opposing changes of at least a tenth of the brightness."""
    pattern = PATTERNS.states[state]
    times = [STEP_S * step for step in range(400)]
    for t_s in times[::4]:
        assert len(patterns.light(pattern, t_s)) == SEGMENTS
        assert all(0.0 <= level <= 1.0 for level in (*patterns.light(pattern, t_s), patterns.base_light(pattern, t_s)))
    for segment in (0, SEGMENTS // 2, SEGMENTS - 1):
        levels = [patterns.light(pattern, t_s)[segment] for t_s in times]
        falls = [t_s for t_s, before, after in zip(times[1:], levels, levels[1:], strict=False) if after < before]
        begins = [t_s for t_s, before in zip(falls[1:], falls, strict=False) if t_s - before > 1.5 * STEP_S]
        assert all(len([t for t in begins if begin <= t < begin + 1.0]) <= 2 for begin in begins)


def crest(pattern: Pattern, t_s: float) -> int:
    """Returns the brightest of the first eight segments, one wavelength."""
    levels = patterns.light(pattern, t_s)[:8]
    return levels.index(max(levels))


@pytest.mark.parametrize(("state", "towards"), [(Display.NAVIGATING, 1), (Display.PASSENGER_DISEMBARK, -1)])
def test_a_wave_runs_where_the_robot_goes(state, towards):
    pattern = PATTERNS.states[state]
    period_s = 1.0 / pattern.frequency_hz
    before, after = crest(pattern, 0.3 * period_s), crest(pattern, 0.3 * period_s + period_s / 8.0)
    assert (after - before) % 8 == towards % 8


def test_a_fill_closes_on_the_middle():
    pattern = PATTERNS.states[Display.DOCKING]
    levels = patterns.light(pattern, 0.5 / pattern.frequency_hz)
    assert levels == levels[::-1]
    assert levels[0] == 1.0
    assert levels[SEGMENTS // 2] < 0.5


def test_a_passenger_is_seen_under_the_wave():
    assert patterns.base_light(PATTERNS.states[Display.TRANSPORT], 2.0) == pytest.approx(1.0)
    assert patterns.base_light(PATTERNS.states[Display.NAVIGATING], 2.0) == 0.0


# --- rejected files --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("state", "fields", "problem"),
    [
        (6, {"frequency_hz": 2.5}, "red must not"),
        (5, {"frequency_hz": 3.0}, "less than 3"),
        (2, {"pictogram": "none"}, "needs a pictogram and a text"),
        (2, {"text": {"en": "x", "ja": "", "zh": "x"}}, "needs a pictogram and a text"),
        (0, {"sound": "alarm"}, "needs a pictogram and a text"),
        (2, {"colour": "none"}, "needs a pictogram"),
        (2, {"direction": "none"}, "direction and motion"),
        (1, {"direction": "front"}, "direction and motion"),
        (1, {"frequency_hz": 1.0}, "frequency_hz and motion"),
        (5, {"frequency_hz": 0.0}, "frequency_hz and motion"),
        (1, {"base": "white"}, "has a base"),
        (1, {"reason": ""}, "reason"),
        (1, {"colour": "mauve"}, "colour"),
    ],
)
def test_a_pattern_that_does_not_fit_is_refused(state, fields, problem):
    with pytest.raises(ValidationError, match=problem):
        changed(state, **fields)


def test_an_incomplete_table_is_refused():
    data = read_yaml(config_dir() / f"{patterns.FILE}.yaml")
    states = dict(data["states"])
    del states[7]
    with pytest.raises(ValidationError, match="states: exactly"):
        Patterns.model_validate({**data, "states": states})
    with pytest.raises(ValidationError, match="cited or listed"):
        Patterns.model_validate({**data, "sources": {**data["sources"], "nobody": "cites this"}})


# --- pictures --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", sorted(PATTERNS.states))
def test_picture_is_well_formed_svg_with_text_of_state(state):
    language = LANGUAGES[state % len(LANGUAGES)]
    text = PATTERNS.states[state].text.get(language)
    root = ElementTree.fromstring(picture.svg(PATTERNS, state, language, 1.3))
    assert root.attrib["lang"] == language
    assert text in [element.text or "" for element in root.iter("{http://www.w3.org/2000/svg}text")]


SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize("state", sorted(PATTERNS.states))
def test_a_picture_that_moves_by_itself_shows_the_same_light(state):
    pattern = PATTERNS.states[state]
    root = ElementTree.fromstring(picture.svg(PATTERNS, state, "en"))
    rects = root.findall(f"{SVG}rect")[1:]  # the first is the panel
    assert len(rects) == SEGMENTS * (2 if pattern.base != "none" else 1)
    lit = [rect for rect in rects if rect.attrib["fill"] == PATTERNS.colours[pattern.colour]]
    for segment, rect in enumerate(lit):
        animate = rect.find(f"{SVG}animate")
        assert (animate is not None) == (pattern.frequency_hz > 0.0)
        if animate is None:
            assert float(rect.attrib["opacity"]) == pytest.approx(patterns.light(pattern, 0.0)[segment], abs=0.01)
            continue
        values = [float(value) for value in animate.attrib["values"].split(";")]
        cycle_s = float(animate.attrib["dur"].removesuffix("s"))
        assert cycle_s == pytest.approx(1.0 / pattern.frequency_hz)
        for frame, value in enumerate(values[:-1]):
            t_s = cycle_s * frame / (len(values) - 1)
            assert value == pytest.approx(patterns.light(pattern, t_s)[segment], abs=0.01)


def test_the_description_is_plain_data():
    assert picture.description(PATTERNS, 25, "zh", 3) == {
        "state": 25, "name": "transport", "colour": "turquoise", "rgb": "#00E5D0", "base_rgb": "#FFFFFF",
        "motion": "travel", "direction": "front", "frequency_hz": 0.5, "pictogram": "passenger_moving",
        "text": "载客自动行驶中", "language": "zh", "sound": "departure_chime", "volume": 3,
    }  # fmt: skip
    with pytest.raises(KeyError):
        picture.description(PATTERNS, 11, "en", 0)
    with pytest.raises(KeyError):
        picture.description(PATTERNS, 1, "de", 0)
