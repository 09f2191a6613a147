"""Mission files: which are accepted, and the single clear line for rejected ones."""

from __future__ import annotations

import copy
import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from robot_stack.core.config import ConfigError, config_dir, load, read_yaml, validate
from robot_stack.core.geometry import Pose2
from robot_stack.core.limits import NO_LIMIT, SpeedLimit
from robot_stack.core.mission import Action, Kind, Mission, Waypoint
from robot_stack.core.mission_library import MissionError, MissionLibrary, read_mission
from robot_stack.mission import events as ev
from robot_stack.mission import route
from robot_stack.mission.params import MissionParams

GOOD = {
    "id": "ride",
    "name": {"en": "Ride", "ja": "走行", "zh": "行驶"},
    "home": {"x": 0.0, "y": 0, "yaw": 0.0},
    "waypoints": [
        {"name": "gate", "x": 1.0, "y": 2.0, "yaw": 0.5, "action": "pass"},
        {"name": "bench", "x": 3, "y": 2.0, "yaw": -0.5, "action": {"wait": 5}},
        {"name": "bay", "x": 3.0, "y": 0.0, "yaw": 3.14, "action": "park"},
    ],
}
DELETE = object()


def changed(path, value):
    """Returns GOOD with the entry at ``path`` replaced or removed."""
    data = copy.deepcopy(GOOD)
    target = data
    for key in path[:-1]:
        target = target[key]
    if value is DELETE:
        del target[path[-1]]
    else:
        target[path[-1]] = value
    return data


def write(folder, data, name="ride"):
    path = folder / f"{name}.yaml"
    path.write_text(data if isinstance(data, str) else yaml.safe_dump(data, allow_unicode=True), encoding="utf-8")
    return path


def test_a_good_file(tmp_path):
    mission = read_mission(write(tmp_path, GOOD))
    assert [waypoint.name for waypoint in mission.waypoints] == ["gate", "bench", "bay"]
    assert [waypoint.action.kind for waypoint in mission.waypoints] == [Kind.PASS, Kind.WAIT, Kind.PARK]
    assert mission.waypoints[1].action.wait_s == 5.0
    assert mission.waypoints[2].pose == Pose2(3.0, 0.0, 3.14)


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (("waypoints", 1, "x"), math.nan, "waypoint 2 'bench': x: Input should be a finite number (is nan)"),
        (("waypoints", 1, "y"), math.inf, "waypoint 2 'bench': y: "),
        (("waypoints", 1, "x"), 2e4, "waypoint 2 'bench': x: Input should be less than or equal to 10000 (is 20000.0)"),
        (("waypoints", 1, "x"), "3", "waypoint 2 'bench': x: Input should be a valid number (is '3')"),
        (("waypoints", 1, "x"), True, "waypoint 2 'bench': x: "),
        (("waypoints", 1, "x"), DELETE, "waypoint 2 'bench': x: is missing"),
        (("waypoints", 1, "yaw"), 90.0, "waypoint 2 'bench': yaw: Input should be less than or equal to 6.2832 (is 9"),
        (("waypoints", 1, "z"), 0.0, "waypoint 2 'bench': z: is not a known field"),
        (("waypoints", 1, "action"), "stop", "waypoint 2 'bench': action: must be pass, park, undock, {wait: seconds}"),
        (("waypoints", 1, "action"), "wait", "waypoint 2 'bench': action: must be "),
        (("waypoints", 1, "action"), {"pass": 1}, "waypoint 2 'bench': action: must be "),
        (("waypoints", 1, "action"), {"wait": 1.0, "dock": "a"}, "waypoint 2 'bench': action: must be "),
        (("waypoints", 1, "action"), {"dock": ""}, "waypoint 2 'bench': action: must be "),
        (("waypoints", 1, "action"), {"dock": None}, "waypoint 2 'bench': action: must be "),
        (("waypoints", 1, "action"), {"kind": "wait"}, "waypoint 2 'bench': action: must be "),
        (("waypoints", 1, "action"), None, "waypoint 2 'bench': action: must be "),
        (("waypoints", 1, "action"), {"wait": -1.0}, "waypoint 2 'bench': action.wait_s: "),
        (("waypoints", 1, "action"), {"wait": "long"}, "waypoint 2 'bench': action.wait_s: "),
        (("waypoints", 1, "action"), {"wait": math.nan}, "waypoint 2 'bench': action.wait_s: "),
        (("waypoints", 1, "name"), "gate", "waypoints: every waypoint needs a unique name: gate is used more "),
        (("waypoints", 1, "name"), "  ", "waypoint 2 '  ': name: "),
        (("waypoints", 1, "name"), DELETE, "waypoint 2: name: is missing"),
        (("waypoints", 1), "bench", "waypoint 2: "),
        (("waypoints",), [], "waypoints: "),
        (("waypoints",), DELETE, "waypoints: is missing"),
        (("waypoints",), {"gate": 1}, "waypoints: "),
        (("home",), DELETE, "home: is missing"),
        (("home", "yaw"), -7.0, "home.yaw: "),
        (("name", "zh"), DELETE, "name.zh: is missing"),
        (("name",), "Ride", "name: "),
        (("id",), "Ride", "id: "),
        (("id",), "other", "id: must be the file's name 'ride', is 'other'"),
        (("speed",), 1.0, "speed: is not a known field"),
    ],
)
def test_invalid_field_is_reported_in_one_line_with_file_and_waypoint(tmp_path, path, value, says):
    file = write(tmp_path, changed(path, value))
    with pytest.raises(MissionError) as caught:
        read_mission(file)
    text = str(caught.value)
    assert text.startswith(f"{file}: {says}")
    assert "\n" not in text


def test_several_mistakes_are_all_named(tmp_path):
    data = changed(("waypoints", 0, "x"), None)
    data["waypoints"][2]["action"] = "fly"
    with pytest.raises(MissionError) as caught:
        read_mission(write(tmp_path, data))
    assert "waypoint 1 'gate': x: " in str(caught.value)
    assert "waypoint 3 'bay': action: " in str(caught.value)


@pytest.mark.parametrize("text", ["waypoints: [", "- a\n- b\n", "\t", "", "id: !!python/object:os.system {}"])
def test_malformed_mission_text_is_rejected(tmp_path, text):
    with pytest.raises(MissionError) as caught:
        read_mission(write(tmp_path, text))
    assert "ride.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_mission_file_that_is_not_utf8_is_rejected(tmp_path):
    path = tmp_path / "ride.yaml"
    path.write_bytes(b"id: \xff\xfe")
    with pytest.raises(MissionError, match="not UTF-8"):
        read_mission(path)


def test_more_waypoints_than_the_status_can_count(tmp_path):
    data = changed(("waypoints",), [{**GOOD["waypoints"][0], "name": f"w{i}"} for i in range(255)])
    with pytest.raises(MissionError, match="waypoints: "):
        read_mission(write(tmp_path, data))


def test_an_unknown_id_lists_the_known_ones(tmp_path):
    write(tmp_path, GOOD)
    write(tmp_path, GOOD, "another")
    with pytest.raises(MissionError, match=r"^there is no mission 'nowhere'; known: another, ride$"):
        MissionLibrary(tmp_path).find("nowhere")


@pytest.mark.parametrize("mission_id", ["", "..", "../ride", "sub/ride", "ride.yaml", "ri\0de", "*"])
def test_mission_id_is_not_interpreted_as_path(tmp_path, mission_id):
    write(tmp_path, GOOD)
    folder = tmp_path / "sub"
    folder.mkdir()
    with pytest.raises(MissionError, match="there is no mission"):
        MissionLibrary(folder).find(mission_id)


@given(
    st.sampled_from(["pass", "park", "undock"])
    | st.builds(lambda s: {"wait": s}, st.floats(0.0, 86_400.0))
    | st.builds(lambda name: {"dock": name}, st.text(min_size=1, max_size=64))
)
def test_an_action_is_written_as_it_is_read(action):
    assert Action.model_validate(action).model_dump(mode="json") == action


# --- the missions that come with the stack ---------------------------------------------------------------------------


def shipped() -> MissionLibrary:
    return MissionLibrary(config_dir() / "missions")


def test_shipped_places_have_names_in_every_language():
    for mission_id in shipped().ids():
        for waypoint in shipped().find(mission_id).waypoints:
            assert waypoint.label.ja, f"{mission_id}: {waypoint.name}"
            assert waypoint.label.zh, f"{mission_id}: {waypoint.name}"


@pytest.mark.parametrize("label", [{}, {"ja": "門"}, {"ja": "門", "zh": "大门"}])
def test_a_label_is_written_as_it_is_read_and_the_name_stands_in_for_it(label):
    waypoint = Waypoint.model_validate(
        {"name": "gate", "x": 1.0, "y": 2.0, "yaw": 0.0, "action": "pass", "label": label}
    )
    assert waypoint.model_dump(mode="json").get("label", {}) == label
    assert waypoint.names() == {"en": "gate", "ja": "gate", "zh": "gate"} | label


def test_limits_are_written_as_they_are_read():
    """A route without any has one digest, whatever the version that journaled it."""
    plain = {"name": "gate", "x": 1.0, "y": 2.0, "yaw": 0.0, "action": "pass"}
    limited = plain | {"max_speed_mps": 0.5, "max_yaw_rate_radps": 0.1}
    assert Waypoint.model_validate(plain).model_dump(mode="json") == plain
    assert Waypoint.model_validate(limited).model_dump(mode="json") == limited
    assert Waypoint.model_validate(plain).limit == NO_LIMIT
    assert Waypoint.model_validate(limited).limit == SpeedLimit(0.5, 0.1)


def route_length_m(mission: Mission) -> float:
    return route.length_m([Pose2(0.0, 0.0, 0.0), *(waypoint.pose for waypoint in mission.waypoints)])


def test_the_example_of_the_readme_is_valid(tmp_path):
    text = (config_dir() / "missions" / "README.md").read_text(encoding="utf-8")
    example = text.split("```yaml\n")[1].split("```")[0]
    assert read_mission(write(tmp_path, example, "yard_tour")).waypoints[1].action.wait_s == 5.0


# --- parameters ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "value"), [("position_tolerance_m", 0.6), ("yaw_tolerance_rad", 0.7)])
def test_a_waypoint_to_pass_has_the_larger_tolerances(name, value):
    data = read_yaml(config_dir() / "mission_manager.yaml")
    with pytest.raises(ConfigError, match=f"pass_{name} must not be below {name}"):
        validate(MissionParams, {**data, name: value}, "mission_manager.yaml")


def test_the_tolerances_are_those_of_the_specification():
    params = load(MissionParams, "mission_manager")
    assert params.position_tolerance_m == 0.05
    assert math.degrees(params.yaw_tolerance_rad) == pytest.approx(2.0, abs=0.01)
    assert params.tries == 3
    assert params.minimum_battery == 0.30


def test_only_a_start_looks_for_a_mission() -> None:
    def missing() -> Mission:
        raise MissionError("no mission 'tour'")

    assert ev.command(ev.PAUSE, missing) == ev.Command(ev.PAUSE)
    assert ev.command(ev.START_MISSION, missing) == ev.Command(ev.START_MISSION, problem="no mission 'tour'")
