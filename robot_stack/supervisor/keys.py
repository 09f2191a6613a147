"""The operator's two keys of the emergency stop, behind the control socket.

{"verb": "estop"}    -> published: {"ok", "listeners", "received"}; "safety" shows whether it took effect
{"verb": "release"}  -> published, for this operator's source only
{"verb": "reset"}    -> the safety monitor's answer: {"ok", "granted", "reason"}
{"verb": "safety"}   -> the last state from the safety monitor
"""

from __future__ import annotations

from dataclasses import asdict

from robot_stack.supervisor.control import Reply
from robot_stack.supervisor.node import ResetAnswer
from robot_stack.supervisor.node_thread import NodeThread

VERBS = ("estop", "release", "reset", "safety")
_ANSWER_S = 2.0
_DEAF = {"ok": False, "error": "the supervisor has no node in the graph"}


class Keys:
    """Served from the supervisor's loop; ``tick`` sends responses that depend on the safety monitor."""

    def __init__(self, thread: NodeThread) -> None:
        self._thread = thread
        self._waiting: list[tuple[ResetAnswer, Reply, float]] = []

    def on_request(self, verb: str, reply: Reply, now_s: float) -> None:
        node = self._thread.node
        if node is None:
            reply(_DEAF)
        elif verb in ("estop", "release"):
            before = node.safety()
            listeners = node.publish_stop(verb == "estop")
            reply({"ok": True, "listeners": listeners, "received": before.received if before else 0})
        elif verb == "safety":
            safety = node.safety()
            reply({"ok": True, "safety": asdict(safety) if safety else None})
        else:
            answer = node.ask_reset()
            if answer is None:
                reply({"ok": False, "error": "no safety monitor serves /safety/reset"})
            else:
                self._waiting.append((answer, reply, now_s + _ANSWER_S))

    def tick(self, now_s: float) -> None:
        waiting, self._waiting = self._waiting, []
        for answer, reply, until_s in waiting:
            if (response := answer.response) is not None:
                reply({"ok": True, "granted": response.success, "reason": response.message})
            elif now_s > until_s:
                reply({"ok": False, "error": "the safety monitor does not answer /safety/reset"})
            else:
                self._waiting.append((answer, reply, until_s))
