"""The whole robot at an automatic door of the simulated building, and at one whose interface does not answer."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import yaml

from custom_msgs.msg import BuildingRequest
from custom_msgs.srv import ConfirmDoor
from robot_stack.contract import services, topics
from robot_stack.core.config import config_dir, read_yaml
from robot_stack.core.geometry import Pose2
from robot_stack.core.site_map import map_folder
from robot_stack.core.zones import ZONES_FILE
from robot_stack.supervisor.profile import WORLD_NODES
from tests.simulated.stage import Stage, staged

# A wall across the way east of the start, with a sliding door of 1.6 m. The map does not have it.
_DOOR = {"name": "hall", "x_m": 4.5, "y_m": 0.0, "yaw_deg": 90, "length_m": 1.6, "width_m": 0.08, "height_m": 2.0}
_WALLS_M = {"door_north": (1.9, 2.2), "door_south": (-1.25, 0.9)}  # middle and length
_ZONE_M = ((4.0, -0.9), (5.1, -0.9), (5.1, 0.9), (4.0, 0.9), (4.0, -0.9))
_START, _GOAL = Pose2(0.5, 0.0, 0.0), Pose2(8.0, 0.0, 0.0)


@contextmanager
def at_a_door(folder: Path) -> Iterator[Stage]:
    world = read_yaml(config_dir() / "worlds" / "yard.yaml")
    for name, (middle, length) in _WALLS_M.items():
        wall = {"name": name, "x_m": 4.7, "y_m": middle, "yaw_deg": 90, "length_m": length, "width_m": 0.1}
        world["walls"].append({**wall, "height_m": 2.0})
    world["doors"] = [_DOOR]
    (folder / "door.yaml").write_text(yaml.safe_dump(world))
    site = shutil.copytree(map_folder("yard"), folder / "yard")
    zone = {
        "type": "Feature",
        "properties": {"name": "hall", "type": "door"},
        "geometry": {"type": "Polygon", "coordinates": [_ZONE_M]},
    }
    (site / ZONES_FILE).write_text(json.dumps({"type": "FeatureCollection", "features": [zone]}))
    settings = ["navigation_controller.door.answer_s=4.0"]
    settings += [f'{node}.world="{folder / "door.yaml"}"' for node in WORLD_NODES]
    with staged("yard", *settings, f'navigation_controller.map="{site}"', start=_START) as stage:
        yield stage


def test_the_robot_drives_through_an_automatic_door(tmp_path: Path) -> None:
    with at_a_door(tmp_path) as stage:
        requests = stage.listen(topics.BUILDING_REQUEST)
        stage.go(_GOAL)
        stage.wait(lambda: stage.at().distance_to(_GOAL) < 0.05 and stage.stands, "the goal", 90.0)
        stage.run(1.0)
        assert requests.last.mode == BuildingRequest.CLOSED
        phases = {message.phase for message in requests.since(0.0)}
        assert BuildingRequest.PASSING in phases
        assert BuildingRequest.ASKING_STAFF not in phases


def test_a_dead_interface_lets_the_robot_wait_and_a_wrong_answer_of_staff_causes_no_contact(tmp_path: Path) -> None:
    with at_a_door(tmp_path) as stage:
        stage.world.faults.inject("door_dead")
        stage.go(_GOAL)
        text = "waiting for door hall: no answer, open it and confirm"
        stage.navigation.wait(lambda message: message.data == text, text, 60.0)
        assert stage.at().x < _ZONE_M[0][0] - 0.5
        answer = stage.call(services.CONFIRM_DOOR, ConfirmDoor.Request(name="hall"))
        assert answer.success, answer.message
        stage.run(5.0)  # the panel is closed: what the LiDAR sees stops the robot
        assert stage.at().x < 4.5
        assert stage.world.sim.world.touching() == ()
