"""The table of docs/ehmi.md from config/ehmi_patterns.yaml: ``python -m robot_stack.ehmi.docs`` updates it."""

from __future__ import annotations

from pathlib import Path

from robot_stack.core.display_patterns import Pattern, Patterns, load_patterns

PATH = Path(__file__).resolve().parents[2] / "docs" / "ehmi.md"
BEGIN, END = "<!-- generated: python -m robot_stack.ehmi.docs -->", "<!-- end of the generated part -->"
_COLUMNS = ("state", "shown", "light band", "pictogram", "en", "ja", "zh", "sound", "reason")
_RESERVED = range(11, 21)


def table(patterns: Patterns) -> str:
    """All states 0 to 28, and the sources behind them."""
    numbers = {key: index for index, key in enumerate(patterns.sources, start=1)}
    rows = [_row(state, patterns.states.get(state), numbers) for state in range(max(patterns.states) + 1)]
    sources = [f"{numbers[key]}. {text}." for key, text in patterns.sources.items()]
    head = [_line(_COLUMNS), "|---" * len(_COLUMNS) + "|"]
    return "\n".join([*head, *filter(None, rows), "", "Sources:", "", *sources])


def render(document: str, patterns: Patterns) -> str:
    """``document`` with its generated part replaced. Raises ValueError without a place for it."""
    before, begin, rest = document.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the document needs the lines {BEGIN} and {END}")
    return f"{before}{BEGIN}\n{table(patterns)}\n{END}{after}"


def _row(state: int, pattern: Pattern | None, numbers: dict[str, int]) -> str:
    if pattern is None:
        first, last = _RESERVED[0], _RESERVED[-1]
        cells = (f"{first}-{last}", "reserved", *[""] * (len(_COLUMNS) - 3), "rejected by bridge and display")
        return _line(cells) if state == first else ""
    cited = "".join(f" [{numbers[key]}]" for key in pattern.sources)
    texts = (pattern.text.en, pattern.text.ja, pattern.text.zh)
    sound = "" if pattern.sound == "none" else pattern.sound.replace("_", " ")
    picture = "" if pattern.pictogram == "none" else pattern.pictogram.replace("_", " ")
    return _line((str(state), pattern.name, _band(pattern), picture, *texts, sound, pattern.reason + cited))


def _band(pattern: Pattern) -> str:
    if pattern.motion == "dark":
        return "dark"
    words = {
        "steady": "steady",
        "breathe": "breathes",
        "blink": "blinks",
        "travel": f"wave to the {pattern.direction}",
        "fill": f"fills to the {pattern.direction}",
    }
    rate = f", {pattern.frequency_hz:g} Hz" if pattern.frequency_hz else ""
    base = f", over breathing {pattern.base}" if pattern.base != "none" else ""
    return f"{pattern.colour}, {words[pattern.motion]}{rate}{base}"


def _line(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    PATH.write_text(render(PATH.read_text(encoding="utf-8"), load_patterns()), encoding="utf-8")
