"""navigation_controller: goals of navigate_to_pose and /goal_pose to /cmd_vel and /plan.

/cmd_vel is always published at the contract's rate, zero without a goal: it shows that the node works, and the drive's
arbitration prefers any other source.
"""

from __future__ import annotations

from dataclasses import replace

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import PointCloud2

from custom_msgs.msg import BuildingState, VelocityLimit
from custom_msgs.srv import ConfirmDoor
from robot_stack.contract import frames, services, topics
from robot_stack.core.config import load
from robot_stack.core.departure import Departure, DepartureParams
from robot_stack.core.geometry import ZERO_TWIST
from robot_stack.core.levels import load_levels
from robot_stack.core.limits import SpeedLimit
from robot_stack.core.route_graph import graph_files, load_graph
from robot_stack.core.site_map import load_map
from robot_stack.core.zones import load_zones, zone_files
from robot_stack.middleware.conversions import pose_from_msg, pose_stamped, time_to_s, twist_from_msg
from robot_stack.middleware.motion_warning import MotionWarnings
from robot_stack.middleware.node import StackNode
from robot_stack.middleware.port import ActionGoal
from robot_stack.middleware.wheelchair import WheelchairInput
from robot_stack.navigation.background_planner import BackgroundPlanner
from robot_stack.navigation.controller import NavigationController, Output, Situation
from robot_stack.navigation.goal import GoalEnd
from robot_stack.navigation.nodes.messages import costmap_cells, door_state, goal_request, people_in
from robot_stack.navigation.nodes.navigation_goals import NavigationGoals
from robot_stack.navigation.nodes.outputs import NavigationOutputs
from robot_stack.navigation.params import NavigationParams
from robot_stack.navigation.pose_source import Located, PoseSource
from robot_stack.navigation.routes import RouteSolver
from robot_stack.navigation.states import NavigationState
from robot_stack.navigation.warm_up import warm_up

_END_S = 2.0  # timeout of the wait for a running search
_TICKS_PER_FEEDBACK = 4  # 5 Hz: the plan changes with the costmap


class NavigationControllerNode(StackNode):
    """Stores inputs in callbacks; each tick runs the kernel ``controller`` and publishes."""

    def __init__(self) -> None:
        super().__init__("navigation_controller", NavigationParams)
        motion = self.robot.empty
        self._poses = PoseSource(self.params.pose, motion.max_speed_mps, motion.max_yaw_rate_radps)
        self._departure = Departure(load(DepartureParams, "departure"))
        self._motion_warnings = MotionWarnings(self, given=self._departure.announced)
        grid = load_map(self.params.map).grid if self.params.map else None
        zones = load_zones(self.params.map) if self.params.map else ()
        graph = load_graph(self.params.map) if self.params.map else None
        if zones:
            self.get_logger().info(f"{len(zones)} zones of {zone_files(self.params.map).in_force}")
        if graph is not None:
            self.get_logger().info(f"{len(graph.ends)} lanes of {graph_files(self.params.map).in_force}")
        levels = load_levels(self.params.map) if self.params.map else None
        site = (grid, self._background_planner, zones, graph, levels)
        self.controller = NavigationController(self.params, self.robot, frames.MAP, self._departure, *site)
        if grid is not None or self.params.use_costmap:
            warm_up()
        inputs = (topics.ODOM, topics.CURRENT_POSE, topics.LOCAL_COSTMAP, topics.PEOPLE)
        self._problems = {row.name: "" for row in inputs}
        self._outputs = NavigationOutputs(self, self.params.people.sightings)
        self._goals = NavigationGoals(self, self._begin)
        self._last_located: tuple[Located, Time] | None = None
        self._ticks = 0
        if self.controller.around.doors.exist:
            self.subscribe(topics.BUILDING_STATE, self._on_building)
        self.serve(services.CONFIRM_DOOR, self._on_confirm)
        self.subscribe(topics.ODOM, self._on_odometry)
        self.subscribe(topics.CURRENT_POSE, self._on_pose)
        self.subscribe(topics.GOAL_POSE, self._on_goal)
        self._limit = self.subscribe(topics.VELOCITY_LIMIT, self._on_velocity_limit)
        self.subscribe(topics.MISSION_VELOCITY_LIMIT, self._on_mission_limit)
        self._teleop = self.subscribe(topics.TELEOP_CMD_VEL)
        WheelchairInput(self, self.controller.set_passenger)
        if self.params.use_costmap:
            self.subscribe(topics.LOCAL_COSTMAP, self._on_costmap)
            self.subscribe(topics.PEOPLE, self._on_people)
        self._outputs.plan(self.controller.path)
        self.every(topics.CMD_VEL.nominal_rate_hz, self._tick)

    def _background_planner(self, solver: RouteSolver) -> BackgroundPlanner:
        self._planner = BackgroundPlanner(solver, self.worker("planning", world_waits=True))
        return self._planner

    def destroy_node(self) -> None:
        self._planner.close(_END_S)
        super().destroy_node()

    def on_emergency_stop(self) -> None:
        self.controller.stop()
        self._outputs.command(ZERO_TWIST)
        self._end_goal(self.controller.take_end())

    def safe_output(self) -> None:
        self._outputs.command(ZERO_TWIST)

    def _on_odometry(self, message: Odometry) -> None:
        pose, twist = pose_from_msg(message.pose.pose), twist_from_msg(message.twist.twist)
        problem = self._poses.on_odometry(time_to_s(message.header.stamp), pose, twist, self.steady_s())
        self._problems[topics.ODOM.name] = problem

    def _on_pose(self, message: PoseStamped) -> None:
        if message.header.frame_id == frames.MAP:
            stamp_s = time_to_s(message.header.stamp)
            problem = self._poses.on_pose(stamp_s, pose_from_msg(message.pose), self.steady_s())
        else:
            problem = f"/current_pose frame_id is {message.header.frame_id!r}, must be {frames.MAP!r}"
        self._problems[topics.CURRENT_POSE.name] = problem

    def _on_goal(self, message: PoseStamped) -> None:
        if not message.header.frame_id:
            self.controller.cancel()
            self._end_goal(self.controller.take_end())
            self._outputs.plan(self.controller.path)
        else:
            self._begin(message)

    def _on_building(self, message: BuildingState) -> None:
        self.controller.around.doors.on_state(door_state(message, self._outputs.requester), self.now_s())

    def _on_confirm(self, request: ConfirmDoor.Request, response: ConfirmDoor.Response) -> ConfirmDoor.Response:
        refusal = self.controller.around.doors.confirm(request.name, self.now_s())
        response.success, response.message = not refusal, refusal or f"door {request.name}: the robot passes once"
        return response

    def _begin(self, message: PoseStamped, goal: ActionGoal | None = None) -> None:
        """goal: the handle of an action goal. Its call cannot be stale, so that, as in Nav2, its stamp may be old."""
        located, _ = self._poses.located(self.now_s(), self.steady_s())
        request = goal_request(message)
        if goal is not None:
            request = replace(request, stamp_s=0.0)
        self.controller.request(request, self.now_s(), located, emergency_stop=self.emergency_stop)
        self._goals.begin(goal)
        self._end_goal(self.controller.take_end())
        self._outputs.plan(self.controller.path)

    def _end_goal(self, end: GoalEnd | None) -> None:
        if end is None:
            return
        log = self.get_logger()
        log.error(end.text) if end.aborted else log.info(end.text)
        self._goals.end(end)

    def _on_costmap(self, message: OccupancyGrid) -> None:
        stamp, info, around = message.header.stamp, message.info, self.controller.around
        try:
            cells = costmap_cells(message)
        except ValueError as error:
            problem = str(error)
        else:
            origin = pose_from_msg(info.origin)
            problem = around.on_costmap(time_to_s(stamp), info.resolution, origin, cells, self.steady_s())
        self._problems[topics.LOCAL_COSTMAP.name] = problem

    def _on_people(self, message: PointCloud2) -> None:
        around, stamp = self.controller.around, message.header.stamp
        try:
            around.on_people(time_to_s(stamp), people_in(message), self.steady_s())
        except ValueError as error:
            self._problems[topics.PEOPLE.name] = str(error)
        else:
            self._problems[topics.PEOPLE.name] = ""
            self._outputs.people(around.people, stamp)

    def _on_velocity_limit(self, message: VelocityLimit) -> None:
        self.controller.set_speed_limit(_limit_of(message))

    def _on_mission_limit(self, message: VelocityLimit) -> None:
        self.controller.set_way_limit(_limit_of(message))

    def _tick(self) -> None:
        if self._limit.received and not self._limit.fresh():
            self.controller.set_speed_limit(SpeedLimit(0.0, 0.0))  # the speed limit is stale
        located, problem = self._poses.located(self.now_s(), self.steady_s())
        blind = self.controller.around.problem(self.steady_s())
        problem = "; ".join(filter(None, self._problems.values())) or problem or blind
        situation = Situation(self.now_s(), located, problem, self.emergency_stop, blind, self._teleop.fresh())
        if self._goals.cancel_requested:
            self.controller.cancel()
        output = self.controller.tick(situation)
        self._motion_warnings.publish(self._departure.remaining_s)
        self._outputs.command(output.twist)
        self._outputs.plan(self.controller.path)
        self._outputs.doors(output.doors)
        self._outputs.relocate(output.relocated)
        self._end_goal(output.end)
        self._publish_feedback(located)
        self._report_state(output, problem)

    def _publish_feedback(self, located: Located | None) -> None:
        """Also while the pose is unknown, with the last one: the feedback shows that the goal is not lost."""
        if located is not None:
            self._last_located = located, self.stamp()
        self._ticks += 1
        if self._ticks % _TICKS_PER_FEEDBACK or not self._goals.active:
            return
        pose, twist = PoseStamped(), ZERO_TWIST
        if self._last_located is not None:
            last, stamp = self._last_located
            pose, twist = pose_stamped(last.pose, frames.MAP, stamp), last.twist
        self._goals.publish_feedback(pose, twist, self.controller.remaining_m, self.controller.recoveries)

    def _report_state(self, output: Output, missing: str) -> None:
        self._outputs.status(output.text)
        held = output.state is NavigationState.HELD
        self.set_health(not missing, missing or (f"held: {output.text}" if held else output.text))
        self.report.values = output.figures()


def _limit_of(message: VelocityLimit) -> SpeedLimit:
    return SpeedLimit(message.max_linear_velocity, message.max_angular_velocity)
