"""The result page of a demonstration."""

from __future__ import annotations

import math
from dataclasses import replace
from html.parser import HTMLParser

from robot_stack.core.geometry import Pose2
from sim.run.result_page import Result, result_page
from sim.run.ride import Carriage, Figures, Stop

RESULT = Result(
    mission="Short <hop>",
    world="yard",
    seed=3,
    state="COMPLETED",
    reason="",
    figures=Figures(12.34, 75.0, 1.49, 0.012, 0.4, 0.02, 0.05, 0.01, 0.03, 0.2),
    carried=Carriage(0.8, 0.05, 9.1, 0.03, 0.2),
    arrivals=(("gate", 12.0), ("bay & home", 75.0)),
    stops=(Stop(12.0, 3.0, Pose2(1.0, 2.0, 0.0), "waiting 3 s"),),
    touched=(),
)


class Reader(HTMLParser):
    """Collects the text and pictures of a page. An unclosed element is an error."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.pictures: list[str] = []
        self.text = ""
        self.feed(page)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.pictures.append(dict(attrs)["src"] or "")
        elif tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += f"{data} "


def test_result_page_contains_ride_figures() -> None:
    read = Reader(result_page(RESULT, "film.gif"))
    assert read.pictures == ["map.png", "film.gif", "course.png"]
    for reported in ("Short <hop>", "12.3 m", "1 min 15 s", "0.8 mm, 0.05°", "waiting 3 s", "bay & home", "nothing"):
        assert reported in read.text


def test_result_page_omits_missing_sections() -> None:
    unknown = replace(RESULT.figures, estimate_p95_m=math.nan)
    bare = replace(RESULT, carried=None, arrivals=(), stops=(), figures=unknown, touched=("wall",))
    read = Reader(result_page(bare, ""))
    assert read.pictures == ["map.png", "course.png"]
    assert "docking" not in read.text
    assert "Stops" not in read.text
    assert "unknown" in read.text
    assert "wall" in read.text


def test_a_wheelchair_that_was_never_docked() -> None:
    nothing = Carriage(math.nan, math.nan, 0.0, math.nan, math.nan)
    assert "wheelchair" not in Reader(result_page(replace(RESULT, carried=nothing), "")).text
