"""wmx_ros2_general_node on a real engine process of four virtual axes, driven by a client in another process."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from robot_stack.contract import services, topics
from robot_stack.contract.model import Service, Topic
from robot_stack.middleware.interfaces import interface_class
from robot_stack.wmx.api import AxisSelection, OperationState
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import ENGINE_CONFIG_VARIABLE, HELD_UP_STALE_S, STALE_VARIABLE
from tests.support.engine import TestEngine
from tests.support.processes import NodeProcess, Start
from tests.support.waiting import wait_for
from wmx_ros2_message.msg import AxisPose, AxisState, AxisVelocity
from wmx_ros2_message.srv import SetAxis, SetEngine

if TYPE_CHECKING:
    from tests.support.peer import Peer, Received

NAME = "wmx_ros2_general_node"
N_AXES = 4
COMMANDS = (topics.WMX_AXIS_VELOCITY, topics.WMX_AXIS_POSITION, topics.WMX_AXIS_POSITION_RELATIVE)
SERVICES = [row for row in services.SERVICES if row.server == NAME]
EXAMPLES = yaml.safe_load((Path(__file__).parent / "data" / "wmx_examples.yaml").read_text(encoding="utf-8"))
NULL = "Error=301 (there is no open device)"


@pytest.fixture(autouse=True)
def _four_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ENGINE_CONFIG_VARIABLE, "wmx_engine_general")
    monkeypatch.setenv(STALE_VARIABLE, str(HELD_UP_STALE_S))  # a stalled engine on a busy machine is not dead


class Bench:
    """The node, its engine, and the client."""

    def __init__(self, start: Start, peer: Peer, folder: Path) -> None:
        self._start, self.peer = start, peer
        self.engine = TestEngine(start, folder)
        self.states: Received = peer.listen(topics.WMX_AXIS_STATE)
        self._node: NodeProcess | None = None

    @property
    def node(self) -> NodeProcess:
        assert self._node is not None
        return self._node

    def start_node(self, *ros_args: str) -> None:
        self._node = self._start(NAME, "-p", "device_retry_s:=0.1", *ros_args)
        for row in (*COMMANDS, topics.EMERGENCY_STOP):
            self.peer.wait_matched(row)

    def up(self, *ros_args: str) -> None:
        """Engine with bus and servos on, node with a device."""
        self.engine.run().up()
        self.start_node(*ros_args)
        self.node.wait_output("ready, the engine is Communicating")

    def call(self, row: Service, request: Any = None) -> tuple[bool, str]:
        response = self.peer.call(row, request)
        return response.success, response.message

    def call_later(self, row: Service, request: Any) -> Any:
        """Calls a service and returns the future of the answer."""
        client = self.peer.node.create_client(interface_class(row.type), row.name)
        wait_for(client.service_is_ready, "the service")
        return client.call_async(request)

    def set_axis(self, row: Service, index: list[int], data: list[int] | None = None) -> tuple[bool, str]:
        return self.call(row, SetAxis.Request(index=index, data=data or []))

    def wait_answer(self, row: Service, answer: tuple[bool, str]) -> None:
        """Repeats the call for axis 0 until it returns that answer."""
        wait_for(lambda: self.set_axis(row, [0], [1]) == answer, f"{row.name} to answer {answer}")

    def status(self) -> StatusSnapshot:
        code, snapshot = self.engine.device.read_status()
        assert code == 0
        return snapshot

    def wait_status(self, holds: Callable[[StatusSnapshot], Any], what: str) -> StatusSnapshot:
        wait_for(lambda: holds(self.status()), what, poll_s=0.002)
        return self.status()

    def turn(self, axes: list[int], velocity: float, dec: float = 20.0) -> None:
        """Switches axes to velocity mode and turns them."""
        assert self.set_axis(services.AXIS_SET_MODE, axes, [1] * len(axes))[0]
        self.velocity(axes, velocity, dec)
        self.wait_status(lambda now: all(abs(now.actual_velocity[a] - velocity) < 0.1 for a in axes), "turning axes")

    def velocity(self, axes: list[int], velocity: float, dec: float = 20.0) -> None:
        n = len(axes)
        message = AxisVelocity(index=axes, velocity=[velocity] * n, acc=[20.0] * n, dec=[dec] * n)
        self.peer.publish(topics.WMX_AXIS_VELOCITY, message)

    def wait_refused(self, text: str) -> None:
        self.node.wait_output(text)

    def fresh_state(self) -> AxisState:
        """Waits for a message published after this call."""
        count = len(self.states.items)
        wait_for(lambda: len(self.states.items) > count + 1, "the state of now", poll_s=0.002)
        return self.states.last


@pytest.fixture
def bench(start: Start, peer: Peer, tmp_path: Path, _four_axes: None) -> Iterator[Bench]:
    bench = Bench(start, peer, tmp_path)
    yield bench
    bench.engine.close()


def at_rest(*axes: int) -> Callable[[StatusSnapshot], bool]:
    return lambda now: all(now.op_state[axis] == OperationState.Idle for axis in axes)


# --- start and state ----------------------------------------------------------------------------------------------


def test_all_interfaces_exist_without_engine_and_state_once_engine_runs(bench: Bench) -> None:
    bench.start_node("-p", "communication_timeout_s:=0.5")  # no engine yet
    bench.node.wait_output("attempt 5 of 5")
    rows = {row.name: [row.type] for row in SERVICES}
    wait_for(lambda: rows.items() <= dict(bench.peer.node.get_service_names_and_types()).items(), "every service")
    assert bench.set_axis(services.AXIS_SET_ON, [0], [1]) == (False, f"Failed to set axis 0 on. {NULL}; ")
    assert bench.call(services.ENGINE_SET_COMM, SetBool.Request(data=True)) == (
        False,
        f"Failed to start communication. {NULL}",
    )
    assert bench.call(services.ENGINE_GET_STATUS) == (True, "Unknown")
    assert bench.call(services.ENGINE_SET_DEVICE, SetEngine.Request(data=True, name="a")) == (
        False,
        "Failed to create device. Error=263 (no engine is running there)",
    )
    bench.peer.publish(
        topics.WMX_AXIS_POSITION, AxisPose(index=[0], target=[1.0], velocity=[1.0], acc=[1.0], dec=[1.0])
    )
    bench.wait_refused("/wmx/axis/position refused: no status of the engine: Error=301")

    bench.engine.run().set(connected=False)
    wait_for(lambda: bench.call(services.ENGINE_GET_STATUS) == (True, "Running"), "a device")
    late = bench.call_later(services.ENGINE_SET_COMM, SetBool.Request(data=True))
    assert bench.call(services.ENGINE_GET_STATUS) == (True, "Running")  # a waiting call does not block others
    wait_for(late.done, "the answer")
    text = "Failed to start communication. Error=1285 (communication did not start in the given time)"
    assert (late.result().success, late.result().message) == (False, text)
    bench.engine.set(connected=True)
    assert bench.states.items, "said from the first tick on"
    assert not any(any(state.servo_on) for state in bench.states.messages)
    assert bench.call(services.ENGINE_SET_COMM, SetBool.Request(data=True)) == (True, "Communication is started")
    bench.fresh_state()
    fields = AxisState.get_fields_and_field_types()
    assert len(fields) == 12
    assert {len(getattr(bench.states.last, name)) for name in fields} == {2}
    assert list(bench.states.last.servo_on) == [0, 0]
    assert bench.set_axis(services.AXIS_SET_ON, [1], [1]) == (True, "Set axis 1 on; ")
    bench.states.wait(lambda state: list(state.servo_on) == [0, 1], "servo of axis 1 on")
    assert bench.set_axis(services.AXIS_HOMING, [1]) == (True, "Homing axis 1; ")
    bench.states.wait(lambda state: list(state.home_done) == [0, 1], "axis 1 homed")


# --- examples of the documents -----------------------------------------------------------------------------------


def filled(type_name: str, literal: str) -> Any:
    """The message of a YAML literal, as the command line fills it."""
    kind = interface_class(type_name)
    return (kind.Request if "/srv/" in type_name else kind)(**yaml.safe_load(literal))


def row_of(name: str, rows: Any) -> Any:
    return next(row for row in rows if row.name == name and row.system.value == "wmx")


def test_the_examples_of_the_documents_in_their_order(bench: Bench) -> None:
    bench.engine.run()
    bench.start_node()
    wait_for(lambda: bench.call(services.ENGINE_GET_STATUS) == (True, "Running"), "a device")
    for example in EXAMPLES:
        message = filled(example["type"], example["literal"])
        if "call" in example:
            row: Service = row_of(example["call"], services.SERVICES)
            assert row.type == example["type"]
            assert bench.call(row, message) == (True, example["message"])
            continue
        topic: Topic = row_of(example["publish"], topics.TOPICS)
        assert topic.type == example["type"]
        bench.peer.publish(topic, message)
        if "position" in example:
            goal = example["position"]
            bench.wait_status(lambda now, goal=goal: abs(now.actual_pos[0] - goal) < 1e-3 and at_rest(0)(now), "target")
            assert bench.fresh_state().actual_pos[0] == pytest.approx(goal, abs=1e-3)
            assert bench.states.last.in_pos[0] == 1
        else:
            speed = example["velocity"]
            bench.wait_status(lambda now, speed=speed: abs(now.actual_velocity[0] - speed) < 0.02, "velocity")
            assert bench.fresh_state().velocity_cmd[0] == speed
    assert bench.call(services.ENGINE_GET_STATUS) == (True, "Unknown")  # no device any more


# --- commands -----------------------------------------------------------------------------------------------------


def pose(**changes: Any) -> AxisPose:
    return AxisPose(**{"index": [0], "target": [9.0], "velocity": [5.0], "acc": [10.0], "dec": [10.0], **changes})


def spin(**changes: Any) -> AxisVelocity:
    return AxisVelocity(**{"index": [3], "velocity": [5.0], "acc": [10.0], "dec": [10.0], **changes})


# --- faults in motion ---------------------------------------------------------------------------------------------


def test_alarm_lost_bus_killed_engine_and_emergency_stop_in_motion(bench: Bench) -> None:
    bench.up("-p", "axis_count:=4", "-p", "rated_torque_nm:=[1.0, 1.0, 1.0, 1.0]")
    bench.turn([0, 1], 2.0)
    bench.engine.set(alarms={"0": 42})
    state = bench.states.wait(lambda state: state.amp_alarm[0] == 1 and state.servo_on[0] == 0, "alarm in the state")
    assert list(state.amp_alarm) == [1, 0, 0, 0]
    bench.velocity([0, 1], 1.0)
    bench.wait_refused("/wmx/axis/velocity refused: axis 0 has amplifier alarm 42")
    assert bench.status().velocity_cmd[1] == 2.0  # the whole message is refused, so the valid axis continues
    bench.engine.set(alarms={})
    assert bench.set_axis(services.AXIS_CLEAR_ALARM, [0]) == (True, "Cleared alarm axis 0; ")
    assert bench.set_axis(services.AXIS_SET_ON, [0], [1]) == (True, "Set axis 0 on; ")
    bench.turn([0], 2.0)

    bench.engine.set(connected=False)
    bench.wait_status(lambda now: not now.communicating, "the loss")
    bench.velocity([1], 1.0)
    bench.wait_refused("/wmx/axis/velocity refused: the engine does not communicate with the drives: it is Running")
    assert bench.call(services.ENGINE_GET_STATUS) == (True, "Running")
    bench.states.items.clear()
    bench.states.wait(lambda state: not any(state.servo_on) and not any(state.velocity_cmd), "no servo without a bus")
    bench.engine.set(connected=True)
    assert bench.set_axis(services.AXIS_SET_ON, [1], [1])[0] is False
    assert bench.call(services.ENGINE_SET_COMM, SetBool.Request(data=True)) == (True, "Communication is started")
    assert bench.set_axis(services.AXIS_SET_ON, [0, 1], [1, 1])[0]
    bench.turn([0, 1], 2.0)

    bench.engine.kill()
    bench.node.wait_output("the motion engine has ended")
    assert bench.call(services.ENGINE_GET_STATUS) == (True, "Unknown")
    count = len(bench.states.items)
    assert bench.set_axis(services.AXIS_STOP, [0]) == (False, f"Failed to stop axis 0. {NULL}; ")
    assert len(bench.states.items) == count  # no stale state
    bench.engine.close()
    bench.engine.run().up()  # a new engine
    bench.states.wait(lambda state: list(state.servo_on) == [1] * 4, "the state of the new engine")

    # the emergency stop of the stack
    bench.turn([0], 3.0, dec=0.1)
    bench.peer.publish(topics.EMERGENCY_STOP, Bool(data=True))
    stopping = bench.wait_status(lambda now: now.actual_velocity[0] < 2.9, "slowing down")
    # 3 rad/s take 30 s at the axis's own deceleration, 0.15 s at the quick stop's.
    assert bench.wait_status(at_rest(0), "standstill").engine_time_s - stopping.engine_time_s < 1.0
    bench.velocity([0], 1.0)
    bench.wait_refused("/wmx/axis/velocity refused: /emergency_stop is in force")
    stopped = "Error=65632 (an emergency stop is active); "
    assert bench.set_axis(services.AXIS_SET_ON, [0], [1]) == (False, f"Failed to set axis 0 on. {stopped}")
    assert at_rest(0)(bench.status())

    bench.peer.publish(topics.EMERGENCY_STOP, Bool(data=False))  # without a safety monitor one release is enough
    bench.wait_answer(services.AXIS_SET_ON, (True, "Set axis 0 on; "))
    bench.turn([0], 1.0)


def test_velocity_with_a_time_out_ends_without_its_node_and_a_position_is_reached(bench: Bench, start: Start) -> None:
    bench.up("-p", "velocity_timeout_s:=0.5")
    bench.peer.repeat(topics.WMX_AXIS_VELOCITY, lambda: spin(), 20.0)
    assert bench.set_axis(services.AXIS_SET_MODE, [3], [1])[0]
    bench.wait_status(lambda now: now.velocity_cmd[3] == 5.0, "the velocity")
    since = bench.status().engine_time_s
    bench.wait_status(lambda now: now.engine_time_s > since + 0.8, "more than the time-out")
    assert bench.status().velocity_cmd[3] == 5.0
    bench.node.signal(signal.SIGSTOP)  # the node hangs
    try:
        bench.wait_status(at_rest(3), "standstill")
    finally:
        bench.node.signal(signal.SIGCONT)
    bench.wait_status(lambda now: now.velocity_cmd[3] == 5.0, "the velocity again")
    bench.peer.silence(topics.WMX_AXIS_VELOCITY)
    bench.wait_status(at_rest(3), "standstill")
    far = {"index": [0, 1], "target": [1e3] * 2, "velocity": [5.0] * 2, "acc": [100.0] * 2, "dec": [100.0] * 2}
    bench.peer.publish(topics.WMX_AXIS_POSITION, pose(**far))
    bench.wait_status(lambda now: min(now.velocity_cmd[:2]) > 4.0, "motion")
    bench.node.signal(signal.SIGKILL)
    assert bench.node.wait() == -signal.SIGKILL
    since = bench.status().engine_time_s
    bench.wait_status(lambda now: now.engine_time_s > since + 0.5, "some time")
    assert min(bench.status().velocity_cmd[:2]) > 4.0, "the engine goes on to the position: nobody has stopped it"
    assert bench.engine.device.core_motion.motion.Stop_AxisSel(AxisSelection.of(0, 1)) == 0
    bench.wait_status(at_rest(0, 1), "standstill")

    bench.states.items.clear()
    bench.start_node("-p", "axis_count:=4", "-p", "rated_torque_nm:=[1.0, 4.0, 2.0, 3.0]")
    bench.states.wait(lambda state: len(state.servo_on) == N_AXES, "state of all axes")
    assert {len(getattr(bench.states.last, name)) for name in AxisState.get_fields_and_field_types()} == {N_AXES}
    bench.turn([0, 1], 2.0)
    bench.node.signal(signal.SIGTERM)
    assert bench.node.wait() == 0
    now = bench.status()
    assert at_rest(0, 1)(now)
    assert now.communicating  # the bus stays on for other clients
    assert now.servo_on.all()

    refused = start(NAME, "-p", "axis_count:=5", "-p", "rated_torque_nm:=[1.0, 1.0, 1.0, 1.0, 1.0]")
    assert refused.wait() == 2, refused.output()
    assert "axis_count is 5, the engine has 4 axes" in refused.output()
