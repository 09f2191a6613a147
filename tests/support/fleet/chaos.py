"""A master and the agent's kernel with its journal, between which everything fails; deterministic by its seed.

Messages are lost, doubled, late and thus reordered; the broker is away; the agent is killed around the writes of its
journal; the clocks jump. Times in s, of a virtual clock.
"""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import dataclass, replace

from robot_stack.core.geometry import Pose2
from robot_stack.fleet.link import Topic
from robot_stack.fleet.record import Phase
from robot_stack.fleet.vehicle import Stop
from tests.unit.fleet.master import HEADER, Bench, Data, action, node, order, statuses

TICK_S = 0.1
CONSISTENT_S = 5.0
_LOSS, _TWICE, _LATEST_S = 0.3, 0.1, 2.0
_STRAGGLERS, _STRAGGLER_S = 0.05, 60.0  # as a broker sends what it has kept for a session
_LONGEST_OUTAGE_S, _LONGEST_RESTART_S = 8.0, 3.0
_UNHEARD = 0.2  # requests to the mission manager
_SERVED_S = 1.5  # of a waypoint, on the average
_REPEAT_S = 3.0  # of the master, without an answer
_LIMIT_S = 900.0
_UNIX_S = 1.7e9


@dataclass
class Counts:
    """What happened in one ride. slowest_s: from a recovery to a state that is right."""

    kills: int = 0
    outages: int = 0
    lost: int = 0
    twice: int = 0
    recoveries: int = 0
    slowest_s: float = 0.0
    duration_s: float = 0.0


class _Wire:
    """One direction between master and agent. perfect: without faults; away: the broker is not there."""

    def __init__(self, rng: random.Random, counts: Counts) -> None:
        self._rng, self._counts = rng, counts
        self._under_way: list[tuple[float, int, Topic, bytes]] = []
        self._number = 0
        self.perfect = self.away = False

    def send(self, topic: Topic, payload: bytes, now_s: float) -> None:
        if self.away or (not self.perfect and self._rng.random() < _LOSS):
            self._counts.lost += 1
            return
        twice = not self.perfect and self._rng.random() < _TWICE
        self._counts.twice += twice
        for _ in range(1 + twice):
            latest_s = _STRAGGLER_S if self._rng.random() < _STRAGGLERS else _LATEST_S
            at_s = now_s if self.perfect else now_s + self._rng.uniform(0.0, latest_s)
            self._number += 1
            self._under_way.append((at_s, self._number, topic, payload))

    def arrived(self, now_s: float) -> list[tuple[Topic, bytes]]:
        due = sorted(item for item in self._under_way if item[0] <= now_s)
        self._under_way = [item for item in self._under_way if item[0] > now_s]
        return [(topic, payload) for _, _, topic, payload in due]


class Master:
    """Gives its orders one after the other, each in two messages, and repeats what no state shows.

    cancels: numbers of the orders that it cancels under way. Of two states it uses the one with the greater header.
    """

    def __init__(self, rng: random.Random, orders: int) -> None:
        self.plan = [(_first(number), _update(number)) for number in range(orders)]
        self.cancels = {number for number in range(orders) if rng.random() < 0.3}
        self.number = 0
        self.state: Data = {}
        self.states: list[Data] = []
        self._sent_s, self._header, self._skew_s = -_REPEAT_S, 0, rng.uniform(-7200.0, 7200.0)

    @property
    def done(self) -> bool:
        return self.number == len(self.plan)

    def take(self, topic: Topic, payload: bytes) -> None:
        if topic is Topic.STATE:
            state = json.loads(payload)
            self.states.append(state)
            if not self.state or state["headerId"] > self.state["headerId"]:
                self.state = state

    def speak(self, now_s: float) -> tuple[Topic, bytes] | None:
        """Its message, if one is due."""
        if self.done:
            return None
        first, update = self.plan[self.number]
        state, own = self.state, self.state.get("orderId") == first["orderId"]
        cancel = f"cancel {self.number}"
        if own and self._has_ended(state, cancel):
            self.number, self._sent_s = self.number + 1, now_s - _REPEAT_S
            return None
        if own and state["orderUpdateId"] == 1 and self.number not in self.cancels:
            return None
        if now_s - self._sent_s < _REPEAT_S:
            return None
        self._sent_s = now_s
        self._header += 1
        if own and self.number in self.cancels:
            return Topic.INSTANT_ACTIONS, self._bytes({"actions": [action("cancelOrder", cancel)]}, now_s)
        return Topic.ORDER, self._bytes(update if own else first, now_s)

    def _has_ended(self, state: Data, cancel: str) -> bool:
        if self.number in self.cancels:
            return statuses(state).get(cancel) == "FINISHED"
        running = {status for name, status in statuses(state).items() if name.startswith("wait")} - {
            "FINISHED",
            "FAILED",
        }
        return state["orderUpdateId"] == 1 and not state["nodeStates"] and not running

    def _bytes(self, data: Data, now_s: float) -> bytes:
        second = int(now_s + self._skew_s) % 60
        header = HEADER | {"headerId": self._header, "timestamp": f"2026-05-01T09:30:{second:02}.00Z"}
        return json.dumps(header | {key: value for key, value in data.items() if key not in HEADER}).encode()


def _first(number: int) -> Data:
    """From the end of the order before; all orders lead to the same places and back."""
    name, out = f"order {number}", number % 2 == 0
    ends = [(0.0, "a"), (2.0, "b"), (4.0, "c"), (6.0, "d")]
    places = ends if out else ends[::-1]
    nodes = [
        node(place, 2 * index, x, *_wait(number, index), released=index < 3, allowedDeviationXY=100.0)
        for index, (x, place) in enumerate(places)
    ]
    return order(nodes, name)


def _update(number: int) -> Data:
    data = _first(number)
    nodes = [one | {"released": True} for one in data["nodes"][2:]]
    return order(nodes, data["orderId"], 1)


def _wait(number: int, index: int) -> list[Data]:
    return [action("wait", f"wait {number}.{index}", duration=1.0)] if index in (1, 3) else []


class Chaos:
    """One ride. Raises AssertionError with what went wrong."""

    def __init__(self, seed: int, orders: int = 4) -> None:
        self._rng = random.Random(seed)
        self.counts = Counts()
        self._bench = Bench()
        self._master = Master(self._rng, orders)
        self._to_robot, self._to_master = _Wire(self._rng, self.counts), _Wire(self._rng, self.counts)
        self._now_s = self._skew_s = 0.0
        self._away_s = self._dead_s = 0.0  # until then
        self._kept: list[tuple[Topic, bytes]] = []  # by the broker, for a session without a connection
        self._served: list[tuple[str, Stop]] = []
        self._recovered_s: float | None = None
        self._connect()

    def run(self) -> Counts:
        next_recovery_s = self._rng.uniform(20.0, 40.0)
        while not self._master.done or self._recovered_s is not None:
            assert self._now_s < _LIMIT_S, f"order {self._master.number} is lost: {self._bench.kernel.record.order}"
            if self._now_s >= next_recovery_s:
                self._recover()
                next_recovery_s = self._now_s + self._rng.uniform(30.0, 60.0)
            self._step()
        self._recover()
        self._finish_recovery()
        self._check()
        self.counts.duration_s = self._now_s
        return self.counts

    # --- one tick ----------------------------------------------------------------------------------------------------

    def _step(self) -> None:
        self._now_s += TICK_S
        self._disturb()
        message = self._master.speak(self._now_s)
        if message is not None:
            self._to_robot.send(*message, self._now_s)
        for item in self._to_robot.arrived(self._now_s):
            self._deliver(item)
        if self._rng.random() < TICK_S / _SERVED_S:
            self._serve()
        if self._dead_s <= self._now_s:
            self._agent()
        for topic, payload in self._to_master.arrived(self._now_s):
            self._master.take(topic, payload)
        self._watch()

    def _disturb(self) -> None:
        perfect = self._recovered_s is not None
        was_away = self._away_s > 0.0
        if not perfect and not was_away and self._rng.random() < TICK_S / 20.0:
            self._away_s = self._now_s + self._rng.uniform(0.1, _LONGEST_OUTAGE_S)
            self.counts.outages += 1
        if not perfect and self._rng.random() < TICK_S / 30.0:
            self._skew_s = self._rng.uniform(-3600.0, 3600.0)
        if was_away and self._away_s <= self._now_s:
            self._away_s = 0.0
            self._connect()
        self._to_robot.away = self._to_master.away = self._away_s > 0.0
        if self._dead_s and self._dead_s <= self._now_s:
            self._dead_s = 0.0
            self._connect()

    def _deliver(self, item: tuple[Topic, bytes]) -> None:
        """Without a connection the broker keeps it for the session, or forgets it."""
        if self._away_s <= 0.0 and self._dead_s <= 0.0:
            self._bench.kernel.receive(*item)
        elif self._rng.random() < 0.5:
            self._kept.append(item)

    def _connect(self) -> None:
        if self._away_s > 0.0 or self._dead_s > 0.0:
            return
        self._bench.kernel.connected()
        for item in self._kept:
            self._bench.kernel.receive(*item)
        self._kept = []

    def _serve(self) -> None:
        name = self._bench.manager.current
        stop = self._bench.manager.serve()
        if stop is not None:
            self._served.append((name, stop))
            self._bench.robot = replace(self._bench.robot, pose=Pose2(stop.x, stop.y, stop.yaw))

    def _agent(self) -> None:
        bench = self._bench
        bench.now_s = self._now_s
        bench.kernel.tick(bench.manager.view(bench.robot), self._now_s, _UNIX_S + self._now_s + self._skew_s)
        writes = bench.kernel.record.model_dump_json() != bench.disk
        chance = 0.3 if writes else 0.002
        stage = self._rng.randrange(4) if self._recovered_s is None and self._rng.random() < chance else None
        if stage == 0:
            return self._kill()
        bench.save()
        if stage == 1:
            return self._kill()
        bench.silent = self._recovered_s is None and self._rng.random() < _UNHEARD
        outputs = bench.perform(answer=stage != 2)
        for topic, payload in outputs.messages.items():
            self._to_master.send(topic, payload, self._now_s)
        if stage is not None:
            self._kill()
        return None

    def _kill(self) -> None:
        self.counts.kills += 1
        self._bench.restart()
        self._dead_s = self._now_s + self._rng.uniform(TICK_S, _LONGEST_RESTART_S)

    # --- checks ------------------------------------------------------------------------------------------------------

    def _finish_recovery(self) -> None:
        while self._recovered_s is not None:
            self._step()

    def _recover(self) -> None:
        """No more faults for a while: from the connection on, the state must become right."""
        self._away_s = self._dead_s = 0.0
        self._to_robot.away = self._to_master.away = False
        self._to_robot.perfect = self._to_master.perfect = True
        self._recovered_s = self._now_s
        self._connect()

    def _watch(self) -> None:
        if self._recovered_s is None:
            return
        since_s = self._now_s - self._recovered_s
        if self._is_right():
            self.counts.recoveries += 1
            self.counts.slowest_s = max(self.counts.slowest_s, since_s)
            self._recovered_s = None
            self._to_robot.perfect = self._to_master.perfect = False
        else:
            assert since_s <= CONSISTENT_S, f"{since_s:.1f} s after the recovery the master has {self._master.state}"

    def _is_right(self) -> bool:
        """The master's newest state is what the mission manager has carried out."""
        state, record = self._master.state, self._bench.kernel.record.order
        if not state or record is None:
            return bool(state)
        served = [stop for name, stop in self._served if record.part is not None and name == record.part.id]
        passed = [stop.node for stop in served if not stop.action]
        done = {stop.action for stop in served if stop.action}
        shown = {name for name, status in statuses(state).items() if status == "FINISHED" and name.startswith("wait")}
        return (
            (state["orderId"], state["orderUpdateId"]) == (record.id, record.update_id)
            and state["lastNodeSequenceId"] == (passed[-1] if passed else 0)
            and shown == done
        )

    def _check(self) -> None:
        manager, master = self._bench.manager, self._master
        numbers = [int(name.rpartition("_")[2]) for name in manager.added]
        assert numbers == sorted(set(numbers)), f"handed over: {manager.added}"
        # One that is cancelled at once is not even handed over.
        assert {*numbers, *master.cancels} == set(range(len(master.plan))), f"handed over: {manager.added}"
        for number, name in zip(numbers, manager.added, strict=True):
            nodes = [(stop.node, stop.action) for other, stop in self._served if other == name]
            whole = [(2, ""), (2, f"wait {number}.1"), (4, ""), (6, ""), (6, f"wait {number}.3")]
            if number in master.cancels:
                assert nodes == whole[: len(nodes)], f"{name}: {nodes}"
            else:
                assert nodes == whole, f"{name}: {nodes}"
        assert not [
            error for state in master.states for error in state["errors"] if error["errorType"] == "orderAborted"
        ]
        phases = {Phase.COMPLETED, Phase.CANCELLED}
        record = self._bench.kernel.record.order
        assert record is not None
        assert record.phase in phases, record


def seeds_that_fail(seeds: range, done: Callable[[int, Counts], None]) -> dict[int, str]:
    """What went wrong by seed. done: called with the counts of each good one."""
    failed = {}
    for seed in seeds:
        try:
            done(seed, Chaos(seed).run())
        except AssertionError as error:
            failed[seed] = str(error)
    return failed
