"""wmx_ros2_general_node: state, motion and set-up of single axes of the motion engine, by topic and service."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from robot_stack.contract import services, topics
from robot_stack.contract.model import Service, Topic
from robot_stack.core.config import ConfigError
from robot_stack.middleware.node import StackNode
from robot_stack.wmx import MotionEngine, connect
from robot_stack.wmx.axes import StatusSnapshot
from robot_stack.wmx.config import load_client_config
from robot_stack.wmx.general.answers import Answer
from robot_stack.wmx.general.axis_state import axis_state
from robot_stack.wmx.general.commands import AxisOrder, unknown_profile
from robot_stack.wmx.general.params import GeneralParams
from robot_stack.wmx.general.session import GeneralSession, Move
from robot_stack.wmx.general.worker import Job
from wmx_ros2_message.msg import AxisState

_STATE_HZ = topics.WMX_AXIS_STATE.nominal_rate_hz
_WATCH_HZ = 20.0


class WmxRos2GeneralNode(StackNode):
    """Passes messages and requests to the engine's thread; responses return when the drives have finished."""

    def __init__(self) -> None:
        super().__init__("wmx_ros2_general_node", GeneralParams)
        client = load_client_config()

        def open_engine(path: str | None, name: str) -> MotionEngine:
            config = client if path is None else client.model_copy(update={"path": path})
            return connect(name, config, timeout_s=0.0)

        self._session = GeneralSession(
            self.get_name(), self.params, _STATE_HZ, open_engine, self.get_logger(), self._publish_state
        )
        self._odd_profile_told = False
        self._state = self.advertise(topics.WMX_AXIS_STATE)
        self._offer_motion()
        self._offer_services()
        self.every(_WATCH_HZ, self._watch)
        self._session.worker.start()

    def _offer_motion(self) -> None:
        motion = self._session.motion
        for row, move in (
            (topics.WMX_AXIS_VELOCITY, motion.run),
            (topics.WMX_AXIS_POSITION, motion.go_to),
            (topics.WMX_AXIS_POSITION_RELATIVE, motion.go_by),
        ):
            self.subscribe(row, self._mover(row, move))

    def _offer_services(self) -> None:
        engine, axes = self._session.engine, self._session.axes
        jobs: tuple[tuple[Service, Callable[[Any], Job]], ...] = (
            (services.ENGINE_SET_DEVICE, lambda r: engine.set_device(r.data, r.path, r.name)),
            (services.ENGINE_SET_COMM, lambda r: engine.set_comm(r.data)),
            (services.ENGINE_GET_STATUS, lambda r: engine.get_status()),
            (services.ENGINE_ESTOP, lambda r: engine.estop(r.data)),
            (services.AXIS_SET_ON, lambda r: axes.set_on(r.index.tolist(), r.data.tolist())),
            (services.AXIS_CLEAR_ALARM, lambda r: axes.clear_alarm(r.index.tolist())),
            (services.AXIS_SET_MODE, lambda r: axes.set_mode(r.index.tolist(), r.data.tolist())),
            (services.AXIS_SET_POLARITY, lambda r: axes.set_polarity(r.index.tolist(), r.data.tolist())),
            (
                services.AXIS_SET_GEAR_RATIO,
                lambda r: axes.set_gear_ratio(r.index.tolist(), r.numerator.tolist(), r.denominator.tolist()),
            ),
            (services.AXIS_HOMING, lambda r: axes.homing(r.index.tolist())),
            (services.AXIS_STOP, lambda r: axes.stop(r.index.tolist())),
        )
        for row, job in jobs:
            self.serve_later(row, self._answerer(job))

    # --- callbacks ---------------------------------------------------------------------------------------------------

    def _mover(self, row: Topic, move: Move) -> Callable[[Any], None]:
        def on_message(message: Any) -> None:
            if unknown_profile(message.profile) and not self._odd_profile_told:
                self._odd_profile_told = True
                self.get_logger().warning(
                    f"{row.name}: profile is {message.profile!r}; the field is reserved, every motion is trapezoidal"
                )
            target = message.target.tolist() if hasattr(message, "target") else None
            arrays = (message.velocity.tolist(), message.acc.tolist(), message.dec.tolist())
            self._session.move(row.name, move, AxisOrder(message.index.tolist(), *arrays, target))

        return on_message

    def _answerer(self, job: Callable[[Any], Job]) -> Callable[[Any, Any, Callable[[Any], None]], None]:
        def on_request(request: Any, response: Any, send: Callable[[Any], None]) -> None:
            def on_answer(answer: Answer) -> None:
                response.success, response.message = answer.success, answer.message
                self.call_soon(lambda: send(response))

            self._session.worker.ask(lambda: job(request), on_answer)

        return on_request

    def on_emergency_stop(self) -> None:
        self._session.stop()

    def _publish_state(self, snapshot: StatusSnapshot) -> None:
        fields = axis_state(snapshot, self.params.axis_count, self.params.rated_torque_nm)
        self._state.publish(AxisState(**fields))

    def _watch(self) -> None:
        session = self._session
        if session.worker.failure is not None:
            raise session.worker.failure
        if session.n_axes is not None and session.n_axes < self.params.axis_count:
            raise ConfigError(
                f"{self.get_name()}: axis_count is {self.params.axis_count}, the engine has {session.n_axes} axes"
            )
        if session.stopped and not self.emergency_stop:
            session.release()
        # Also without communication, because starting it is one of the services.
        stopped = ", emergency stop" if session.stopped else ""
        self.set_health(not session.problem, session.problem or f"ready, the engine is {session.state}{stopped}")
        self.report.values = {"refused commands": str(session.refused), "last refusal": session.last_refusal}

    # --- end ---------------------------------------------------------------------------------------------------------

    def safe_output(self) -> None:
        """Stops this node's motion and closes the device; bus and engine stay for other clients."""
        self._session.end()
