"""The system monitor with its sources: every field from its source, and no value without a source."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Float32, Header

from custom_msgs.msg import EHMIStatus, MissionStatus, RobotStatus, SafetyStatus
from robot_stack.contract import topics
from tests.simulated.bench import Bench

RIDE = MissionStatus(
    state="RUNNING", mission_id="tour", current_waypoint="gate", waypoints_completed=1, total_waypoints=4
)
COMPUTER = "/Robot/System/system_monitor: computer"


class Scene:
    """The monitor, its sources, and its published messages."""

    def __init__(self, bench: Bench, **parameters: Any) -> None:
        self.bench, self.kernel = bench, bench.devices.computer.kernel
        self.kernel.cpu_percent, self.kernel.memory_percent, self.kernel.celsius = 20.0, 40.0, 50.0
        self.status, self.tree = bench.listen(topics.ROBOT_STATUS), bench.listen(topics.DIAGNOSTICS_AGG)
        self.temperature = bench.listen(topics.COMPUTER_TEMPERATURE)
        bench.start("system_monitor", {"graph_period_s": 0.5, **parameters})
        self.status.wait()

    def wait(self, condition: Callable[[RobotStatus], bool], what: str, limit_s: float = 5.0) -> RobotStatus:
        return self.status.wait(condition, what, limit_s)

    def speak(self) -> None:
        """Publishes from every source at its rate."""
        bench = self.bench
        pose = PoseStamped()
        pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = 3.0, -4.0, 1.0
        battery = BatteryState(voltage=50.5, percentage=0.755, current=-3.25)
        safety = SafetyStatus(safety_state="COLLISION_AVOIDANCE", active_faults=["OBSTACLE_NEAR"])
        bench.repeat(topics.CURRENT_POSE, lambda: pose, 10.0)
        bench.repeat(topics.LOCALIZATION_QUALITY, lambda: Float32(data=0.75), 10.0)
        bench.repeat(topics.BATTERY_STATE, lambda: battery, 2.0)
        bench.repeat(topics.SAFETY_STATUS, lambda: safety, 10.0)
        bench.publish(topics.MISSION_STATUS, RIDE)

    def wait_entry(self, name: str, condition: Callable[[DiagnosticStatus], bool]) -> DiagnosticStatus:
        def entry(message: DiagnosticArray) -> DiagnosticStatus | None:
            return next((one for one in message.status if one.name == name and condition(one)), None)

        found = entry(self.tree.wait(entry, f"an entry {name} that fits"))
        assert found is not None
        return found


def unknown(pose: Any) -> bool:
    p, q = pose.position, pose.orientation
    return all(math.isnan(value) for value in (p.x, p.y, p.z, q.x, q.y, q.z, q.w))


def values_of(entry: DiagnosticStatus) -> dict[str, str]:
    return {item.key: item.value for item in entry.values}


def test_every_field_has_its_source_and_is_unknown_without_it(bench: Bench) -> None:
    scene = Scene(bench)
    first = scene.status.messages[0]
    numbers = (first.battery_voltage, first.battery_percent, first.battery_current, first.localization_quality)
    assert all(map(math.isnan, numbers))
    assert unknown(first.pose)
    assert (first.safety_state, list(first.active_faults), first.mission_id) == ("", [], "")
    scene.speak()
    bench.run(1.0)
    full = scene.status.last
    assert (full.battery_voltage, full.battery_percent, full.battery_current) == pytest.approx((50.5, 75.5, -3.25))
    assert full.localization_quality == 0.75
    assert (full.header.frame_id, full.pose.position.x, full.pose.position.y) == ("map", 3.0, -4.0)
    assert (full.safety_state, list(full.active_faults)) == ("DEGRADED", ["OBSTACLE_NEAR"])
    assert (full.mission_id, full.current_waypoint) == ("tour", "gate")
    assert (full.waypoints_completed, full.total_waypoints) == (1, 4)
    sources = (topics.CURRENT_POSE, topics.LOCALIZATION_QUALITY, topics.BATTERY_STATE, topics.SAFETY_STATUS)
    for row in sources:
        bench.silence(row)
    bench.run(max(row.stale_limit_s for row in sources) + 0.2)
    silent = scene.status.last
    assert unknown(silent.pose)
    assert all(map(math.isnan, (silent.localization_quality, silent.battery_percent, silent.battery_voltage)))
    assert (silent.safety_state, list(silent.active_faults)) == ("", [])
    bench.publish(topics.MISSION_STATUS, MissionStatus(state="COMPLETED", mission_id="tour", total_waypoints=4))
    over = scene.wait(lambda m: m.mission_id == "", "no mission")
    assert (over.current_waypoint, over.total_waypoints) == ("", 0)


def test_its_rates(bench: Bench) -> None:
    scene = Scene(bench)
    bench.run(5.0)
    assert scene.status.period_s() == pytest.approx(0.1, abs=1e-6)
    assert scene.tree.period_s(3) == pytest.approx(1.0, abs=1e-6)


def test_mission_without_its_manager_is_unknown(bench: Bench) -> None:
    scene = Scene(bench)
    manager = bench.peer("mission_manager")
    manager.publish(topics.MISSION_STATUS, RIDE)
    scene.wait(lambda m: m.mission_id == "tour", "the mission")
    manager.process.stop()
    scene.wait(lambda m: m.mission_id == "", "no mission")


def test_the_computer_is_read_and_not_invented(bench: Bench) -> None:
    scene = Scene(bench)
    bench.run(2.0)
    status = scene.status.last
    assert (status.cpu_usage_percent, status.memory_usage_percent) == pytest.approx((20.0, 40.0))
    assert status.disk_usage_percent == pytest.approx(40.0)
    zone = scene.temperature.last
    assert (zone.temperature, zone.header.frame_id) == (pytest.approx(50.0), "thermal_zone0 x86_pkg_temp")
    scene.wait_entry(COMPUTER, lambda found: "50.0 C" in values_of(found)["temperature"])
    scene.kernel.cpu_percent, scene.kernel.memory_percent, scene.kernel.celsius = 90.0, 80.0, None
    bench.run(1.0)
    status = scene.status.last
    assert (status.cpu_usage_percent, status.memory_usage_percent) == pytest.approx((90.0, 80.0))
    assert math.isnan(scene.temperature.last.temperature)  # without a thermal zone there is no temperature
    scene.wait_entry(COMPUTER, lambda found: values_of(found)["temperature"] == "unknown")


def test_diagnostics_as_a_tree(bench: Bench) -> None:
    scene = Scene(bench, expected_processes=["swerve_controller", "navigation_controller"], stale_after_s=2.0)
    missing = scene.wait_entry("/Robot/Drive/swerve_controller", lambda entry: entry.message == "Missing")
    assert missing.level == DiagnosticStatus.STALE
    values = [KeyValue(key="input /cmd_vel", value="received=55 rate_hz=12.0 age_s=0.01 fresh=True")]
    entry = DiagnosticStatus(name="swerve_controller", message="driving", values=values)
    bench.repeat(topics.DIAGNOSTICS, lambda: DiagnosticArray(status=[entry]), 2.0)
    scene.wait_entry("/Robot/Drive", lambda found: found.level == DiagnosticStatus.OK)
    reported = scene.wait_entry("/Robot/Drive/swerve_controller", lambda found: found.message == "driving")
    assert values_of(reported)["input /cmd_vel"] == values[0].value
    traffic = scene.wait_entry("/Robot/System/system_monitor: topics", lambda f: f.level == DiagnosticStatus.WARN)
    assert "/cmd_vel 12.0 Hz instead of 20" in traffic.message
    silent_s = bench.now_s
    bench.silence(topics.DIAGNOSTICS)
    scene.wait_entry("/Robot/Drive/swerve_controller", lambda found: found.level == DiagnosticStatus.STALE)
    assert 1.5 <= bench.now_s - silent_s <= 3.1  # stale after 2 s, published once a second


def test_the_graph_against_the_contract(bench: Bench) -> None:
    scene = Scene(bench, expected_processes=["xsens_driver"])
    name = "/Robot/System/system_monitor: graph"
    scene.wait_entry(name, lambda entry: "not published by xsens_driver" in values_of(entry).get("/sensors/imu", ""))
    driver = bench.peer("xsens_driver")
    driver.publisher(topics.IMU)
    scene.wait_entry(name, lambda entry: "/sensors/imu" not in values_of(entry))
    driver.publisher(topics.WHEEL_COMMANDS)
    stranger = "published by xsens_driver"
    scene.wait_entry(name, lambda e: stranger in values_of(e).get(topics.WHEEL_COMMANDS.name, ""))


class Links:
    """An external display and a touch screen that report every second."""

    def __init__(self, bench: Bench) -> None:
        self.linked, self._bench = True, bench
        bench.repeat(topics.EHMI_STATUS, lambda: EHMIStatus(linked=self.linked), 1.0)
        self.screen(True)

    def screen(self, alive: bool) -> None:
        if alive:
            self._bench.repeat(topics.UI_HEARTBEAT, Header, 1.0)
        else:
            self._bench.silence(topics.UI_HEARTBEAT)


# From the injection to /safety/status, without ticks and periods.
RAISED_S = {
    "OVERHEAT": 0.0,
    "MEMORY_HIGH": 0.0,
    "DISK_FULL": 0.0,
    "CPU_HIGH": 10.0,
    "EHMI_LINK_LOST": 5.0,
    "UI_LINK_LOST": 5.0,
}


@pytest.mark.parametrize("code", RAISED_S)
def test_every_row_of_computer_and_links_is_raised_in_its_time_and_cleared(bench: Bench, code: str) -> None:
    scene, links = Scene(bench), Links(bench)
    safety = bench.listen(topics.SAFETY_STATUS)
    rows = ["ESTOP_PRESSED", *RAISED_S]
    bench.start("safety_monitor", {"rows": rows, "expected_processes": ["ehmi_bridge", "touch_ui"]})
    safety.wait(lambda message: message.safety_state == "NORMAL", "NORMAL")
    bench.run(2.5)  # fills the window of the processor's use

    def happens(wrong: bool) -> None:
        kernel, computer = scene.kernel, bench.devices.computer
        if code == "OVERHEAT":
            kernel.celsius = 90.0 if wrong else 50.0
        elif code == "MEMORY_HIGH":
            kernel.memory_percent = 97.0 if wrong else 40.0
        elif code == "CPU_HIGH":
            kernel.cpu_percent = 99.0 if wrong else 20.0
        elif code == "DISK_FULL":
            computer.disk.full = wrong
        elif code == "EHMI_LINK_LOST":
            links.linked = not wrong
        else:
            links.screen(not wrong)

    begun_s = bench.now_s
    happens(True)
    raised = safety.wait(lambda message: message.active_faults, code, 20.0)
    assert (list(raised.active_faults), raised.safety_state) == ([code], "DEGRADED")
    # The sources report once a second, so a link's newest report is up to that old.
    assert RAISED_S[code] - 1.0 <= bench.now_s - begun_s <= RAISED_S[code] + 1.3
    happens(False)
    safety.wait(lambda message: message.safety_state == "NORMAL" and not message.active_faults, "the end", 3.0)
