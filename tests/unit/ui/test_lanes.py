"""Lanes of the route graph: how staff draw and delete them, and what is refused."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_stack.core.robot import Footprint, load_robot
from robot_stack.core.route_graph import GRAPH_FILE, graph_files, graph_of, load_graph
from robot_stack.core.site_map import FREE, OCCUPIED, Grid, map_folder
from robot_stack.core.zones import ZONES_FILE, Zone, ZoneType
from robot_stack.ui import protocol as p
from robot_stack.ui.lanes import LaneCheck, LaneFault, LaneProblem, lanes_of, with_lane
from robot_stack.ui.nodes.geojson_file import before_path
from robot_stack.ui.nodes.lane_file import LANE_CHANGED, LANE_INVALID, LANE_REFUSED, LaneAnswer, LaneFile
from robot_stack.ui.nodes.mission_files import EditAnswer
from robot_stack.ui.nodes.zone_file import ZoneFile

WITH_CHAIR = Footprint(front_m=1.4, rear_m=-0.5, width_m=0.8)


def hall() -> Grid:
    """10 m x 10 m at the origin, free, but for a wall along x = 5 with gaps of 0.6 m at y = 2 and 1.4 m at y = 6."""
    cells = np.full((100, 100), FREE, np.int8)
    cells[:, 50] = OCCUPIED
    cells[17:23, 50] = cells[53:67, 50] = FREE
    return Grid(0.1, 0.0, 0.0, cells)


def drawn(*points: tuple[float, float], features: Any = (), **more: Any) -> list[Any]:
    features = list(features)
    graph = graph_of({"features": features}, "here")
    return with_lane(features, graph, points, more.pop("speed_mps", None), both=more.pop("both", False))


CROSS = drawn((1.0, 6.0), (9.0, 6.0), both=True)


def test_a_lane_is_one_edge_or_two_opposite_ones_and_ends_at_the_nodes_that_are_there() -> None:
    features = drawn((9.0, 6.0), (9.0, 9.0), (1.0, 9.0), (9.0, 6.0), features=CROSS, speed_mps=0.5)
    graph = graph_of({"features": features}, "here")
    assert graph is not None
    assert len(graph.points) == 4, "the lane begins and ends at a node of the first one"
    assert sorted(graph.ends.tolist()) == [[0, 1], [1, 0], [1, 2], [2, 3], [3, 1]]
    assert graph.speed_mps.tolist() == [math.inf, math.inf, 0.5, 0.5, 0.5]
    assert [(lane.edges, lane.both) for lane in lanes_of(graph)] == [
        ((0, 1), True),
        ((2,), False),
        ((3,), False),
        ((4,), False),
    ]
    assert lanes_of(None) == []


def test_a_lane_between_the_same_nodes_is_replaced() -> None:
    foreign = [{**feature, "id": "editor"} for feature in CROSS]
    features = drawn((9.0, 6.0), (1.0, 6.0), features=foreign)
    graph = graph_of({"features": features}, "here")
    assert graph is not None
    assert graph.ends.tolist() == [[1, 0]]
    assert features[:2] == foreign[:2]


def test_opposite_edges_with_other_limits_are_two_lanes() -> None:
    edges = [dict(feature) for feature in CROSS]
    edges[3] = {**edges[3], "properties": {**edges[3]["properties"], "metadata": {"abs_speed_limit": 0.4}}}
    assert [lane.both for lane in lanes_of(graph_of({"features": edges}, "here"))] == [False, False]


@pytest.mark.parametrize(
    ("points", "keys"),
    [
        (((1.0, 6.0), (9.0, 6.0)), []),
        (((1.0, 5.7), (9.0, 5.7)), []),  # the robot keeps to the side of the gap that is free
        (((1.0, 6.0), (9.0, 4.0)), ["obstacle"]),
        (((1.0, 2.0), (9.0, 2.0)), ["narrow"]),
        (((1.0, 6.0), (12.0, 6.0)), ["off_map"]),
        (((1.0, 6.0), (1.1, 6.0)), ["short"]),
        (((1.0, 9.0), (4.0, 9.0)), []),
        (((1.0, 8.5), (4.0, 8.5)), ["keepout"]),
    ],
)
def test_a_lane_on_which_the_robot_cannot_drive_is_named(points: Any, keys: list[str]) -> None:
    ring = np.array([(2.0, 7.5), (3.0, 7.5), (3.0, 8.2), (2.0, 8.2), (2.0, 7.5)])
    zones = (Zone("lawn", ZoneType.KEEPOUT, (ring,), np.inf), Zone("slow", ZoneType.SPEED, (ring + 1.0,), 0.3))
    found = LaneCheck(hall(), WITH_CHAIR).of_points(points, None, zones)
    assert [item.key for item in found] == keys
    if keys == ["narrow"]:
        assert found[0].values["needed"] == "0.80"
        assert 0.55 < float(found[0].values["free"]) < 0.65
        assert abs(found[0].at[0] - 5.05) < 0.3
    if keys == ["keepout"]:
        assert found[0].values == {"name": "lawn"}


def test_parts_of_the_graph_without_a_lane_between_them_are_named() -> None:
    check, graph = LaneCheck(hall(), WITH_CHAIR), graph_of({"features": CROSS}, "here")
    assert check.of_points([(1.0, 1.0), (1.0, 4.0)], graph, ()) == [LaneProblem(LaneFault.UNCONNECTED, (1.0, 1.0))]
    assert check.of_points([(1.0, 1.0), (1.0, 6.0)], graph, ()) == []
    apart = graph_of({"features": drawn((1.0, 1.0), (1.0, 4.0), features=CROSS)}, "here")
    assert check.of_graph(apart, ()) == [LaneProblem(LaneFault.UNCONNECTED, (1.0, 1.0))]
    assert check.of_graph(graph, ()) == []
    assert check.of_graph(None, ()) == []


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    return Path(shutil.copytree(map_folder("yard"), tmp_path / "yard"))


def lane_file(folder: Path) -> LaneFile:
    return LaneFile(str(folder), load_robot(), ZoneFile(str(folder)).zones)


def edit(lanes: LaneFile, t: str = "lane_save", **fields: Any) -> EditAnswer:
    points = [[0.0, 0.0], [3.0, 0.0]]
    given = {"points": points, "both": True} if t != "lane_delete" else {}
    message = p.parse(json.dumps({"t": t, "revision": lanes.section()["revision"], **given, **fields}))
    assert isinstance(message, p.DrawLane | p.DeleteLane)
    return lanes.edit(message)


def test_staff_draw_and_delete_lanes_in_the_robots_own_file(folder: Path) -> None:
    lanes, own = lane_file(folder), graph_files(str(folder)).own
    empty = lanes.section()
    assert (empty["list"], empty["nodes"], empty["file"], empty["changed"]) == ([], [], "", False)
    assert edit(lanes, speed_limit_mps=0.5) == EditAnswer()
    assert edit(lanes, points=[[3.0, 0.0], [3.0, 2.0]], both=False) == EditAnswer()
    section = lanes.section()
    assert [(lane["ends"], lane["both"], lane["speed"]) for lane in section["list"]] == [
        ([0.0, 0.0, 3.0, 0.0], True, 0.5),
        ([3.0, 0.0, 3.0, 2.0], False, None),
    ]
    assert (section["file"], section["changed"], section["wrong"]) == (str(own), True, [])
    json.dumps(section, allow_nan=False)
    graph = load_graph(str(folder))
    assert graph is not None
    assert len(graph.ends) == 3, "navigation reads the robot's own file"
    assert not (folder / GRAPH_FILE).exists()
    first, second = (lane["id"] for lane in section["list"])
    assert edit(lanes, "lane_delete", lane=first) == EditAnswer()
    assert (len(lanes.section()["list"]), len(lanes.section()["nodes"])) == (1, 2)
    assert len(json.loads(before_path(own).read_text())["features"]) == 6
    assert edit(lanes, "lane_delete", lane=first).why == LANE_CHANGED, "there is none"
    assert edit(lanes, "lane_delete", lane=second) == EditAnswer()
    assert load_graph(str(folder)) is None


def test_a_lane_that_is_checked_or_wrong_is_not_saved(folder: Path) -> None:
    lanes, own = lane_file(folder), graph_files(str(folder)).own
    assert edit(lanes, "lane_check") == LaneAnswer()
    through = [[0.0, 0.0], [200.0, 0.0]]
    for t, why in (("lane_check", ""), ("lane_save", LANE_REFUSED)):
        answer = edit(lanes, t, points=through)
        assert answer.why == why
        assert answer.fields()["problems"][0]["key"] == "off_map"
    assert not own.exists()
    assert edit(lanes, revision="0123").why == LANE_CHANGED
    (folder / GRAPH_FILE).write_text("{")
    assert "graph.geojson" in lanes.section()["problem"]
    assert edit(lanes).why == LANE_INVALID
    assert edit(LaneFile("", load_robot(), tuple)).why == LANE_INVALID


def test_lanes_in_a_new_keepout_zone_are_named(folder: Path) -> None:
    lanes = lane_file(folder)
    assert edit(lanes) == EditAnswer()
    assert lanes.section()["wrong"] == []
    ring = [[1.0, -1.0], [2.0, -1.0], [2.0, 1.0], [1.0, -1.0]]
    zone = {"type": "Feature", "properties": {"name": "bed", "type": "keepout"}}
    zone["geometry"] = {"type": "Polygon", "coordinates": [ring]}  # type: ignore[assignment]
    (folder / ZONES_FILE).write_text(json.dumps({"type": "FeatureCollection", "features": [zone]}))
    (wrong,) = lanes.section()["wrong"]
    assert (wrong["key"], wrong["values"]) == ("keepout", {"name": "bed"})
