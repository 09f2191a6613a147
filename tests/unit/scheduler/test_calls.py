"""Services, actions and workers."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from std_srvs.srv import SetBool

from custom_msgs.action import Dock
from robot_stack.contract import actions
from robot_stack.core.goals import GoalStatus
from robot_stack.middleware.port import CancelAnswer
from tests.unit.scheduler.rig import params, rig

_TYPE = "std_srvs/srv/SetBool"


def test_a_service_answers_after_both_ways() -> None:
    got, clients = [], []

    def server(port) -> None:
        def on_request(request, response, answer) -> None:
            response.success = request.data
            answer(response)

        port.serve(_TYPE, "/set", on_request)

    with rig() as stage:
        stage.node("server", server)
        stage.node("client", lambda port: clients.append(port.client(_TYPE, "/set")))
        stage.scheduler.run(0.1)
        assert not clients[0].service_is_ready()
        clients[0].call(SetBool.Request(data=True), got.append)  # lost: the server is not discovered yet
        stage.scheduler.run(0.3)
        assert clients[0].service_is_ready()
        clients[0].call(
            SetBool.Request(data=True), lambda answer: got.append((answer.success, round(1e3 * stage.scheduler.now_s)))
        )
        stage.scheduler.run(0.4)
        assert got == [(True, 307)]  # 2 + 3 + 2 ms
        stage.scheduler.processes["server"].kill()
        clients[0].call(SetBool.Request(data=True), got.append)
        stage.scheduler.run(0.5)
        assert clients[0].service_is_ready()  # until the lease ends
        stage.scheduler.run(3.0)
        assert not clients[0].service_is_ready()
    assert len(got) == 1


class Stage:
    """A server of /docking/dock and a client of it."""

    def __init__(self, stage) -> None:
        self.goals, self.clients, self.seen = [], [], []
        self.scheduler = stage.scheduler
        self.server = stage.node(
            "docking_controller", lambda port: port.serve_action(actions.DOCK, actions.DOCK.name, self.goals.append)
        )
        stage.node("mission_manager", lambda port: self.clients.append(port.action_client(actions.DOCK)))
        stage.scheduler.run(0.3)
        self.client = self.clients[0]

    def send(self):
        return self.client.send_goal(
            Dock.Goal(dock_id="a"), lambda yes: self.seen.append(yes), lambda f: self.seen.append(f.state)
        )

    def on_result(self, status, result) -> None:
        self.seen.append((status, result.success))

    def run_for(self, seconds: float) -> None:
        self.scheduler.run_for(seconds)


def test_action_returns_feedback_and_result_and_result_can_be_requested_again() -> None:
    with rig() as made:
        stage = Stage(made)
        assert stage.client.server_is_ready()
        goal = stage.send()
        stage.run_for(0.1)
        (served,) = stage.goals
        assert served.request.dock_id == "a"
        goal.ask_result(stage.on_result)
        served.publish_feedback(Dock.Feedback(state="SERVOING"))
        stage.run_for(0.1)
        assert stage.seen == [True, "SERVOING"]
        served.succeed(Dock.Result(success=True))
        assert not served.is_active
        stage.run_for(0.1)
        goal.ask_result(stage.on_result)
        stage.run_for(30.0)
        goal.ask_result(stage.on_result)
        stage.run_for(0.1)
    assert stage.seen[2:] == [(GoalStatus.SUCCEEDED, True)] * 3


def test_goals_are_cancelled_one_by_one_or_all_before_a_time() -> None:
    with rig() as made:
        stage = Stage(made)
        goal = stage.send()
        stage.run_for(0.1)
        before_ns = made.port("mission_manager").now_ns()
        stage.run_for(0.1)
        stage.send()
        stage.run_for(0.1)
        first, second = stage.goals
        assert first.goal_id != second.goal_id
        stage.client.cancel_all(Time(sec=before_ns // 10**9, nanosec=before_ns % 10**9))
        stage.run_for(0.1)
        assert (first.is_cancel_requested, second.is_cancel_requested) == (True, False)
        goal.cancel(stage.seen.append)
        stage.run_for(0.1)
        first.cancel(Dock.Result())
        goal.cancel(stage.seen.append)
        goal.ask_result(stage.on_result)
        stage.run_for(0.1)
    assert stage.seen == [True, True, CancelAnswer.ACCEPTED, CancelAnswer.ALREADY_ENDED, (GoalStatus.CANCELED, False)]


def test_restarted_action_server_rejects_previous_goal() -> None:
    with rig() as made:
        stage = Stage(made)
        goal = stage.send()
        stage.run_for(0.1)
        stage.server.restart()
        stage.run_for(0.5)
        goal.ask_result(stage.on_result)
        goal.cancel(stage.seen.append)
        stage.run_for(0.1)
    assert stage.seen == [True, (GoalStatus.UNKNOWN, False), CancelAnswer.UNKNOWN_GOAL]


def jobs(*, parallel: bool) -> list[tuple[float, int]]:
    """Returns the results of a worker with their times."""
    got: list[tuple[float, int]] = []

    def build(port) -> None:
        worker = port.worker("planner", world_waits=True)

        def tick() -> None:
            number = len(got)
            for item in range(3):
                worker.submit(
                    lambda item=item: sum(range(1000)) + number + item,
                    lambda result: got.append((stage.scheduler.now_s, result)),
                )

        port.add_timer(0.1, tick)

    with rig(
        given=params(workers={"default": {"median_ms": 20.0, "p99_ms": 60.0}, "names": {}}), parallel=parallel
    ) as stage:
        stage.node("node", build)
        stage.scheduler.run(2.0)
    return got


def test_jobs_take_their_time_one_after_the_other() -> None:
    times = []

    def build(port) -> None:
        worker = port.worker("planner")
        for _ in range(2):
            worker.submit(lambda: 1, lambda _: times.append(round(1e3 * stage.scheduler.now_s)))

    with rig() as stage:
        stage.node("node", build)
        stage.scheduler.run(1.0)
    assert times == [80, 100]  # constructed at 60 ms


def test_jobs_in_threads_give_the_same_as_inline() -> None:
    inline = jobs(parallel=False)
    assert len(inline) > 20
    assert jobs(parallel=True) == inline


def test_a_job_hangs_with_its_process_and_dies_with_it() -> None:
    times = []

    def build(port) -> None:
        worker = port.worker("planner")
        port.add_timer(
            0.1, lambda: worker.submit(lambda: 1, lambda _: times.append(round(1e3 * stage.scheduler.now_s)))
        )

    with rig() as stage:
        process = stage.node("node", build)
        stage.scheduler.at(320_000_000, process.hang, 0.03)  # a job runs from 313 to 333 ms
        stage.scheduler.at(420_000_000, process.kill)
        stage.scheduler.run(1.0)
    assert times == [133, 233, 363]


def test_an_exception_in_a_job_ends_the_process() -> None:
    for parallel in (False, True):
        with rig(parallel=parallel) as stage:
            stage.node("node", lambda port: port.worker("w", world_waits=True).submit(lambda: 1 // 0, lambda _: None))
            stage.scheduler.run(1.0)
            (failure,) = stage.scheduler.failures
        assert failure.time_ns == 80_000_000
        assert "ZeroDivisionError" in failure.text
