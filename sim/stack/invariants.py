"""Invariants of every run on the scheduler under any faults, judged by the simulated world's ground truth.

``Invariants`` observes all messages and checks the world after each of its blocks. Each broken invariant is reported
once per subject, at the first time.

Not judged: contacts between robot and chair before they are latched (docking touches it), COLLISION_IMMINENT,
OBSTACLE_NEAR and SLOPE (their conditions rest on predictions; contacts are judged instead), OVERSPEED (the speed itself
is judged), CAMERA_TIMEOUT, LATCH_NOT_STORED and UI_LINK_LOST (only the nodes
know the camera, write or page that counts), the values of LOCALIZATION_LOST and a frozen IMU.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from custom_msgs.msg import MissionStatus, UICommand
from robot_stack.contract import faults, topics
from robot_stack.contract.model import EVERY_NODE, Criticality, SafetyAction, SafetyState, System, Topic
from robot_stack.contract.processes import BY_NAME, HEARTBEAT_STALE_S
from robot_stack.contract.states import ACTIVE
from robot_stack.core.config import load
from robot_stack.core.robot import Motion
from robot_stack.safety.params import SafetyParams
from robot_stack.supervisor.lifecycle import State
from sim.plant.people import PREFIX
from sim.scheduler.decoding import decoder
from sim.scheduler.events import NANOSECONDS
from sim.scheduler.observers import LifeChange, Observer
from sim.scheduler.parts import SimulatedStack
from sim.stack.faults import INJECTED, WORLD

_STANDING_MPS, _STANDING_RADPS = 0.05, 0.1
_GRAVITY_MPS2 = 9.81
_REACTION_S = 0.1  # a tick of the monitor, its computing, and a message
_DEAD_S = HEARTBEAT_STALE_S + 2.0 * _REACTION_S
_BRAKING_REACTION_S = 0.15  # from the message to the wheels
_STOOD_S = 0.5  # contacts with people do not count against a robot that has stood this long
_RESTART_WITHIN_S = 40.0  # the supervisor's longest back-off and a construction
_RATE_WINDOW_S, _RATE_FACTOR = 2.0, 1.5
_DISPLAY_S = 2.0  # tries of the bridge, and its status at 1 Hz
_COMPUTER_S = 3.0  # readings of the computer, and their way
_TILT_MARGIN_DEG, _TILT_S = 2.0, 0.5
_CHARGE_MARGIN, _CHARGE_S = 0.02, 2.5
_ENDED = (LifeChange.STOPPED, LifeChange.KILLED, LifeChange.CRASHED, LifeChange.REFUSED)
_MONITOR: Final = "safety_monitor"
_MISSIONS: Final = "mission_manager"
_EMERGENCY: Final = SafetyState.EMERGENCY_STOP.name
_ROWS = {row.name: row for row in topics.of_system(System.ROBOT, System.SIMULATION)}

# Repeated at their rate, those of the building for each of its doors, and published at each change beside it.
_CHANGES_AT_ONCE = (
    topics.VELOCITY_LIMIT.name,
    topics.SAFETY_STATUS.name,
    topics.LATCH_STATUS.name,
    topics.SIM_EHMI_DISPLAY.name,
    topics.BUILDING_REQUEST.name,
    topics.BUILDING_STATE.name,
)

# Rows whose condition is the age of what has arrived at the safety monitor.
_AGES: tuple[tuple[str, Topic], ...] = (
    ("JOINT_STATES_TIMEOUT", topics.JOINT_STATES),
    ("LIDAR_TIMEOUT", topics.LIDAR_POINTS),
    ("LIDAR_TIMEOUT", topics.OVERHEAD_LIDAR_POINTS),
    ("OBSTACLES_TIMEOUT", topics.OBSTACLES),
    ("LOCALIZATION_LOST", topics.CURRENT_POSE),
    ("IMU_TIMEOUT", topics.IMU),
)
# Rows with an action that depends on the severity.
_GRADED = ("SLOPE", "NODE_DEAD", "COLLISION_IMMINENT")
_STOPS = tuple(row.code for row in faults.FAULTS if row.action >= SafetyAction.STOP and row.code not in _GRADED)
_GENTLE = {"LOCALIZATION_LOST", "SLOPE"}  # whose stop is that of an ordinary ride
_LIMITS = ("IMU_TIMEOUT", "BATTERY_CRITICAL", "LATCH_NOT_STORED")
# Requests of a person or a tool; goals and commands that the robot's own nodes derive from them do not count.
_ASKING = ("touch_ui", "joystick_driver", topics.OPERATOR_TOOL, topics.TEST_TOOL)


@dataclass(frozen=True, slots=True)
class Broken:
    """One invariant that did not hold. time_s: since the robot may drive. state: of robot, stack and faults then."""

    name: str
    time_s: float
    text: str
    state: str

    def describe(self) -> str:
        return f"{self.time_s:.2f} s {self.name}: {self.text} [{self.state}]"


class Envelope:
    """The speed that a falling limit still permits: the row's reaction time, then its deceleration.

    The rule of OVERSPEED, implemented independently of the code under test.
    """

    def __init__(self, notice_s: float) -> None:
        self._notice_s = notice_s
        self.permitted_mps = 0.0  # rises to the first limit
        self._falling_since_s: float | None = None
        self._before_s = 0.0

    def update(self, limit_mps: float, deceleration_mps2: float, jerk_s: float, now_s: float) -> float:
        elapsed_s, self._before_s = now_s - self._before_s, now_s
        if limit_mps >= self.permitted_mps:
            self.permitted_mps, self._falling_since_s = limit_mps, None
        elif self._falling_since_s is None:
            self._falling_since_s = now_s
        elif now_s - self._falling_since_s > self._notice_s + jerk_s:
            self.permitted_mps = max(limit_mps, self.permitted_mps - deceleration_mps2 * elapsed_s)
        return self.permitted_mps


class Since:
    """Start times of conditions that hold, by name."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}

    def for_s(self, name: str, holds: bool, now_s: float) -> float:
        """Seconds for which the condition has held; negative if it does not hold."""
        if not holds:
            self._since.pop(name, None)
            return -1.0
        return now_s - self._since.setdefault(name, now_s)


class Invariants(Observer):
    """Add it to the scheduler of ``stack``. broken: in the order of time. remarks: events that break no invariant.

    rows: codes that /safety/status has shown. overrun_s: largest delay of a row beyond its limit; negative
    if every row was in time.
    """

    def __init__(self, stack: SimulatedStack) -> None:
        self.broken: list[Broken] = []
        self.remarks: list[str] = []
        self.rows: set[str] = set()
        self.overrun_s = -math.inf
        self._stack, self._scheduler = stack, stack.scheduler
        self._params = load(SafetyParams, "safety_monitor")
        self._begun_s: float | None = None
        self._reported: set[tuple[str, str]] = set()
        self._since = Since()
        self._envelope = Envelope(self._params.overspeed.notice_s)
        self._touched = 0
        self._stood_since_s = 0.0
        # Messages
        self._safety: Any = None
        self._rows_since: dict[str, float] = {}
        self._limit_mps, self._limit_s, self._limit_codes = 0.0, -math.inf, frozenset[str]()
        self._mission: Any = None
        self._arrived: dict[str, float] = {}
        self._counts: defaultdict[tuple[str, str], list[float]] = defaultdict(lambda: [0.0, 0.0])
        # Emergency stop
        self._stop_since_s: float | None = None
        self._stop_speed = 0.0, 0.0
        self._stop_confirmed = False
        self._pressed_s: float | None = None
        self._released_unasked, self._released_s = False, 0.0
        # Lives
        self._monitor_since_s = math.inf
        self._down_since: dict[str, float] = {}
        self._mission_before: Any = None
        self._commanded = True
        self._watch: dict[str, Callable[[float, str, bytes], None]] = {
            topics.SAFETY_STATUS.name: self._on_safety,
            topics.VELOCITY_LIMIT.name: self._on_limit,
            topics.EMERGENCY_STOP.name: self._on_emergency_stop,
            topics.PASSENGER_ATTACHED.name: self._on_passenger,
            topics.MISSION_STATUS.name: self._on_mission,
            topics.UI_COMMAND.name: self._on_command,
            topics.GOAL_POSE.name: self._on_goal,
            topics.TELEOP_CMD_VEL.name: self._on_teleop,
        }

    def begin(self) -> None:
        """Starts the judgement: the robot may drive."""
        self._begun_s = self._scheduler.now_s

    def report(self, name: str, subject: str, text: str) -> None:
        """Records a broken invariant, once for each name and subject."""
        if self._begun_s is None or (name, subject) in self._reported:
            return
        self._reported.add((name, subject))
        self.broken.append(Broken(name, self._scheduler.now_s - self._begun_s, text, self._state()))

    def _state(self) -> str:
        world = self._stack.world
        parts = []
        if world is not None:
            truth = world.sim.world.truth()
            pose = truth.pose()
            speed = math.hypot(*truth.linear_mps[:2])
            attached = ", chair latched" if world.sim.world.attached else ""
            parts.append(
                f"at ({pose.x:.2f}, {pose.y:.2f}, {math.degrees(pose.yaw):.0f} deg), {speed:.2f} m/s{attached}"
            )
        if self._safety is not None:
            parts.append(" ".join([self._safety.safety_state, *self._safety.active_faults]))
        parts.append(f"limit {self._limit_mps:.2f} m/s")
        if self._mission is not None:
            parts.append(f"mission {self._mission.state} {self._mission.current_waypoint}".rstrip())
        parts.append(f"faults: {', '.join(self._stack.faults.active()) or 'none of those that last'}")
        return "; ".join(parts)

    # --- what the scheduler shows ------------------------------------------------------------------------------------

    def on_publish(self, time_ns: int, node: str, topic: str, data: bytes) -> None:
        now_s = time_ns / NANOSECONDS
        self._judge_row(now_s, node, topic, data)
        watch = self._watch.get(topic)
        if watch is not None:
            watch(now_s, node, data)

    def on_deliver(self, time_ns: int, node: str, topic: str, data: bytes) -> None:
        if node == _MONITOR:
            self._arrived[topic] = time_ns / NANOSECONDS

    def on_exception(self, time_ns: int, process: str, text: str) -> None:
        if INJECTED not in text:
            self.report("node_failed", process, f"{process} ended by itself: {_last_line(text)}")

    def on_life_change(self, time_ns: int, process: str, change: LifeChange) -> None:
        now_s = time_ns / NANOSECONDS
        if process == WORLD and change is LifeChange.READY:
            assert self._stack.world is not None
            self._stack.world.after_block.append(self.look)
        if change in _ENDED or change is LifeChange.HUNG:
            self._down_since.setdefault(process, now_s)
        elif change in (LifeChange.READY, LifeChange.RESUMED):
            self._down_since.pop(process, None)
        if process == _MONITOR:
            up = change in (LifeChange.READY, LifeChange.RESUMED)
            self._monitor_since_s = now_s if up else math.inf
            self._arrived.clear()
            self._pressed_s = None
        if process == _MISSIONS and change is LifeChange.STARTED:
            self._mission_before = self._mission
            self._commanded = False

    # --- messages ----------------------------------------------------------------------------------------------------

    def _judge_row(self, now_s: float, node: str, topic: str, data: bytes) -> None:
        row = _ROWS.get(topic)
        if row is None:
            self.report("contract_topic", topic, f"{node} publishes {topic}, which is in no row")
            return
        if node not in row.publishers and EVERY_NODE not in row.publishers:
            self.report("contract_publisher", f"{topic} {node}", f"{node} may not publish {topic}")
        if row.rate_hz is not None and topic not in _CHANGES_AT_ONCE:
            count = self._counts[topic, node]
            if now_s - count[0] >= _RATE_WINDOW_S:
                count[:] = now_s, 0.0
            count[1] += 1.0
            most = _RATE_FACTOR * row.rate_hz * _RATE_WINDOW_S + 1.0
            if count[1] > most:
                text = f"{node} has published {topic} {count[1]:.0f} times in {now_s - count[0]:.2f} s"
                self.report("contract_rate", f"{topic} {node}", f"{text}; the row's rate is {row.rate_hz:g} Hz")
        numbers = NUMBERS.get(row.type)
        if numbers is not None and not all(map(math.isfinite, numbers(decoder(row.type)(data)))):
            self.report(
                "contract_finite", f"{topic} {node}", f"{node} has published numbers on {topic} that are not finite"
            )

    def _on_safety(self, now_s: float, _: str, data: bytes) -> None:
        before, self._safety = self._safety, decoder(topics.SAFETY_STATUS.type)(data)
        active = self._safety.active_faults
        self._rows_since = {code: self._rows_since.get(code, now_s) for code in active}
        self.rows.update(active)
        if self._safety.safety_state == _EMERGENCY:
            self._begin_stop(now_s)
            self._stop_confirmed = True
            self._pressed_s = None
        elif self._stop_confirmed or (before is not None and before.safety_state == _EMERGENCY):
            self._stop_since_s, self._stop_confirmed = None, False
            self._released_unasked, self._released_s = True, now_s

    def _on_limit(self, now_s: float, _: str, data: bytes) -> None:
        message = decoder(topics.VELOCITY_LIMIT.type)(data)
        self._limit_mps, self._limit_s = message.max_linear_velocity, now_s
        self._limit_codes = frozenset(faults.split_codes(message.reason))

    def _on_emergency_stop(self, now_s: float, _: str, data: bytes) -> None:
        if decoder(topics.EMERGENCY_STOP.type)(data).data and not self._stop_confirmed:
            self._begin_stop(now_s)
            self._pressed_s = now_s if self._pressed_s is None else self._pressed_s

    def _begin_stop(self, now_s: float) -> None:
        if self._stop_since_s is None:
            self._stop_since_s, self._stop_speed = now_s, self._speed()

    def _on_passenger(self, now_s: float, node: str, data: bytes) -> None:
        attached = self._stack.world is not None and self._stack.world.sim.world.attached
        if attached and not decoder(topics.PASSENGER_ATTACHED.type)(data).data:
            self.report("passenger_forgotten", node, f"{node} publishes false while a chair is latched")

    def _on_mission(self, now_s: float, _: str, data: bytes) -> None:
        status = self._mission = decoder(topics.MISSION_STATUS.type)(data)
        before = self._mission_before
        if self._commanded or before is None or before.state not in ACTIVE:
            return
        if status.mission_id != before.mission_id:
            text = f"{before.mission_id} was {before.state}; after the restart it is {status.mission_id or 'gone'}"
            self.report("mission_lost", before.mission_id, f"{text} ({status.reason})")
        if status.state in (MissionStatus.RUNNING, MissionStatus.WAITING):
            self.report("mission_goes_on_unasked", status.mission_id, f"{status.mission_id} is {status.state} unasked")

    def _on_command(self, now_s: float, node: str, data: bytes) -> None:
        self._commanded = True
        if decoder(topics.UI_COMMAND.type)(data).command_type in (UICommand.START_MISSION, UICommand.RESUME):
            self._released_unasked = False

    def _on_goal(self, now_s: float, node: str, _: bytes) -> None:
        if node in _ASKING:
            self._released_unasked = False

    def _on_teleop(self, now_s: float, _: str, data: bytes) -> None:
        twist = decoder(topics.TELEOP_CMD_VEL.type)(data).twist
        if twist.linear.x or twist.linear.y or twist.angular.z:
            self._released_unasked = False

    def note_request(self) -> None:
        """A person has asked for motion by a service, of which no message shows it: the release of the queue."""
        self._released_unasked = False

    # --- the world ---------------------------------------------------------------------------------------------------

    def look(self) -> None:
        """Checks the world; call after each of its blocks."""
        if self._begun_s is None:
            return
        now_s = self._scheduler.now_s
        speed_mps, turning_radps = self._speed()
        moving = speed_mps > _STANDING_MPS or turning_radps > _STANDING_RADPS
        self._judge_contacts(now_s)
        self._judge_stop(now_s, moving)
        self._judge_speed(now_s, speed_mps)
        if moving:
            self._stood_since_s = now_s
        self._judge_lives(now_s)
        if now_s - self._monitor_since_s > 1.0:
            self._judge_rows(now_s)
            self._judge_actions(now_s)

    def _speed(self) -> tuple[float, float]:
        if self._stack.world is None:
            return 0.0, 0.0
        vx, vy, _, _, _, turning = self._stack.world.sim.world.data.qvel[:6].tolist()
        return math.hypot(vx, vy), abs(turning)

    def _judge_contacts(self, now_s: float) -> None:
        assert self._stack.world is not None
        touched = self._stack.world.sim.world.touched
        if len(touched) == self._touched:
            return
        for name in list(touched)[self._touched :]:
            if name.startswith(PREFIX) and now_s - self._stood_since_s > _STOOD_S:
                self.remarks.append(f"{now_s - (self._begun_s or 0.0):.2f} s: {name} walked into the standing robot")
            else:
                self.report("contact", name, f"robot, chair or passenger touches {name}")
        self._touched = len(touched)

    def _judge_stop(self, now_s: float, moving: bool) -> None:
        moves_s = self._since.for_s("moves", moving, now_s)
        if self._stop_since_s is not None:
            stopped_s = now_s - self._stop_since_s
            if moving and stopped_s > self._braking_s():
                subject = f"{self._stop_since_s:.3f}"
                text = f"the robot moves {stopped_s:.2f} s after the emergency stop at {self._stop_speed[0]:.2f} m/s"
                self.report("moves_while_stopped", subject, text)
        elif self._released_unasked and moves_s > _REACTION_S:
            self.report("moves_unasked", f"{self._released_s}", "the robot moves after a release without a new request")

    def _braking_s(self) -> float:
        deceleration = self._deceleration(hard=True)
        linear_s = self._stop_speed[0] / deceleration
        share, yaw_radps2 = self._params.overspeed.deceleration_share, self._motion().max_yaw_acceleration_radps2
        turning_s = self._stop_speed[1] / (share * yaw_radps2)
        return 2.0 * _BRAKING_REACTION_S + max(linear_s, turning_s)

    def _motion(self) -> Motion:
        assert self._stack.world is not None
        return self._stack.world.node.robot.motion(self._stack.world.sim.world.attached)

    def _deceleration(self, *, hard: bool) -> float:
        """Least required deceleration: the row's share of the nominal one, or the limit of the ground's friction."""
        assert self._stack.world is not None
        robot = self._stack.world.node.robot
        asked = robot.emergency_deceleration_mps2 if hard else self._motion().max_acceleration_mps2
        slippery = [item.value for item in self._stack.world.faults.active if item.kind in ("slip", "slip_patch")]
        possible = 0.5 * _GRAVITY_MPS2 * min(slippery, default=1.0)
        return min(self._params.overspeed.deceleration_share * asked, possible)

    def _judge_speed(self, now_s: float, speed_mps: float) -> None:
        silent = now_s - self._limit_s > topics.VELOCITY_LIMIT.stale_limit_s
        stop = self._limit_mps <= 0.0 and not (self._limit_codes and self._limit_codes <= _GENTLE)
        hard = self._stop_since_s is not None or silent or stop
        limit_mps = 0.0 if hard else max(0.0, self._limit_mps)
        motion = self._motion()
        limit_mps = min(limit_mps, motion.max_speed_mps)
        jerk_s = 0.0 if hard else motion.max_acceleration_mps2 / motion.max_jerk_mps3
        permitted = self._envelope.update(limit_mps, self._deceleration(hard=hard), jerk_s, now_s)
        rule = self._params.overspeed
        too_fast_s = self._since.for_s("too fast", speed_mps > permitted + rule.margin_mps, now_s)
        if too_fast_s > rule.hold_s:
            text = f"{speed_mps:.2f} m/s for {too_fast_s:.2f} s where {permitted:.2f} m/s are permitted"
            self.report("too_fast", f"{now_s - too_fast_s:.2f}", text)

    # --- rows of the fault list --------------------------------------------------------------------------------------

    def _judge_rows(self, now_s: float) -> None:
        """Judges the delay from the condition of a row to the row in /safety/status."""
        for code, limit_s, for_s in self._conditions(now_s):
            if code in self._rows_since or for_s < 0.0:
                continue
            self.overrun_s = max(self.overrun_s, for_s - limit_s)
            if for_s > limit_s:
                text = f"its condition has held for {for_s:.2f} s, it must be raised within {limit_s:.2f} s"
                self.report("row_not_raised", code, f"{code}: {text}")

    def _conditions(self, now_s: float) -> Iterator[tuple[str, float, float]]:
        """(code, limit for raising it, time for which its condition has held)."""
        for code, row in _AGES:
            arrived_s = self._arrived.get(row.name)
            if arrived_s is not None:
                yield code, row.stale_limit_s + _REACTION_S, now_s - arrived_s
        if self._pressed_s is not None:
            yield "ESTOP_PRESSED", _REACTION_S, now_s - self._pressed_s
        stack, params, held = self._stack, self._params, self._since.for_s
        assert stack.world is not None
        sim, physics = stack.world.sim, stack.world.sim.world
        yield "DRIVE_FAULT", 2.0 * _REACTION_S, held("alarm", bool(physics.drives.alarm_codes.any()), now_s)
        silent = sim.engine_stalled or stack.faults.is_active("bus_loss")
        yield "DRIVE_FAULT", params.drive_silence_s + _REACTION_S, held("engine", silent, now_s)
        pressed = physics.drives.edge_pressed and not silent
        yield "CONTACT", 2.0 * _REACTION_S, held("edge", pressed, now_s)
        _, x, y, _ = physics.data.qpos[3:7].tolist()
        tilt_deg = math.degrees(math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y)))))
        tilted = tilt_deg > params.tilt_stop_deg + _TILT_MARGIN_DEG
        yield "TILT", _TILT_S, held("tilt", tilted and self._fresh(topics.IMU), now_s)
        charge, powered = sim.battery.charge, self._fresh(topics.BATTERY_STATE)
        low, critical = params.battery_low - _CHARGE_MARGIN, params.battery_critical - _CHARGE_MARGIN
        yield "BATTERY_LOW", _CHARGE_S, held("low", powered and critical < charge < low, now_s)
        yield "BATTERY_CRITICAL", _CHARGE_S, held("critical", powered and charge < critical, now_s)
        unplugged = not stack.cable.plugged and self._fresh(topics.EHMI_STATUS)
        stale_s = topics.EHMI_STATUS.stale_limit_s
        yield "EHMI_LINK_LOST", stale_s + _DISPLAY_S, held("cable", unplugged, now_s)
        yield from self._computer_conditions(now_s)
        for name in params.expected_processes:
            yield "NODE_DEAD", _DEAD_S, self._down_s(name, now_s)

    def _computer_conditions(self, now_s: float) -> Iterator[tuple[str, float, float]]:
        kernel, limits, held = self._stack.computer.kernel, self._params.computer, self._since.for_s
        status, heat = self._fresh(topics.ROBOT_STATUS), self._fresh(topics.COMPUTER_TEMPERATURE)
        hot = heat and kernel.celsius is not None and kernel.celsius > limits.overheat_c + 0.5
        yield "OVERHEAT", _COMPUTER_S, held("hot", hot, now_s)
        busy = status and kernel.cpu_percent > limits.cpu_high_percent + 0.5
        yield "CPU_HIGH", limits.cpu_high_s + _COMPUTER_S, held("busy", busy, now_s)
        filled = status and kernel.memory_percent > limits.memory_high_percent + 0.5
        yield "MEMORY_HIGH", _COMPUTER_S, held("memory", filled, now_s)
        yield "DISK_FULL", 10.0, held("disk", status and self._stack.computer.disk.full, now_s)

    def _fresh(self, row: Topic) -> bool:
        """True if the inputs of the row's condition arrive: a lost message belongs to another row."""
        arrived_s = self._arrived.get(row.name)
        return arrived_s is not None and self._scheduler.now_s - arrived_s < row.stale_limit_s

    def _down_s(self, process: str, now_s: float) -> float:
        down_s = self._down_since.get(process)
        # The monitor itself must have run for that time.
        return -1.0 if down_s is None else now_s - max(down_s, self._monitor_since_s + 1.0)

    def _judge_actions(self, now_s: float) -> None:
        """Judges the action of a row in /safety/status: the limit, and the state of an emergency stop."""
        # Drives that have never been up for this life of the monitor stop it, and latch only after the grace.
        starting = now_s - self._monitor_since_s < self._params.startup_grace_s
        for code, since_s in self._rows_since.items():
            if now_s - since_s < _REACTION_S:
                continue
            most_mps = self._most_mps(code, now_s)
            if self._limit_mps > most_mps + 1e-6:
                text = f"{code} is active, and the limit is {self._limit_mps:.2f} m/s; it must be {most_mps:g}"
                self.report("action_missing", code, text)
            latches = faults.BY_CODE[code].action is SafetyAction.EMERGENCY_STOP
            if latches and not starting and self._safety.safety_state != _EMERGENCY:
                self.report("action_missing", code, f"{code} is active without an emergency stop")

    def _most_mps(self, code: str, now_s: float) -> float:
        """The greatest limit that the row's action permits."""
        if code == "NODE_DEAD":
            # The process decides. One that is back is gone from the row a moment later.
            down = [
                BY_NAME[name].criticality
                for name in self._down_since
                if name in BY_NAME and self._down_s(name, now_s) > _DEAD_S
            ]
            if Criticality.CRITICAL in down:
                return 0.0
            return self._params.degraded_limit_mps if Criticality.LIMITING in down else math.inf
        if code in _STOPS:
            return 0.0
        return self._params.degraded_limit_mps if code in _LIMITS else math.inf

    # --- lives -------------------------------------------------------------------------------------------------------

    def _judge_lives(self, now_s: float) -> None:
        for process, since_s in self._down_since.items():
            if now_s - since_s < _RESTART_WITHIN_S or process not in BY_NAME:
                continue
            if self._stack.supervision.state(process) is not State.FAILED:
                self.report("node_not_restarted", process, f"{process} has been down for {now_s - since_s:.1f} s")


# --- numbers of messages ---------------------------------------------------------------------------------------------


def _of_twist(twist: Any) -> tuple[float, ...]:
    linear, angular = twist.linear, twist.angular
    return linear.x, linear.y, linear.z, angular.x, angular.y, angular.z


def _of_pose(pose: Any) -> tuple[float, ...]:
    place, turned = pose.position, pose.orientation
    return place.x, place.y, place.z, turned.x, turned.y, turned.z, turned.w


NUMBERS: Final[dict[str, Callable[[Any], tuple[float, ...]]]] = {
    "geometry_msgs/msg/Twist": _of_twist,
    "geometry_msgs/msg/TwistStamped": lambda message: _of_twist(message.twist),
    "geometry_msgs/msg/PoseStamped": lambda message: _of_pose(message.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda message: _of_pose(message.pose.pose),
    "nav_msgs/msg/Odometry": lambda message: (*_of_pose(message.pose.pose), *_of_twist(message.twist.twist)),
    "custom_msgs/msg/SwerveModuleCommandArray": lambda message: tuple(
        number for module in message.modules for number in (module.drive_velocity, module.steering_angle)
    ),
}
"""By type: the numbers that must be finite in every message."""


def _last_line(text: str) -> str:
    return text.strip().rpartition("\n")[2]
