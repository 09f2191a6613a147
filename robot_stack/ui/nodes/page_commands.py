"""Executes page requests: rides, orders, poses and goals, edits of missions, zones and lanes, requests to services."""

from __future__ import annotations

import uuid
from typing import Any

from custom_msgs.msg import MissionOrder
from custom_msgs.srv import EditMissionQueue
from robot_stack.contract import services
from robot_stack.core.geometry import Pose2
from robot_stack.middleware.conversions import time_from_s
from robot_stack.middleware.node import StackNode
from robot_stack.ui import protocol as p
from robot_stack.ui.desk import named
from robot_stack.ui.nodes.audit_file import AuditFile
from robot_stack.ui.nodes.lane_file import LaneFile
from robot_stack.ui.nodes.mission_files import EditAnswer, MissionFiles
from robot_stack.ui.nodes.operator_requests import (
    DOOR_REFUSALS,
    QUEUE_REFUSALS,
    Answer,
    OperatorRequest,
    UndockRequest,
)
from robot_stack.ui.nodes.outputs import Outputs
from robot_stack.ui.nodes.pages import Pages
from robot_stack.ui.nodes.self_test import GuidedSelfTest
from robot_stack.ui.nodes.zone_file import ZoneFile
from robot_stack.ui.orders import QueueRequest, queue_request
from robot_stack.ui.params import ResetParams

_RIDE_COMMANDS = {"pause": "PAUSE", "resume": "RESUME", "abort": "ABORT"}


class PageCommands:
    """Runs in the node's own loop. Each request gets one response; the desk has checked the rights before."""

    def __init__(
        self,
        node: StackNode,
        reset: ResetParams,
        outputs: Outputs,
        pages: Pages,
        history: AuditFile,
        missions: MissionFiles,
        zones: ZoneFile,
        lanes: LaneFile,
        self_test: GuidedSelfTest,
    ) -> None:
        self._outputs, self._pages, self._history, self._missions = outputs, pages, history, missions
        self._zones, self._lanes, self._self_test = zones, lanes, self_test
        self._reset = OperatorRequest(node, reset, services.SAFETY_RESET, reset.tries)
        self._clear = OperatorRequest(node, reset, services.CLEAR_EMERGENCY_STOP, 1)
        self._queue = OperatorRequest(node, reset, services.EDIT_MISSION_QUEUE, 1, QUEUE_REFUSALS)
        self._undock = UndockRequest(node)
        self._door = OperatorRequest(node, reset, services.CONFIRM_DOOR, 1, DOOR_REFUSALS)
        self._node = node

    def poll(self) -> None:
        """Call regularly."""
        self._undock.poll()

    def carry_out(self, client: int, message: p.ClientMessage) -> None:
        match message:
            case p.Reset():
                self._outputs.ask_release()
                self._reset.ask(self._answer_of_server(client, message))
                return
            case p.ClearStop():
                self._clear.ask(self._answer_of_server(client, message), source=message.source)
                return
            case p.ConfirmDoor():
                self._door.ask(self._answer_of_server(client, message), name=message.name)
                return
            case p.AddOrder() | p.ChangeOrder() | p.Queue():
                wanted = queue_request(message, f"screen_{uuid.uuid4().hex[:8]}", self._node.now_s())
                self._queue.ask(self._answer_of_server(client, message), **_queue_fields(wanted))
                return
            case p.Undock():
                self._undock.ask(self._answer_of_server(client, message))
                return
            case p.CheckMission() | p.SaveMission() | p.DeleteMission():
                self._finish_edit(client, message, self._missions.edit(message))
                return
            case p.SaveZone() | p.DeleteZone():
                self._finish_edit(client, message, self._zones.edit(message))
                return
            case p.DrawLane() | p.DeleteLane():
                self._finish_edit(client, message, self._lanes.edit(message))
                return
            case p.SelfTest():
                why = self._self_test.handle(client, message, self._pages.who(client))
                self._pages.answer(client, message.id, not why, why)
                self._pages.show()
                return
            case p.Start():
                self._outputs.command("START_MISSION", message.mission)
            case p.Ride():
                self._outputs.command(_RIDE_COMMANDS[message.t])
            case p.Language():
                self._outputs.set_language(message.code)
            case p.Pose():
                self._outputs.set_pose(Pose2(message.x, message.y, message.yaw))
            case p.Goal():
                self._outputs.go(Pose2(message.x, message.y, message.yaw))
            case p.CancelGoal():
                self._outputs.cancel_goal()
            case p.CallStaff():
                self._pages.staff_called = message.on
        self._pages.answer(client, message.id, True)
        self._pages.show()

    def _answer_of_server(self, client: int, message: p.ClientMessage) -> Answer:
        who = self._pages.who(client)

        def answer(granted: bool, why: str, detail: str) -> None:
            self._history.add(who, f"{named(message)}: answered", "ok" if granted else f"{why}: {detail}")
            self._pages.answer(client, message.id, granted, why, detail)

        return answer

    def _finish_edit(self, client: int, message: p.ClientMessage, done: EditAnswer) -> None:
        """A check changes nothing and is not recorded."""
        if not message.t.endswith("_check"):
            self._history.add(self._pages.who(client), named(message), done.why or "ok")
            self._pages.show_files()
        self._pages.answer(client, message.id, not done.why, done.why, done.detail, **done.fields())


def _queue_fields(wanted: QueueRequest) -> dict[str, Any]:
    """The fields of the request to the mission manager."""
    order = MissionOrder(
        id=wanted.order_id,
        mission_id=wanted.mission_id,
        origin=MissionOrder.TOUCH_SCREEN,
        priority=wanted.priority,
        earliest=time_from_s(wanted.earliest_s),
    )
    return {"operation": getattr(EditMissionQueue.Request, wanted.operation), "order": order, "steps": wanted.steps}
