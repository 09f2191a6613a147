"""Routes that come with their order: the mission made of one, and its next parts."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from robot_stack.core.mission import MAX_WAYPOINTS, Home, Kind, Mission, Waypoint
from robot_stack.core.mission_library import MissionError, judge
from robot_stack.mission.orders import Order, QueueRefusal

# An answer names this many problems of a route.
_NAMED_PROBLEMS = 5


def own_mission(mission_id: str, waypoints: Sequence[Mapping[str, Any]]) -> Mission:
    """The mission of a route. Raises MissionError with one sentence for each problem.

    waypoints: as in a mission file. Home is the last waypoint: a low battery sends the robot nowhere else.
    """
    if len(waypoints) > MAX_WAYPOINTS:
        raise MissionError(f"a route has at most {MAX_WAYPOINTS} waypoints, this one has {len(waypoints)}")
    names = {"en": mission_id, "ja": mission_id, "zh": mission_id}
    home = {"x": 0.0, "y": 0.0, "yaw": 0.0}
    mission, problems = judge({"id": mission_id, "name": names, "home": home, "waypoints": list(waypoints)})
    if mission is None:
        named = [f"{problem.where}: {problem.text}" for problem in problems if not problem.where.startswith("name.")]
        more = [f"and {len(named) - _NAMED_PROBLEMS} more problems"] if len(named) > _NAMED_PROBLEMS else []
        raise MissionError("; ".join(named[:_NAMED_PROBLEMS] + more))
    return _ending(mission)


def action_of(kind: str, wait_s: float, dock_id: str) -> Any:
    """An action as in a mission file. Only the value that belongs to its kind counts."""
    values = {Kind.WAIT.value: wait_s, Kind.DOCK.value: dock_id}
    return {kind: values[kind]} if kind in values else kind


def part_of(waypoints: Sequence[Mapping[str, Any]]) -> tuple[Waypoint, ...]:
    """The next part of a route, which may be empty. Raises MissionError as ``own_mission``."""
    return own_mission("part", waypoints).waypoints if waypoints else ()


def digest(mission: Mission) -> str:
    """Identifies the route of a mission that is not kept."""
    content = json.dumps([waypoint.model_dump(mode="json") for waypoint in mission.waypoints], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:32]


def with_part(
    order: Order, mission: Mission, first: int, part: tuple[Waypoint, ...], *, more_follows: bool
) -> tuple[Order, Mission]:
    """The order and its mission with the next part of the route: themselves if nothing is new.

    more_follows: the route stays open. Raises QueueRefusal for a closed route, and as ``extended``.
    """
    longer = extended(mission, first, part)
    if longer is mission and order.open == more_follows:
        return order, mission
    if not order.open:
        raise QueueRefusal(f"the route of order {order.id!r} is complete, it cannot be extended")
    have, end = len(longer.waypoints), first + len(part)
    if part and not more_follows and end < have:
        raise QueueRefusal(f"the route has {have} waypoints, it cannot end with its first {end}")
    return replace(order, open=more_follows), longer


def extended(mission: Mission, first: int, part: tuple[Waypoint, ...]) -> Mission:
    """``mission`` with the waypoints of ``part`` that it does not contain yet: itself if it contains all.

    first: index of part[0] in the route. Raises QueueRefusal for a gap, for other contents and for a route too long.
    """
    have = mission.waypoints
    if first > len(have) and part:
        raise QueueRefusal(
            f"the route has {len(have)} waypoints, the part begins at {first}: {first - len(have)} missing"
        )
    for index, (there, given) in enumerate(zip(have[first:], part, strict=False), first):
        if there != given:
            raise QueueRefusal(f"waypoint {index} of the route is {there.name!r} already, with another content")
    new = part[len(have) - first :]
    if not new:
        return mission
    names = {waypoint.name for waypoint in have}
    twice = [waypoint.name for waypoint in new if waypoint.name in names]
    if twice:
        raise QueueRefusal(
            f"every waypoint needs a unique name: {', '.join(twice[:_NAMED_PROBLEMS])} is in the route already"
        )
    if len(have) + len(new) > MAX_WAYPOINTS:
        raise QueueRefusal(f"a route has at most {MAX_WAYPOINTS} waypoints, this one would have {len(have) + len(new)}")
    return _ending(mission.model_copy(update={"waypoints": (*have, *new)}))


def _ending(mission: Mission) -> Mission:
    last = mission.waypoints[-1]
    return mission.model_copy(update={"home": Home(x=last.x, y=last.y, yaw=last.yaw)})
