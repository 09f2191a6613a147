"""Each fault acts as specified, ends on time, and rejects impossible requests."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from robot_stack.contract.states import DoorMode
from robot_stack.core.docks import load_docks
from robot_stack.core.geometry import Pose2
from robot_stack.wmx.bus import DriveCommands, DriveFeedback
from sim.plant import drive_loops as loops
from sim.plant.doors import SESSION_S
from sim.plant.faults import BY_NAME, FAULT_KINDS, FaultRefused, Faults
from sim.plant.simulation import Simulation
from sim.plant.world import Setup
from sim.worldfile import Door, load_world

from .bench import DRIVE_RAD_PER_COUNT, PARAMS, ROBOT


class Rig:
    """A simulation with faults and a bus master that only listens."""

    def __init__(self, wheelchair_pose: Pose2 | None = None, doors: list[Door] | None = None) -> None:
        file = load_world("flat").model_copy(update={"doors": doors or []})
        setup = Setup(file, 1, file.start.pose(), wheelchair=True, wheelchair_pose=wheelchair_pose)
        self.sim = Simulation(ROBOT, PARAMS, setup)
        self.faults = Faults(self.sim)
        self.out, self.inp = DriveCommands.zeros(8, 8), DriveFeedback.zeros(8, 8)
        self.cycles, self.lost, self.samples = 0, 0, 0
        self.sim.engine_cycle = self._cycle

    def _cycle(self) -> None:
        self.cycles += 1
        self.lost += not self.sim.world.drives.exchange(self.out, self.inp)

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s * 1000)):
            self.samples += self.sim.step() is not None
            self.faults.update()


@pytest.fixture
def rig() -> Rig:
    made = Rig()
    made.run(0.05)
    return made


class FakeProcesses:
    def __init__(self) -> None:
        self.done: list[str] = []

    def kill(self, name: str) -> None:
        self.done.append(f"kill {name}")

    def stop(self, name: str) -> None:
        self.done.append(f"stop {name}")

    def resume(self, name: str) -> None:
        self.done.append(f"go on {name}")


def test_a_process_is_killed_or_hangs_for_a_while(rig: Rig) -> None:
    with pytest.raises(FaultRefused, match="beside no processes"):
        rig.faults.inject("process_killed", "touch_ui")
    processes = rig.sim.processes = FakeProcesses()
    rig.faults.inject("process_killed", "touch_ui")
    assert rig.faults.active == ()
    rig.faults.inject("process_hang", "ehmi_bridge", duration_s=0.01)
    rig.run(0.02)
    rig.faults.inject("process_hang", "mission_manager")
    rig.faults.inject("clear", "process_hang")
    assert processes.done == [
        "kill touch_ui",
        "stop ehmi_bridge",
        "go on ehmi_bridge",
        "stop mission_manager",
        "go on mission_manager",
    ]


def test_drive_alarm(rig: Rig) -> None:
    assert "fl_drive" in rig.faults.inject("drive_alarm", "fl_drive")
    rig.run(0.01)
    assert rig.inp.alarm_code.tolist() == [0x4210, 0, 0, 0, 0, 0, 0, 0]
    rig.faults.inject("drive_alarm", "rr_steer", 0x2310, duration_s=0.1)
    rig.run(0.01)
    assert rig.inp.alarm_code[7] == 0x2310
    rig.run(0.2)
    assert [item.target for item in rig.faults.active] == ["fl_drive"]
    assert rig.inp.alarm_code[7] == 0x2310, "it outlives its cause until it is cleared"
    rig.out.clear_alarm[:] = True
    rig.run(0.05)
    assert rig.inp.alarm_code.tolist() == [0x4210, 0, 0, 0, 0, 0, 0, 0]


def test_bus_loss(rig: Rig) -> None:
    rig.faults.inject("bus_loss", duration_s=0.02)
    rig.run(0.05)
    assert rig.lost == pytest.approx(20, abs=1)


def test_encoder_freeze(rig: Rig) -> None:
    rig.faults.inject("encoder_freeze", "fr_drive", duration_s=0.5)
    before = rig.inp.position_counts.copy()
    for name in ("fl_drive", "fr_drive"):
        rig.sim.world.data.qpos[rig.sim.world.model.joint(name).qposadr[0]] += 0.5  # turned by hand
    rig.run(0.1)
    turned = 0.5 / DRIVE_RAD_PER_COUNT
    assert rig.inp.position_counts[0] - before[0] == pytest.approx(turned, abs=2)
    assert rig.inp.position_counts[2] == before[2]
    rig.run(0.5)
    assert rig.inp.position_counts[2] - before[2] == pytest.approx(turned, abs=2), "thawed it shows where the wheel is"


def frictions(rig: Rig) -> list[float]:
    rig.run(0.01)
    return [float(rig.sim.world.model.geom(f"{name}_wheel").friction[0]) for name in ("fl", "fr", "rl", "rr")]


def test_slip(rig: Rig) -> None:
    rig.faults.inject("slip", "", 0.2, duration_s=0.1)
    assert frictions(rig) == pytest.approx([0.2] * 4)
    rig.run(0.15)
    rig.faults.inject("slip", "rl_drive", 0.2)
    assert frictions(rig) == pytest.approx([0.8, 0.8, 0.2, 0.8])


def test_slip_patch_at_a_place_or_ahead_of_the_robot(rig: Rig) -> None:
    rig.faults.inject("slip_patch", "0.3,0.25,0.2,0.2", 0.05)
    assert frictions(rig) == pytest.approx([0.05, 0.8, 0.8, 0.8])
    rig.faults.inject("clear")
    rig.faults.inject("slip_patch")
    surface = rig.sim.world.surface
    assert surface.friction_at(1.0, 0.0, 0) == pytest.approx(0.1)
    assert surface.friction_at(-0.1, 0.0, 0) == pytest.approx(0.8)
    rig.faults.inject("clear", "slip_patch")
    assert surface.friction_at(1.0, 0.0, 0) == pytest.approx(0.8)


def test_imu_silent(rig: Rig) -> None:
    rig.samples = 0
    rig.faults.inject("imu_silent", duration_s=0.2)
    rig.run(0.2)
    assert rig.samples == 0
    rig.run(0.1)
    assert rig.samples == pytest.approx(10, abs=1)
    rig.faults.inject("imu_frozen")
    rig.faults.inject("imu_noise", value=50.0)
    assert (rig.sim.imu.frozen, rig.sim.imu.noise_factor) == (True, 50.0)
    rig.faults.inject("clear")
    assert (rig.sim.imu.frozen, rig.sim.imu.noise_factor) == (False, 1.0)


def test_estop_button(rig: Rig) -> None:
    rig.faults.inject("estop_button", value=1.0)
    rig.run(0.002)
    assert rig.inp.inputs[ROBOT.estop_input_byte] >> ROBOT.estop_input_bit & 1 == 0
    assert len(rig.faults.active) == 1
    rig.faults.inject("estop_button", value=0.0)
    rig.run(0.002)
    assert rig.inp.inputs[ROBOT.estop_input_byte] >> ROBOT.estop_input_bit & 1 == 1
    assert rig.faults.active == ()
    rig.faults.inject("estop_button", value=1.0, duration_s=0.1)
    for pressed in (True, False):
        rig.run(0.06)
        assert rig.sim.world.drives.estop_pressed is pressed


def edge_inputs(rig: Rig) -> set[str]:
    """The inputs of the safety edge that read as pressed."""
    edge = ROBOT.safety_edge
    assert edge is not None
    rig.run(0.002)
    value = int(rig.inp.inputs[edge.byte])
    bits = {**edge.side_bits, "relay": edge.relay_input_bit}
    return {name for name, bit in bits.items() if not value >> bit & 1}


@pytest.mark.parametrize("side", ["front", "rear", "left", "right", "relay"])
def test_edge_pressed_opens_the_side_and_the_relay_and_a_cut_wire_one_input(rig: Rig, side: str) -> None:
    assert edge_inputs(rig) == set()
    if side != "relay":
        rig.faults.inject("edge_pressed", side)
        assert edge_inputs(rig) == {side, "relay"}
        rig.faults.inject("clear", f"edge_pressed:{side}")
        assert edge_inputs(rig) == set()
    rig.faults.inject("edge_wire_cut", side)
    assert edge_inputs(rig) == {side}


def test_engine_stall_switches_drives_off(rig: Rig) -> None:
    rig.out.servo_on[:] = True
    rig.run(0.1)
    before = rig.cycles
    rig.faults.inject("engine_stall", duration_s=0.15)
    rig.run(0.14)
    assert rig.cycles == before
    assert not (rig.sim.world.drives.states == loops.ON).any()
    rig.run(0.1)
    assert rig.cycles > before


def test_a_charger_is_plugged_and_pulled(rig: Rig) -> None:
    rig.faults.inject("charger", value=400.0)
    rig.run(1.5)
    assert rig.sim.battery.read().charging
    rig.faults.inject("clear", "charger")
    rig.run(1.5)
    assert not rig.sim.battery.read().charging
    rig.faults.inject("charger_dead")
    assert rig.sim.contacts.dead
    rig.faults.inject("clear", "charger_dead")
    assert not rig.sim.contacts.dead


def test_wheelchair_fault_attaches_and_clear_detaches(rig: Rig) -> None:
    rig.faults.inject("wheelchair", value=100.0)
    rig.run(0.1)
    assert rig.sim.world.attached
    rig.faults.inject("clear", "wheelchair")
    assert not rig.sim.world.attached


@pytest.fixture
def docked() -> Rig:
    """A robot in front of a standing chair, within the latch's catching range."""
    made = Rig(wheelchair_pose=load_docks().docks["chair_1"].dock_pose.pose().inverse())
    made.run(0.05)
    return made


def close(rig: Rig, duration_s: float = 0.8) -> None:
    rig.out.outputs[ROBOT.latch.byte] = 1 << ROBOT.latch.close_output_bit
    rig.run(duration_s)


def latch_inputs(rig: Rig) -> tuple[int, int]:
    """Returns (closed, open)."""
    value = int(rig.inp.inputs[ROBOT.latch.byte])
    return value >> ROBOT.latch.closed_input_bit & 1, value >> ROBOT.latch.open_input_bit & 1


def test_a_stuck_latch_does_not_move(docked: Rig) -> None:
    docked.faults.inject("latch_stuck")
    close(docked)
    assert latch_inputs(docked) == (0, 1)
    assert not docked.sim.world.attached
    docked.faults.inject("clear", "latch_stuck")
    close(docked)
    assert latch_inputs(docked) == (1, 0)


def test_a_latch_that_does_not_confirm_holds_all_the_same(docked: Rig) -> None:
    docked.faults.inject("latch_no_confirm")
    close(docked)
    assert docked.sim.world.attached
    assert latch_inputs(docked) == (0, 0)
    docked.faults.inject("clear")
    docked.run(0.01)
    assert latch_inputs(docked) == (1, 0)


def test_latch_opens_fault_releases_chair_and_keeps_latch_open(docked: Rig) -> None:
    close(docked)
    docked.faults.inject("latch_opens")
    docked.run(0.01)
    assert not docked.sim.world.attached
    assert latch_inputs(docked) == (0, 1)
    close(docked)
    assert latch_inputs(docked) == (0, 1), "closing again does not help"
    docked.faults.inject("clear", "latch_opens")
    close(docked)
    assert latch_inputs(docked) == (1, 0)


def test_the_standing_chair_is_moved_in_its_own_frame(docked: Rig) -> None:
    docked.faults.inject("chair_moved", "0.3,0,90")
    docked.run(0.25)
    docked.faults.inject("chair_moved", "0,0.2,0")
    docked.run(0.25)
    pose = docked.sim.world.wheelchair_pose()
    assert pose is not None
    # From (0.95, 0): after 0.3 ahead and a turn of 90 degrees, left is -x.
    assert pose[:2, 3] == pytest.approx([0.95 + 0.3 - 0.2, 0.0], abs=2e-3)
    assert math.degrees(math.atan2(pose[1, 0], pose[0, 0])) == pytest.approx(90.0, abs=0.1)
    docked.run(0.5)
    later = docked.sim.world.wheelchair_pose()
    assert later is not None
    assert later[:2, 3] == pytest.approx(pose[:2, 3], abs=1e-3), "it stands again"
    assert docked.faults.active == (), "it has happened; there is nothing to clear"


def test_a_chair_that_hangs_on_the_latch_or_stands_nowhere_is_not_moved(docked: Rig, rig: Rig) -> None:
    close(docked)
    with pytest.raises(FaultRefused, match="hangs on the latch"):
        docked.faults.inject("chair_moved", "0.1,0,0")
    with pytest.raises(FaultRefused, match="no wheelchair stands here"):
        rig.faults.inject("chair_moved", "0.1,0,0")


def test_the_robot_is_carried_off_in_its_own_frame(rig: Rig, docked: Rig) -> None:
    rig.run(0.5)
    before = rig.sim.world.truth().pose()
    rig.faults.inject("robot_moved", "3,1,90")
    rig.run(0.5)
    moved = rig.sim.world.truth().pose().relative_to(before)
    assert (moved.x, moved.y, math.degrees(moved.yaw)) == pytest.approx((3.0, 1.0, 90.0), abs=0.01)
    close(docked)
    with pytest.raises(FaultRefused, match="hangs on the latch"):
        docked.faults.inject("robot_moved", "1,0,0")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("meteor",), "no fault 'meteor'; there are drive_alarm, bus_loss"),
        (("drive_alarm",), "target must be one of 'fl_drive', 'fl_steer'"),
        (("drive_alarm", "fl_wheel"), "is 'fl_wheel'"),
        (("bus_loss", "fl_drive"), "target must be one of ''"),
        (("slip", "", 3.0), r"friction coefficient\) must be in 0\.01\.\.2"),
        (("slip", "", math.nan), "is nan"),
        (("wheelchair", "", 121.0), r"passenger_mass_kg must be in 0\.\.120"),
        (("imu_silent", "", 1.0), r"must be in 0\.\.0"),
        (("bus_loss", "", 0.0, -1.0), "duration_s must be 0 or more"),
        (("bus_loss", "", 0.0, math.inf), "duration_s"),
        (("slip_patch", "1,2,3", 0.1), "x,y,length,width"),
        (("slip_patch", "1,2,nan,1", 0.1), "two sizes above 0"),
        (("slip_patch", "1,2,-1,1", 0.1), "two sizes above 0"),
        (("chair_moved", "0.1,0"), "dx,dy,dyaw"),
        (("chair_moved", "nan,0,0"), "at most 5 m"),
        (("chair_moved", "0,0,200"), "180 degrees"),
        (("robot_moved", "101,0,0"), "at most 100 m"),
        (("clear", "meteor"), "no fault 'meteor'"),
    ],
)
def test_invalid_fault_request_is_rejected_without_effect(
    rig: Rig, arguments: tuple[object, ...], message: str
) -> None:
    inject: Callable[..., str] = rig.faults.inject
    with pytest.raises(FaultRefused, match=message):
        inject(*arguments)
    assert rig.faults.active == ()


def test_clear_removes_one_target_or_all_and_reports_them(rig: Rig) -> None:
    rig.faults.inject("encoder_freeze", "fl_drive")
    rig.faults.inject("encoder_freeze", "fr_drive")
    rig.faults.inject("bus_loss")
    assert rig.faults.inject("clear", "encoder_freeze:fr_drive") == "cleared encoder_freeze:fr_drive"
    assert {item.kind for item in rig.faults.active} == {"encoder_freeze", "bus_loss"}
    assert rig.faults.inject("clear") == "cleared encoder_freeze:fl_drive, bus_loss"
    assert rig.faults.inject("clear") == "nothing to clear"


@pytest.fixture
def building() -> Rig:
    """A sliding door far from the robot, which opens along y within 0.2 s."""
    panel = {"length_m": 1.6, "width_m": 0.1, "height_m": 2.0, "travel_s": 0.2, "delay_s": 0.1}
    return Rig(doors=[Door(name="hall", x_m=9.0, y_m=2.0, yaw_deg=90.0, **panel)])


def panel(rig: Rig) -> tuple[float, float, float]:
    """Where its body is in the physics, m."""
    x, y, z = rig.sim.world.data.body("door_hall").xpos
    return float(x), float(y), float(z)


def asked(rig: Rig, wants_open: bool = True) -> list[tuple[DoorMode, tuple[str, ...]]]:
    """The reports on the door after a request and the time that it needs."""
    rig.sim.world.building.request("hall", "robot", wants_open)
    rig.run(0.5)
    return [(report.mode, report.sessions) for report in rig.sim.world.building.reports()]


def test_a_door_opens_for_its_sessions_and_closes_after_the_last(building: Rig) -> None:
    building.run(0.02)
    assert panel(building) == pytest.approx((9.0, 2.0, 0.0))
    assert asked(building) == [(DoorMode.OPEN, ("robot",))]
    assert panel(building) == pytest.approx((9.0, 3.6, 0.0))
    assert asked(building, wants_open=False) == [(DoorMode.CLOSED, ())]
    assert asked(building) == [(DoorMode.OPEN, ("robot",))]
    building.run(SESSION_S)
    assert building.sim.world.building.reports()[0].mode == DoorMode.CLOSED, "a session without requests has ended"


def test_doors_that_are_stuck_closed_or_dead(building: Rig) -> None:
    building.faults.inject("door_stuck")
    assert asked(building) == [(DoorMode.CLOSED, ("robot",))]
    building.faults.inject("clear")
    assert asked(building) == [(DoorMode.OPEN, ("robot",))]
    building.faults.inject("door_closes")
    assert asked(building) == [(DoorMode.CLOSED, ("robot",))]
    building.faults.inject("clear")
    building.faults.inject("door_dead")
    building.run(SESSION_S + 0.5)
    assert asked(building) == []
    assert panel(building) == pytest.approx((9.0, 2.0, 0.0)), "requests that it does not take open nothing"


def test_every_fault_of_the_table_is_tested_here() -> None:
    source = Path(__file__).read_text(encoding="utf-8")
    missing = [kind.name for kind in FAULT_KINDS if f'inject("{kind.name}"' not in source]
    assert missing == []
    assert len(BY_NAME) == len(FAULT_KINDS)
