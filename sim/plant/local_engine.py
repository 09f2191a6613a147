"""The simulated motion engine inside the caller's process, behind the same client API that nodes use.

For runs without ROS and faster than real time: the owner steps engine and physics together, and a call of the
API acts at once, like one between two cycles of the engine process. No call waits.
"""

from __future__ import annotations

from typing import Any, Final

from robot_stack.wmx import MotionEngine
from robot_stack.wmx.api import ErrorCode, error_name
from robot_stack.wmx.axes import AxisFeedback, StatusSnapshot, axis_feedback, empty_snapshot
from robot_stack.wmx.config import EngineConfig
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.requests import Session, execute
from robot_stack.wmx.parameter_blocks import file_values
from robot_stack.wmx.robot_parameters import robot_parameters
from robot_stack.wmx.simulated.client import Device
from robot_stack.wmx.simulated.library import library_of
from sim.plant.simulation import Simulation

_COMMUNICATION_TRIES: Final = 1000


class LocalDevice(Device):
    """A device on an engine in this process."""

    def __init__(self, engine: Engine) -> None:
        super().__init__(call_timeout_s=1.0, status_stale_s=1.0)  # nothing is sent, so nothing can be late
        self._engine = engine
        self._session = Session()

    def call(self, method: str, *arguments: Any) -> tuple[int, list[Any]]:
        return execute(self._engine, self._session, method, list(arguments))

    def snapshot(self) -> tuple[int, StatusSnapshot]:
        if not self._session.device:
            return ErrorCode.DeviceIsNull, empty_snapshot()
        return ErrorCode.PyNone, snapshot_of(self._engine)

    def feedback(self) -> AxisFeedback | None:
        code, snapshot = self.snapshot()
        return None if code else axis_feedback(snapshot)

    def CreateDevice(self, path: str, deviceType: int = 0, waitTimeMilliseconds: int = 0) -> int:  # noqa: N802, N803
        return self.command("CreateDevice", deviceType)

    def CloseDevice(self) -> int:  # noqa: N802
        return self.command("CloseDevice")


def snapshot_of(engine: Engine) -> StatusSnapshot:
    """A copy of the engine's status; its age counts in engine time."""
    condition, arrays = engine.condition, engine.arrays
    return StatusSnapshot(
        engine_state=condition.state,
        epoch=condition.epoch,
        cycle_counter=condition.cycles,
        engine_time_s=condition.cycles * condition.cycle_time_s,
        stamp_ns=round(1e9 * condition.cycles * condition.cycle_time_s),
        cycle_time_s=condition.cycle_time_s,
        engine_error=condition.error,
        emergency_stop=condition.emergency_stop,
        emergency_stop_level=condition.emergency_stop_level,
        lost_cycles=condition.lost_cycles,
        overruns=condition.overruns,
        reals=arrays.reals.copy(),
        flags=arrays.flags.copy(),
        inputs=engine.feedback.inputs.copy(),
        outputs=engine.commands.outputs.copy(),
    )


class LocalEngine:
    """An engine on the drives of ``sim``. ``start`` opens a device, starts the bus and sets the robot's parameters."""

    def __init__(self, config: EngineConfig, sim: Simulation) -> None:
        self.engine = Engine(config, sim.world.drives)
        sim.engine_cycle = self.engine.cycle
        self._sim = sim
        device = self._device = LocalDevice(self.engine)
        library = library_of(lambda: device)
        self.client = MotionEngine(library, library.WMX3Api())
        self.api, self.core_motion, self.io = self.client.api, self.client.core_motion, self.client.io

    def start(self) -> None:
        """Opens the device, starts communication and sets the robot's parameters, like the drive at its start.

        Raises RuntimeError if the bus does not come up or the engine refuses them.
        """
        self.api.CreateDevice("")
        self.api.StartCommunication()
        for _ in range(_COMMUNICATION_TRIES):
            if self.status().communicating:
                self._set_parameters()
                return
            self._sim.step()
        raise RuntimeError("the engine's bus does not come up")

    def _set_parameters(self) -> None:
        values = file_values(robot_parameters(self._sim.world.robot))
        code = self._device.command("SetAllParameters", values.of_engine, values.of_axes)
        if code:
            raise RuntimeError(f"the engine refuses the robot's parameters: {error_name(code)} (error {code})")

    def status(self) -> StatusSnapshot:
        """The engine's status as it is now."""
        return snapshot_of(self.engine)
