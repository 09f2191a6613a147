"""``docs/safety.md`` and ``docs/hazards.md`` name existing tests, modules and fault codes, and every fault code."""

from __future__ import annotations

import ast
import math
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
import yaml

from robot_stack.contract import faults, topics
from robot_stack.contract.processes import HEARTBEAT_STALE_S

ROOT = Path(__file__).resolve().parents[2]
SAFETY, HAZARDS = (ROOT / "docs" / name for name in ("safety.md", "hazards.md"))
REASONS = {faults.DOCKING, faults.PASSENGER_ONBOARD, faults.SIGHT_STALE, faults.UNDOCKING, faults.WAY_UNSEEN}
COLUMNS = ["id", "hazard and situation", "S F P, level", "measure", "fault", "code", "test", "residual risk"]
# Risk graph of ISO 13849-1, Annex A.
LEVELS = {
    ("S1", "F1", "P1"): "a",
    ("S1", "F1", "P2"): "b",
    ("S1", "F2", "P1"): "b",
    ("S1", "F2", "P2"): "c",
    ("S2", "F1", "P1"): "c",
    ("S2", "F1", "P2"): "d",
    ("S2", "F2", "P1"): "d",
    ("S2", "F2", "P2"): "e",
}
MONITOR = yaml.safe_load((ROOT / "config" / "safety_monitor.yaml").read_text(encoding="utf-8"))
ROBOT = yaml.safe_load((ROOT / "config" / "robot.yaml").read_text(encoding="utf-8"))
CLEARS_S = {code: fault.clear_after_s for code, fault in faults.BY_CODE.items()}
P, COLLISION, SLOPE = MONITOR, MONITOR["collision"], MONITOR["slope_stop_deg"]
# Row of the fault table, or definition, of docs/safety.md: the numbers it must contain, by unit.
NUMBERS: list[tuple[str, list[float], str]] = [
    ("ESTOP_PRESSED", [P["stop_sources"]["button_silence_s"]], "s"),
    ("DRIVE_FAULT", [P["drive_silence_s"], P["drive_servo_off_s"]], "s"),
    ("STEERING_FAULT", [round(math.degrees(P["steering"]["angle_rad"]))], "deg"),
    ("STEERING_FAULT", [P["steering"]["disagreement_mps"]], "m/s"),
    ("STEERING_FAULT", [P["steering"]["hold_s"]], "s"),
    ("JOINT_STATES_TIMEOUT", [topics.JOINT_STATES.stale_limit_s], "s"),
    ("OVERSPEED", [P["overspeed"]["hold_s"]], "s"),
    ("TILT", [P["tilt_stop_deg"], P["tilt_clear_deg"]], "deg"),
    ("LATCH_NOT_CLOSED", [P["undocking"]["max_speed_mps"]], "m/s"),
    ("LATCH_NOT_CLOSED", [P["undocking"]["max_yaw_rate_radps"]], "rad/s"),
    ("COLLISION_IMMINENT", [COLLISION["stop_s"], CLEARS_S["COLLISION_IMMINENT"]], "s"),
    ("COLLISION_IMMINENT", [COLLISION["stop_clearance_m"]], "m"),
    ("OBSTACLE_NEAR", [COLLISION["near_s"]], "s"),
    ("OBSTACLE_NEAR", [COLLISION["near_clearance_m"]], "m"),
    ("OBSTACLE_NEAR", [COLLISION["slowest_mps"]], "m/s"),
    ("LIDAR_TIMEOUT", [topics.LIDAR_POINTS.stale_limit_s, topics.OVERHEAD_LIDAR_POINTS.stale_limit_s], "s"),
    ("LIDAR_TIMEOUT", [CLEARS_S["LIDAR_TIMEOUT"]], "s"),
    ("OBSTACLES_TIMEOUT", [topics.OBSTACLES.stale_limit_s, CLEARS_S["OBSTACLES_TIMEOUT"]], "s"),
    ("LOCALIZATION_LOST", [P["lost_quality"], P["found_quality"]], ""),
    ("LOCALIZATION_LOST", [topics.CURRENT_POSE.stale_limit_s, CLEARS_S["LOCALIZATION_LOST"]], "s"),
    ("LOCALIZATION_LOST", [P["pose_jump_m"]], "m"),
    ("IMU_TIMEOUT", [topics.IMU.stale_limit_s, CLEARS_S["IMU_TIMEOUT"]], "s"),
    ("IMU_TIMEOUT", [P["degraded_limit_mps"]], "m/s"),
    ("IMU_TIMEOUT", [P["degraded_limit_radps"]], "rad/s"),
    ("CAMERA_TIMEOUT", [topics.FRONT_CAMERA_INFO.stale_limit_s], "s"),
    ("NODE_DEAD", [HEARTBEAT_STALE_S], "s"),
    ("NODE_DEAD", [P["degraded_limit_mps"]], "m/s"),
    ("SLOPE", [P["slope_limit_deg"], SLOPE, P["slope_hysteresis_deg"]], "deg"),
    ("SLOPE", [SLOPE + P["slope_tolerance_deg"] + P["slope_hysteresis_deg"]], "deg"),
    ("SLOPE", [P["slope_limit_mps"], P["descent"]["max_speed_mps"]], "m/s"),
    ("SLOPE", [P["slope_limit_radps"]], "rad/s"),
    ("LATCH_NOT_STORED", [P["latch_write_s"]], "s"),
    ("LATCH_NOT_STORED", [P["degraded_limit_mps"]], "m/s"),
    ("BATTERY_LOW", [100 * P["battery_low"], 100 * P["battery_hysteresis"]], "%"),
    ("BATTERY_LOW", [topics.BATTERY_STATE.stale_limit_s], "s"),
    ("BATTERY_CRITICAL", [100 * P["battery_critical"], 100 * P["battery_hysteresis"]], "%"),
    ("BATTERY_CRITICAL", [P["degraded_limit_mps"]], "m/s"),
    ("OVERHEAT", [P["computer"]["overheat_c"]], "C"),
    ("OVERHEAT", [P["computer"]["overheat_c"] - P["computer"]["overheat_hysteresis_c"]], "C"),
    ("CPU_HIGH", [P["computer"]["cpu_high_s"]], "s"),
    ("CPU_HIGH", [P["computer"]["cpu_high_percent"], P["computer"]["memory_high_percent"]], "%"),
    ("DISK_FULL", [P["computer"]["disk_full_percent"]], "%"),
    ("DISK_FULL", [P["computer"]["disk_full_percent"] - P["computer"]["usage_hysteresis_percent"]], "%"),
    ("UI_LINK_LOST", [topics.EHMI_STATUS.stale_limit_s, topics.UI_HEARTBEAT.stale_limit_s], "s"),
    ("Servo off unasked", [P["drive_servo_off_s"], P["drive_servo_on_timeout_s"]], "s"),
    ("Drives up", [P["startup_settle_s"]], "s"),
    ("Inclination", [P["attitude_time_constant_s"], P["attitude_settle_s"]], "s"),
    ("Downhill", [P["descent"]["angle_deg"]], "deg"),
    ("Downhill", [P["descent"]["angle_deg"] + P["descent"]["angle_hysteresis_deg"]], "deg"),
    ("Downhill", [P["descent"]["max_speed_mps"]], "m/s"),
    ("Downhill", [P["descent"]["max_yaw_rate_radps"]], "rad/s"),
    ("Downhill", [P["descent"]["ask_again_s"]], "s"),
    ("Time to collision, clearance", [100 * COLLISION["margin_m"]], "cm"),
    ("Limit near obstacles", [COLLISION["approach_s"], COLLISION["reaction_s"]], "s"),
    ("Limit near obstacles", [COLLISION["stop_clearance_m"]], "m"),
    ("Limit near obstacles", [COLLISION["slowest_mps"]], "m/s"),
    ("Obstacles", [P["obstacles"]["window_s"], P["obstacles"]["max_latency_s"]], "s"),
    ("Moving bodies", [P["pedestrian_collision"]["margin_m"], P["pedestrian_collision"]["drift_mps"]], "m"),
    ("Moving bodies", [P["pedestrian_collision"]["ahead_s"], P["pedestrian_collision"]["hold_s"]], "s"),
    ("Moving bodies", [COLLISION["unseen_mps"]], "m/s"),
    ("LiDAR covered", [P["lidar"]["min_returns"], P["overhead_lidar"]["min_returns"]], ""),
    ("LiDAR covered", [round(100 * (1 - P["lidar"]["min_sector_share"]))], "%"),
    ("LiDAR covered", [round(100 * (1 - P["overhead_lidar"]["min_sector_share"]))], "%"),
    ("Permitted speed", [P["overspeed"]["margin_mps"]], "m/s"),
    ("Permitted speed", [P["overspeed"]["margin_radps"]], "rad/s"),
    ("Permitted speed", [P["overspeed"]["notice_s"]], "s"),
    ("Permitted speed", [100 * P["overspeed"]["deceleration_share"]], "%"),
    ("PASSENGER_ONBOARD", [ROBOT["with_passenger"]["max_speed_mps"]], "m/s"),
    ("UNDOCKING", [P["undocking"]["max_speed_mps"]], "m/s"),
    ("DOCKING", [P["docking"]["max_speed_mps"]], "m/s"),
    ("DOCKING", [P["docking"]["max_yaw_rate_radps"]], "rad/s"),
    ("WAY_UNSEEN", [COLLISION["unseen_mps"]], "m/s"),
    ("SIGHT_STALE", [P["obstacles"]["sight_stale_s"]], "s"),
    ("SIGHT_STALE", [COLLISION["unseen_mps"]], "m/s"),
    ("A limit of zero brakes hard", [ROBOT["emergency_deceleration_mps2"]], "m/s2"),
]
_TEST = re.compile(r"(tests/[\w/.]+\.py)?((?:::\w+)+)(?:\[[^\]]*\])?")


@cache
def defined(path: str) -> frozenset[str]:
    """Functions and classes of a test module, methods as ``Class::name``."""
    found: set[str] = set()
    for node in ast.parse((ROOT / path).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}::{item.name}" for item in node.body if isinstance(item, ast.FunctionDef)}
    return frozenset(found)


def problems(text: str) -> list[str]:
    """References of a document to tests that do not exist, by line."""
    found: list[str] = []
    path = ""
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith(("|", "- ", "#")) or not line:
            path = ""  # the file applies to one row, item or paragraph
        for reference in _references(line):
            match = _TEST.fullmatch(reference)
            if match is None:
                if not (ROOT / reference).exists():
                    found.append(f"line {number}: there is no {reference}")
                continue
            path = match[1] or path
            name = match[2].removeprefix("::")
            if not path:
                found.append(f"line {number}: {name} belongs to no file")
            elif not (ROOT / path).is_file():
                found.append(f"line {number}: there is no {path}")
            elif name not in defined(path):
                found.append(f"line {number}: {path} has no {name}")
    return found


def _references(line: str) -> Iterator[str]:
    """Paths below tests/, and names of tests, in backticks and in the targets of links."""
    for quoted in re.findall(r"`([^`]+)`", line):
        if quoted.startswith(("tests/", "::")):
            yield quoted
        else:  # a command: its arguments are paths
            yield from (word for word in quoted.split() if word.startswith("tests/"))
    yield from re.findall(r"\]\((?:\.\./)?(tests/[^)#]+)", line)


def hazards() -> list[dict[str, str]]:
    """The rows of the hazard tables by column."""
    rows: list[dict[str, str]] = []
    inside = False
    for line in HAZARDS.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]
        if cells == COLUMNS:
            inside = True
        elif not line.startswith("|"):
            inside = False
        elif inside and set(cells) != {"---"}:
            rows.append(dict(zip(COLUMNS, cells, strict=True)))
    return rows


def codes(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def place(subject: str) -> str:
    """The text of docs/safety.md about a fault, the reason of a limit, or a term."""
    text = SAFETY.read_text(encoding="utf-8")
    for line in text.splitlines():
        if line.startswith("| `") and subject in codes(line.split("|")[1]):
            return line
    found = re.search(
        rf"(?:^- \*\*|`){re.escape(subject)}(?:\*\*|`) .*?(?=\n- |\n\n|;\n)", text, re.MULTILINE | re.DOTALL
    )
    found = found or re.search(rf"^- \*\*{re.escape(subject)}.*?(?=\n- |\n\n)", text, re.MULTILINE | re.DOTALL)
    assert found is not None, f"docs/safety.md says nothing about {subject}"
    return found[0]


def numbers(text: str, unit: str) -> set[float]:
    """Numbers followed by the unit; all numbers if the unit is empty."""
    followed = rf" {re.escape(unit)}(?![\w/])" if unit else ""
    return {float(number.replace(",", "")) for number in re.findall(rf"(\d[\d,]*(?:\.\d+)?){followed}", text)}


@pytest.mark.parametrize("document", [SAFETY, HAZARDS], ids=lambda path: path.name)
def test_every_named_test_exists(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    assert len(re.findall(r"::test_\w+", text)) > 80
    assert problems(text) == []


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("`tests/contract/test_docs_safety.py::test_no_such`", "test_docs_safety.py has no test_no_such"),
        ("`tests/contract/test_docs_safety.py::problems`, `::test_no_such`", "test_docs_safety.py has no test_no_such"),
        ("`tests/contract/test_docs_safety.py::problems`\n\n`::defined`", "defined belongs to no file"),
        ("`tests/contract/test_no_such.py::test_a`", "there is no tests/contract/test_no_such.py"),
        ("[a test](../tests/contract/test_no_such.py)", "there is no tests/contract/test_no_such.py"),
        ("`pytest tests/no_such`", "there is no tests/no_such"),
        ("`::test_no_file`", "test_no_file belongs to no file"),
    ],
)
def test_a_wrong_name_is_found(text: str, problem: str) -> None:
    assert [problem in found for found in problems(text)] == [True]


def test_a_right_name_is_none() -> None:
    right = "`tests/contract/test_docs_safety.py::problems`, `::test_a_right_name_is_none[id-1]`,\n`::defined`"
    assert problems(f"{right}, `pytest tests/contract -k docs`, [this](../tests/contract/test_docs_safety.py)") == []


@pytest.mark.parametrize("code", faults.BY_CODE)
def test_every_fault_is_in_the_hazard_tables_and_in_the_fault_table(code: str) -> None:
    assert [row["id"] for row in hazards() if code in codes(row["fault"])] != []
    rows = [line for line in SAFETY.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    assert len([line for line in rows if code in codes(line.split("|")[1])]) == 1


def test_rows_of_the_hazard_tables() -> None:
    rows = hazards()
    names = [row["id"] for row in rows]
    assert len(names) == len(set(names)) > 50
    for row in rows:
        *parameters, level = row["S F P, level"].replace(",", "").split()
        assert LEVELS[tuple(parameters)] == level, row["id"]
        assert set(codes(row["fault"])) <= {*faults.BY_CODE, *REASONS}, row["id"]
        assert [path for path in codes(row["code"]) if not (ROOT / path).exists()] == [], row["id"]
        assert row["test"] != "-" or row["measure"].startswith("none"), f"{row['id']}: a measure without a test"


def test_hazards_that_are_referred_to_exist() -> None:
    names = {row["id"] for row in hazards()}
    kinds = "|".join(sorted({name.partition("-")[0] for name in names}))
    for document in (SAFETY, HAZARDS):
        assert set(re.findall(rf"\b(?:{kinds})-\d+\b", document.read_text(encoding="utf-8"))) <= names


@pytest.mark.parametrize(("subject", "values", "unit"), NUMBERS)
def test_numbers_are_those_of_contract_and_configuration(subject: str, values: list[float], unit: str) -> None:
    said = numbers(place(subject), unit)
    missing = [value for value in values if not any(math.isclose(value, number, abs_tol=1e-9) for number in said)]
    assert missing == [], f"{subject}: {sorted(said)} {unit}"
