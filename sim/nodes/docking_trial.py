"""One docking on a running stack, requested like an operator's, evaluated by ground truth."""

from __future__ import annotations

from dataclasses import dataclass

from rclpy.action import ActionClient

from custom_msgs.action import Dock
from robot_stack.cli.nodes.operator_commands import reset
from robot_stack.contract import actions
from robot_stack.contract.model import SafetyState
from robot_stack.core.geometry import Pose2
from sim.nodes.mission_observer import MissionObserver
from sim.run.ride import carriage

_ANSWER_S = 20.0


@dataclass(frozen=True, slots=True)
class LiveOutcome:
    """Errors: base_link beside the dock pose at DOCKED, before the latch drew it in. time_s: of the action."""

    success: bool
    code: int
    reason: str
    error_mm: float
    yaw_deg: float
    time_s: float
    tries: int


def dock_live(dock_id: str, dock_pose: Pose2, limit_s: float) -> LiveOutcome:
    """Docks. Raises TimeoutError if the stack is silent or does not respond in time."""
    with MissionObserver() as observer:
        observer.board()
        if (
            observer.safety is not None and observer.safety.safety_state == SafetyState.EMERGENCY_STOP.name
        ):  # a busy start latches a stop
            reset(_ANSWER_S)
        if not observer.wait(
            lambda: observer.safety is not None and observer.safety.safety_state == SafetyState.NORMAL.name, _ANSWER_S
        ):
            raise TimeoutError("the robot may not move")
        client = ActionClient(observer.operator.node, Dock, actions.DOCK.name)
        try:
            return _follow(observer, client, dock_id, dock_pose, limit_s)
        finally:
            client.destroy()


def _follow(
    observer: MissionObserver, client: ActionClient, dock_id: str, dock_pose: Pose2, limit_s: float
) -> LiveOutcome:
    if not observer.wait(client.server_is_ready, _ANSWER_S):
        raise TimeoutError("the docking action has no server")
    sent = client.send_goal_async(Dock.Goal(dock_id=dock_id))
    if not observer.wait(sent.done, _ANSWER_S):
        raise TimeoutError("the docking controller does not answer")
    begun_s = observer.now_s()
    ended = sent.result().get_result_async()
    if not observer.wait(ended.done, limit_s):
        raise TimeoutError(f"no result within {limit_s:.0f} s")
    result = ended.result().result
    observer.wait(lambda: False, 0.2)  # what is still on its way
    noted = carriage(observer.ride, dock_pose, None)
    return LiveOutcome(
        success=result.success,
        code=result.error_code,
        reason=result.reason,
        error_mm=float("nan") if noted is None else noted.docked_mm,
        yaw_deg=float("nan") if noted is None else noted.docked_deg,
        time_s=observer.now_s() - begun_s,
        tries=result.tries,
    )
