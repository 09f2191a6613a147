"""``robot-stack simulate``: its options, the choice of what runs, its result folder and its exit codes."""

from __future__ import annotations

import json
import math
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml

from sim.run.run_log import RunLog
from sim.run.scenario import Expectation, load_scenario
from sim.scheduler.scheduler import Failure
from sim.settings import SHORT_START
from sim.stack.choice import choose_scenario
from sim.stack.invariants import Broken
from sim.stack.progress import RunProgress
from sim.stack.result_folder import ResultFolder
from sim.stack.run import Ride, RunResult
from sim.stack.simulate import Outcome, _judge, describe_outcome, main, make_job, read_options


def test_the_options_become_a_job_that_names_its_own_command() -> None:
    job = make_job(read_options(["demo:short", "--seed", "7", "--until", "12.5", "--light", "--serial"]))
    assert (job.scenario.seed, job.name) == (7, "demo-short")
    assert (job.options.light, job.options.until_s, job.options.parallel) == (True, 12.5, False)
    assert job.command() == "robot-stack simulate demo:short --seed 7 --until 12.5 --light"
    job = make_job(read_options(["bus_loss"]))
    assert (job.scenario.seed, job.options.until_s, job.options.record) == (1, math.inf, None)
    assert job.command() == "robot-stack simulate bus_loss --seed 1"


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ([], "give either SCENARIO or --from"),
        (["bus_loss", "--from", "ride.mcap"], "give either SCENARIO or --from"),
        (["bus_loss", "--seed", "-1"], "a seed is a whole number from 0 on, is '-1'"),
        (["bus_loss", "--until", "0"], "must be a number of seconds above 0, is '0'"),
        (["bus_loss", "--until", "nan"], "must be a number of seconds above 0"),
        (["bus_loss", "--shrink"], "--shrink needs --faults"),
        (["bus_loss", "--record", "/tmp"], "/tmp: exists already"),
    ],
)
def test_wrong_options_are_refused(arguments: list[str], problem: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        read_options(arguments)
    assert ended.value.code == 2
    assert problem in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["nothing"], "no scenario file 'nothing'"),
        (["{folder}/wrong.yaml"], "kind: "),
        (["--from", "/nowhere.mcap"], "--from /nowhere.mcap cannot be read"),
        (["--from", "/nowhere.mcap@soon"], "@ is followed by seconds"),
        (["mission:nothing"], "there is no mission 'nothing'; known: "),
        (["bus_loss", "--world", "moon"], "moon"),
        (["bus_loss", "--faults", "/nowhere.yaml"], "/nowhere.yaml"),
        (["bus_loss", "--output", "/proc/nowhere"], "--output /proc/nowhere: no folder can be made there"),
    ],
)
def test_invalid_simulate_arguments_are_reported_in_one_line(
    arguments: list[str], problem: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "wrong.yaml").write_text("kind: film\n")
    output = [] if "--output" in arguments else ["--output", str(tmp_path)]
    assert main([argument.format(folder=tmp_path) for argument in (*arguments, *output)]) == 2
    text = capsys.readouterr().err
    assert problem in text
    assert text.startswith("simulate: ")
    assert text.count("\n") == 1


def test_the_demo_starts_where_localization_is_wrong() -> None:
    scenario, name = choose_scenario("demo", seed=3)
    assert (scenario.mission, scenario.world, scenario.seed, name) == ("site_transport", "yard", 3, "demo")
    assert scenario.estimated_start is not None
    estimated, start = scenario.estimated_start.pose(), scenario.start_pose()
    assert estimated.distance_to(start) == pytest.approx(1.0)
    assert math.degrees(estimated.yaw - start.yaw) == pytest.approx(10.0)
    assert choose_scenario("demo:short")[0].start_pose().distance_to(SHORT_START) == pytest.approx(0.0)
    scenario, name = choose_scenario("mission:yard_tour")
    assert (scenario.mission, scenario.start, name) == ("yard_tour", None, "mission-yard_tour")
    assert [item.figure for item in scenario.expect] == ["mission_state", "touched"]


def result(**figures: Any) -> RunResult:
    failure = Failure(5_000_000_000, "ehmi_bridge", "Traceback\nValueError: x\n")
    return RunResult("ab" * 32, 42, 10.0, {"distance_m": 1.23456789, **figures}, RunLog(), Ride(), [failure])


def outcome(**more: Any) -> Outcome:
    chosen: dict[str, Any] = {"cut": False, "interrupted": False, "ready_s": 4.0, "real_s": 2.5, **more}
    return Outcome(chosen.pop("result", result()), **chosen)


def test_the_folder_holds_the_figures_and_the_effective_scenario(tmp_path: Path) -> None:
    scenario, name = choose_scenario("bus_loss", seed=9)
    first, second = ResultFolder(tmp_path, name), ResultFolder(tmp_path, name)
    assert first.path != second.path
    assert (tmp_path / "bus_loss-latest").resolve() == second.path
    second.write_inputs(scenario)
    second.write_figures(name, result(), ["a problem"], {"seed": 9})
    found = json.loads((second.path / "figures.json").read_text())
    assert (found["digest"], found["messages"], found["problems"]) == ("ab" * 32, 42, ["a problem"])
    assert found["failures"][0] == {"time_s": 5.0, "process": "ehmi_bridge", "text": "Traceback\nValueError: x\n"}
    assert found["conditions"]["seed"] == 9
    assert load_scenario(second.path / "scenario.yaml") == scenario
    assert (second.path / "config" / "robot.yaml").is_file()


def test_outcome_description_lists_figures_failures_speed_and_digest() -> None:
    lines = list(describe_outcome(outcome()))
    assert lines[0].split() == ["distance_m", "1.23457"]
    assert lines[1:3] == ["process ehmi_bridge failed at 1.00 s:", "Traceback\nValueError: x"]
    assert lines[3] == "10.0 simulated s in 2.5 s: 4.00 simulated seconds per second"
    assert lines[4] == f"digest {'ab' * 32} over 42 messages and the ground truth"


def clean(**figures: Any) -> RunResult:
    found = result(**figures)
    found.failures = []
    return found


def harmful() -> RunResult:
    found = clean()
    found.broken = [Broken("contact", 12.5, "a person was touched", "")]
    return found


@pytest.mark.parametrize(
    ("ended", "code", "said"),
    [
        (outcome(result=clean(far_m=9.0)), 0, "as expected"),
        (outcome(result=clean(far_m=1.0)), 1, "far_m must be above 5, is 1"),
        (outcome(result=clean(far_m=1.0), cut=True), 0, "ended by --until; expectations are not judged"),
        (outcome(result=clean(far_m=1.0), cut=True, interrupted=True), 130, "interrupted"),
        (outcome(result=result(far_m=9.0)), 1, "reproduce it: robot-stack simulate bus_loss --seed 1"),
        (outcome(result=harmful(), cut=True), 3, "a person was touched"),
    ],
)
def test_exit_codes(ended: Outcome, code: int, said: str) -> None:
    job = make_job(read_options(["bus_loss"]))
    scenario = job.scenario.model_copy(update={"expect": [Expectation(figure="far_m", above=5.0)]})
    lines: list[str] = []
    assert _judge(job, ended, ended.problems(scenario), lines.append) == code
    assert said in "\n".join(lines)


def test_progress_is_a_line_for_each_change_and_one_now_and_then() -> None:
    out, real_s = StringIO(), [0.0]
    progress = RunProgress(out, lambda: real_s[0])
    mission = SimpleNamespace(state="RUNNING", current_waypoint="gate", waypoints_completed=1, total_waypoints=3)
    run: Any = SimpleNamespace(
        now_s=1.0,
        scenario=SimpleNamespace(mission="tour"),
        mission=mission,
        safety=SimpleNamespace(safety_state="NORMAL", active_faults=[]),
        notes=SimpleNamespace(docking=None),
        run_log=RunLog(),
    )
    for now_s, at_s in ((1.0, 0.0), (2.0, 0.5), (3.0, 1.0), (23.0, 11.0)):
        run.now_s, real_s[0] = now_s, at_s
        if now_s == 3.0:
            mission.current_waypoint = "bay"
        progress.show(run)
    lines = out.getvalue().splitlines()
    assert [line.split()[0] for line in lines] == ["1.0", "3.0", "23.0"]
    assert "x2.00" in lines[1]
    assert "RUNNING 1/3  to bay  NORMAL" in lines[1]


SCENARIO = {
    "description": "Forward by hand, an emergency stop, the release, and on; a process is killed meanwhile.",
    "world": "flat",
    "seed": 3,
    "limit_s": 6.5,
    "twists": [{"at_s": 0.2, "vx_mps": 0.5}, {"at_s": 3.5}, {"at_s": 4.0, "vx_mps": 0.5}],
    "events": [
        {"at_s": 1.4, "estop": True},
        {"at_s": 2.0, "estop": False},
        {"at_s": 2.8, "reset": True},
        {"at_s": 3.2, "kill": "ehmi_bridge"},
    ],
    "expect": [
        {"figure": "stop_distance_m", "below": 0.1},
        {"figure": "emergency_stop", "equals": False},
        {"figure": "distance_m", "above": 0.8},
    ],
}


@pytest.mark.timeout(300)
def test_a_scenario_runs_twice_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "hand_drive.yaml"
    file.write_text(yaml.safe_dump(SCENARIO))
    common = [str(file), "--light", "--output", str(tmp_path)]
    assert main([*common, "--record", str(tmp_path / "recording")]) == 0, capsys.readouterr().out
    folder = tmp_path / "hand_drive-latest"
    first = json.loads((folder / "figures.json").read_text())
    for name in ("path.png", "speed.png", "wheels.png", "safety.png", "scenario.yaml", "log.txt", "nodes.log"):
        assert (folder / name).stat().st_size > 100
    assert "reset granted" in (folder / "log.txt").read_text()
    assert list((tmp_path / "recording").glob("*.mcap"))
    assert main([*common, "--serial", "--no-plots"]) == 0, capsys.readouterr().out
    second = json.loads((tmp_path / "hand_drive-latest" / "figures.json").read_text())
    assert second["digest"] == first["digest"], "a recording and a second core change nothing"
    assert main([*common, "--seed", "4", "--no-plots", "--until", "1"]) == 0
    assert json.loads((tmp_path / "hand_drive-latest" / "figures.json").read_text())["digest"] != first["digest"]


def test_a_missing_process_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(yaml.safe_dump({**SCENARIO, "events": [{"at_s": 0.1, "kill": "tea_maker"}], "expect": []}))
    assert main([str(file), "--light", "--no-plots", "--output", str(tmp_path)]) == 1
    assert "FAILED to run: kill: no process 'tea_maker' in this stack; there are " in capsys.readouterr().out
