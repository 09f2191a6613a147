"""Profiles: the shipped ones are valid, invalid ones are rejected with a line that names file and field."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from robot_stack.contract.processes import BY_NAME
from robot_stack.core.config import ConfigError, config_dir
from robot_stack.supervisor.params import load_params
from robot_stack.supervisor.profile import Plan, load_plan
from robot_stack.wmx.config import ENGINE_CONFIG_VARIABLE, ENGINE_VARIABLE, load_client_config

GOOD: dict[str, Any] = {
    "description": "test",
    "machine": "robot",
    "use_sim_time": False,
    "speed": 1.0,
    "ready_deadline_s": 10.0,
    "engine": None,
    "processes": ["sim_world", "swerve_controller", "touch_ui"],
}


MINE = {"module": "a", "criticality": "critical", "note": ""}


def profile(folder: Path, **changes: Any) -> str:
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}), encoding="utf-8")
    return str(path)


@pytest.mark.parametrize("name", sorted(path.stem for path in (config_dir() / "profiles").glob("*.yaml")))
def test_shipped_profile_is_valid(name: str) -> None:
    plan = load_plan(name)
    assert plan.description
    named = {process.name for process in plan.processes} | set(plan.missing)
    assert named <= BY_NAME.keys()


def test_the_simulation_runs_every_built_process_of_the_robot_but_those_started_by_hand() -> None:
    plan = load_plan("sim")
    hosted = {node for process in plan.processes for node in process.nodes}
    built = {process.name for process in BY_NAME.values() if process.available and process.system.value != "wmx"}
    of_other_machines = {process.name for name in ("general", "manipulator") for process in load_plan(name).processes}
    drivers = {name for name in built if str(BY_NAME[name].module).startswith("robot_stack.drivers.")}
    assert built - hosted - of_other_machines - drivers <= {"recorder", "remote_view", "fleet_agent"}


@pytest.mark.parametrize("name", ["robot", "general_real", "manipulator_real", "diff_drive_real"])
def test_a_real_machine_runs_nothing_of_the_simulation(name: str) -> None:
    plan = load_plan(name)
    assert not plan.missing
    assert [process.name for process in plan.processes if not str(process.module).startswith("robot_stack.")] == []
    assert {process.system.value for process in plan.processes} == {plan.machine.value}


@pytest.mark.parametrize("simulated", ["general", "manipulator", "diff_drive"])
def test_real_profile_lacks_only_simulation_processes(simulated: str) -> None:
    ours, theirs = load_plan(simulated), load_plan(f"{simulated}_real")

    def names(plan: Plan) -> set[str]:
        return {*plan.missing, *(process.name for process in plan.processes)}

    assert {BY_NAME[name].system.value for name in names(ours) - names(theirs)} == {"simulation"}
    assert names(theirs) < names(ours)
    assert (ours.environment[ENGINE_VARIABLE], theirs.environment[ENGINE_VARIABLE]) == ("simulated", "vendor")
    assert ours.environment[ENGINE_CONFIG_VARIABLE] == f"wmx_engine_{simulated}"


def test_not_built_processes_are_named_not_dropped(tmp_path: Path) -> None:
    plan = load_plan(profile(tmp_path))
    expected = [name for name in GOOD["processes"] if not BY_NAME[name].available]
    assert list(plan.missing) == expected
    assert not set(plan.missing) & {process.name for process in plan.processes}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"processes": ["swerve_controler"]}, "'swerve_controler' is no process of the contract"),
        ({"processes": []}, "at least one process"),
        ({"processes": ["sim_world", "sim_world"]}, "sim_world: named twice"),
        ({"extra": {"imu_driver": MINE}}, "imu_driver would run in both"),
        ({"processes": ["manipulator_state"]}, "belongs to the machine wmx"),
        ({"speed": 2.0}, "needs use_sim_time"),
        ({"speed": float("nan")}, "speed"),
        ({"colour": "red"}, "colour: is not a known parameter"),
        ({"parameters": {"nobody": {"a": 1}}}, "nobody: no node of this profile"),
        ({"extra": {"sim_world": {"module": "a", "criticality": "critical", "note": ""}}}, "extra.sim_world"),
        ({"extends": "nobody"}, "no profile 'nobody'"),
        ({"extends": "robot_simulated"}, "robot_simulated extends robot"),
        (
            {"extends": "sim", "instead": {"xsens_driver": "imu"}},
            "instead: xsens_driver: no process of the profile sim",
        ),
        ({"extends": "sim"}, "sim_world, swerve_controller, touch_ui: named twice"),
        ({"extra": {"mine": {"module": "a", "criticality": "vital", "note": ""}}}, "extra.mine.criticality"),
    ],
)
def test_wrong_profile_is_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    path = profile(tmp_path, **changes)
    with pytest.raises(ConfigError, match=r"mine\.yaml") as caught:
        load_plan(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_profile_extends_another(tmp_path: Path) -> None:
    path = profile(
        tmp_path,
        extends="robot",
        instead={"pylontech_driver": "modbus_battery_driver"},
        processes=["sim_world"],
        parameters={"xsens_driver": {"latency_s": 0.001}},
    )
    robot, mine = ([process.name for process in load_plan(name).processes] for name in ("robot", path))
    assert mine == [*(name.replace("pylontech", "modbus_battery") for name in robot), "sim_world"]
    assert load_plan(path).parameters["xsens_driver"]["latency_s"] == 0.001


def test_the_simulated_robot_runs_every_process_of_the_robot_but_the_adapter_of_a_vendors_driver() -> None:
    robot, simulated = (
        {process.name for process in load_plan(name).processes} for name in ("robot", "robot_simulated")
    )
    assert robot - simulated == {"point_cloud_adapter"}
    added = {name for name in simulated - robot if BY_NAME[name].system.value != "simulation"}
    assert added == {"ouster_driver"}


def test_settings_become_parameters_of_their_node(tmp_path: Path) -> None:
    path = profile(tmp_path, parameters={"swerve_controller": {"a": 1, "b": 2}})
    plan = load_plan(path, settings=["swerve_controller.a=0.5", "sim_world.world=yard", "imu_driver.noise=true"])
    assert plan.parameters["swerve_controller"] == {"a": 0.5, "b": 2}
    assert plan.parameters["sim_world"] == {"world": "yard", "speed": 1.0}
    assert plan.parameters["imu_driver"] == {"noise": True}  # runs in the world's process


@pytest.mark.parametrize("text", ["a", ".b=1", "a.=1", "swerve_controller.x=[", "nobody.x=1"])
def test_wrong_setting_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(ConfigError, match="--set"):
        load_plan(profile(tmp_path), settings=[text])


def test_only_narrows_the_plan(tmp_path: Path) -> None:
    plan = load_plan(profile(tmp_path), only=["swerve_controller"])
    assert [process.name for process in plan.processes] == ["swerve_controller"]
    assert set(plan.parameters) <= {"swerve_controller"}
    assert not plan.use_sim_time
    with pytest.raises(ConfigError, match="mission_manager: not a built process of this profile"):
        load_plan(profile(tmp_path), only=["mission_manager"])


def test_a_profile_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"known profiles: .*sim"):
        load_plan("simm")
    (tmp_path / "bad.yaml").write_text("processes: [", encoding="utf-8")
    with pytest.raises(ConfigError, match="not valid YAML"):
        load_plan(str(tmp_path / "bad.yaml"))


def test_without_leaves_processes_out_and_monitors_do_not_expect_them() -> None:
    left_out = ["navigation_controller", "costmap_server"]
    plan = load_plan("sim", without=left_out)
    names = {process.name for process in plan.processes}
    assert {process.name for process in load_plan("sim").processes} - names == set(left_out)
    assert not set(plan.parameters["safety_monitor"]["expected_processes"]) & set(left_out)
    with pytest.raises(ConfigError, match="--without: nobody: not a built process of this profile"):
        load_plan("sim", without=["nobody"])


def test_monitors_get_all_other_processes_as_expected_processes() -> None:
    plan = load_plan("sim")
    names = [process.name for process in plan.processes]
    for monitor in ("safety_monitor", "system_monitor"):
        reported = plan.parameters[monitor]["expected_processes"]
        assert reported == [name for name in names if name != monitor]


def test_other_speed_puts_every_node_on_the_clock(tmp_path: Path) -> None:
    plan = load_plan(profile(tmp_path), speed=3.0)
    assert plan.use_sim_time
    assert plan.parameters["sim_world"] == {"speed": 3.0, "use_sim_time": True}
    nodes = {node for process in plan.processes for node in process.nodes}
    assert all(plan.parameters[node]["use_sim_time"] is True for node in nodes)


def test_a_real_robot_has_no_speed(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no simulated world"):
        load_plan(profile(tmp_path, speed=None), speed=2.0)


def test_engine_of_the_profile_reaches_every_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert load_plan(profile(tmp_path)).environment == {}
    environment = load_plan(profile(tmp_path, engine="vendor")).environment
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(ConfigError, match="path must name the installation of the vendor's engine"):
        load_client_config()  # the path of the vendor's engine is not set


def test_shipped_tuning_is_valid_and_slower_than_the_safety_monitor() -> None:
    params = load_params()
    # NODE_DEAD is raised after 1 s: the robot must stand before a critical process returns.
    critical = next(backoff for key, backoff in params.backoff.items() if key.value == "critical")
    assert critical.first_s > 1.0
    assert params.hang_after_s > 1.0


def test_fleet_adds_its_agent_with_the_broker() -> None:
    url = "mqtts://broker.example:8883"
    plan = load_plan("sim", fleet=url, settings=["fleet_agent.broker.keep_alive_s=20"])
    assert "fleet_agent" in [process.name for process in plan.processes]
    assert plan.parameters["fleet_agent"]["broker.url"] == url
    assert plan.parameters["fleet_agent"]["broker.keep_alive_s"] == 20
    assert "fleet_agent" in plan.parameters["system_monitor"]["expected_processes"]
    assert "fleet_agent" not in [process.name for process in load_plan("sim").processes]
    for wrong in ("http://broker.example", "mqtts://robot:secret@broker.example"):
        with pytest.raises(ConfigError, match="--fleet") as caught:
            load_plan("sim", fleet=wrong)
        assert "secret" not in str(caught.value)
