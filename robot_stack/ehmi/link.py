"""The link to the display: schedules commands and monitors the connection. Pure; times are steady seconds.

One command is in flight at a time; only a new state does not wait for the answer to the previous one. The display's
setting is its last echo: an echo that differs from the command is sent again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_stack.contract.display import Display
from robot_stack.ehmi import codec
from robot_stack.ehmi.codec import Command, Decoder, Kind
from robot_stack.ehmi.params import LinkParams

_STOP = codec.state_command(Display.EMERGENCY_STOP)
# Order of sending, so that a state is announced in its language and at its volume; a stop precedes all.
_ORDER = (Kind.LANGUAGE, Kind.VOLUME, Kind.STATE)
_STOP_ORDER = (Kind.STATE, Kind.LANGUAGE, Kind.VOLUME)


@dataclass(frozen=True, slots=True)
class Shown:
    """Settings of the display. state: EHMIState.state_num; language: en, ja, zh; volume: 0-10."""

    state: int
    language: str
    volume: int

    def commands(self) -> dict[Kind, Command]:
        """Raises ValueError for a setting that the display does not have."""
        return {
            Kind.STATE: codec.state_command(self.state),
            Kind.LANGUAGE: codec.language_command(self.language),
            Kind.VOLUME: codec.volume_command(self.volume),
        }


@dataclass(frozen=True, slots=True)
class LinkStatus:
    """linked: the display acknowledges. acknowledged_state: the last one, None before. fault: code, empty = none.

    text: for people. state_to_ack_s: from the request of the present state to its acknowledge, NaN before that.
    """

    linked: bool
    acknowledged_state: int | None
    fault: str
    text: str
    state_to_ack_s: float


@dataclass(frozen=True, slots=True)
class PortOrder:
    """Actions on the port, in this order: close it, open it, write these bytes."""

    close: bool = False
    open: bool = False
    data: bytes = b""


@dataclass(slots=True)
class _Sent:
    """The command that waits for its answer. due_s: when it counts as unanswered. refusal: the text of an ERROR."""

    command: Command
    tries: int
    due_s: float
    refusal: str = ""


class Link:
    """Events come by ``opened``, ``lost`` and ``received``; ``step`` returns the actions."""

    def __init__(self, params: LinkParams, wanted: Shown) -> None:
        self._params = params
        self._decoder = Decoder(checksum=params.checksum)
        self._wanted, self._wanted_s = wanted.commands(), math.nan
        self._sent_commands: dict[Kind, Command] = {}
        self._refused_s: dict[Kind, float] = {}
        self._sent: _Sent | None = None
        self._state_sent_s = self._probed_s = self._open_due_s = -math.inf
        self._silent_since_s = math.inf
        self._pause_s = params.back_off_s
        # open: the port. talking: the display has sent a line. linked: it acknowledges commands.
        self._open = self._opening = self._talking = self._linked = False
        self._flush_due = self._probe_by_state = False
        self._fault, self._problem = "", "the port has not been opened yet"
        self._acknowledged: int | None = None
        self._state_to_ack_s = math.nan

    @property
    def rejected(self) -> dict[str, int]:
        """Number of rejected lines of the display, by reason."""
        return dict(self._decoder.rejected)

    @property
    def status(self) -> LinkStatus:
        text = "; ".join(filter(None, (self._problem, self._fault and f"the display reports {self._fault}")))
        text = text or "the display acknowledges"
        return LinkStatus(self._linked, self._acknowledged, self._fault, text, self._state_to_ack_s)

    # --- events ------------------------------------------------------------------------------------------------------

    def show(self, wanted: Shown, now_s: float) -> None:
        """Raises ValueError for an invalid setting; the previous one then stays."""
        commands = wanted.commands()
        if commands[Kind.STATE] != self._wanted[Kind.STATE] or math.isnan(self._wanted_s):
            self._wanted_s, self._state_to_ack_s = now_s, math.nan
        for kind, command in commands.items():
            if command != self._wanted[kind]:
                self._refused_s.pop(kind, None)
        self._wanted = commands

    def opened(self, now_s: float) -> None:
        self._opening, self._open = False, True
        self._decoder.reset()
        self._forget()
        self._silent_since_s, self._probed_s = now_s, -math.inf
        # The display may still hold half a line from before the disconnection.
        self._flush_due, self._probe_by_state = True, False
        self._problem = "the display has not answered yet"

    def lost(self, why: str, now_s: float) -> None:
        """The port failed or cannot be opened: cable or adapter disconnected. The next open comes after a pause."""
        self._open = self._opening = self._talking = self._linked = False
        self._forget()
        self._problem = why
        self._open_due_s = now_s + self._pause_s
        self._pause_s = min(2.0 * self._pause_s, self._params.back_off_limit_s)

    def received(self, data: bytes, now_s: float) -> None:
        refused = self._decoder.rejected.total()
        lines = self._decoder.feed(data)
        if self._decoder.rejected.total() > refused and self._sent is not None and self._sent.tries == 1:
            # Most likely its answer. Only once: a line full of garbage must not use up all tries at once.
            self._sent.due_s = now_s
        for line in lines:
            match codec.parse_answer(line):
                case codec.Ok(command):
                    self._acknowledge(command, now_s)
                case codec.Refused(text):
                    self._refuse(text, now_s)
                case codec.Ready():
                    self._fault = ""
                    self._talking, self._silent_since_s = True, now_s
                    self._forget()
                case codec.Fault(code):
                    self._fault = code
                case None:
                    self._decoder.rejected["unknown answer"] += 1

    def _forget(self) -> None:
        """The display has lost its settings, or may have."""
        self._sent_commands.clear()
        self._refused_s.clear()
        self._sent = None

    def _acknowledge(self, command: Command, now_s: float) -> None:
        self._talking = self._linked = True
        self._problem, self._pause_s = "", self._params.back_off_s
        if self._sent is not None and self._sent.command == command:
            self._sent = None
        if command.kind is Kind.PING:
            return
        self._sent_commands[command.kind] = command
        if command.kind is Kind.STATE:
            self._acknowledged = int(command.value)
            if command == self._wanted[Kind.STATE] and math.isnan(self._state_to_ack_s):
                self._state_to_ack_s = now_s - self._wanted_s

    def _refuse(self, text: str, now_s: float) -> None:
        if self._sent is not None:
            self._sent.refusal, self._sent.due_s = text or "no reason given", now_s

    # --- actions -----------------------------------------------------------------------------------------------------

    def step(self, now_s: float) -> PortOrder:
        """Call after every event, and at ``next_due_s``."""
        if not self._open:
            if self._opening or now_s < self._open_due_s:
                return PortOrder()
            self._opening = True
            return PortOrder(open=True)
        command = self._retry(now_s)
        if not self._talking and now_s - self._silent_since_s >= self._params.reopen_s:
            # A hanging adapter recovers only when reopened.
            self.lost(f"no data from the display for {self._params.reopen_s:g} s", now_s)
            return PortOrder(close=True)
        command = self._overtaking(now_s) or command
        if command is None and self._sent is None:
            command = self._next(now_s) if self._talking else self._probe(now_s)
        return PortOrder(data=self._send(command, now_s)) if command is not None else PortOrder()

    def next_due_s(self) -> float:
        """Time of the next ``step`` if nothing happens before; infinite while an open is in progress."""
        if self._opening:
            return math.inf
        if not self._open:
            return self._open_due_s
        if not self._talking:
            due_s = min(self._probed_s + self._params.probe_s, self._silent_since_s + self._params.reopen_s)
            return min(due_s, self._sent.due_s) if self._sent is not None else due_s
        if self._sent is not None:
            return self._sent.due_s
        again_s = [] if Kind.STATE in self._refused_s else [self._state_sent_s]
        return min(*again_s, *self._refused_s.values(), math.inf) + self._params.repeat_s

    def _retry(self, now_s: float) -> Command | None:
        """The unanswered command with its present value; None if there is none, or if it was given up."""
        sent = self._sent
        if sent is None or now_s < sent.due_s:
            return None
        probing = not self._talking
        if not probing and sent.tries < self._params.tries:
            return self._wanted.get(sent.command.kind, sent.command)
        self._sent = None
        if probing:
            return None
        if sent.refusal:  # connected, but it rejects the command
            self._refused_s[sent.command.kind] = now_s
            self._problem = f"the display refuses {sent.command.text!r}: {sent.refusal}"
            return None
        self._talking = self._linked = False
        self._forget()
        self._silent_since_s = self._probed_s = now_s
        self._problem = f"no acknowledgement of {sent.command.text!r} after {sent.tries} tries"
        return None

    def _overtaking(self, now_s: float) -> Command | None:
        """A new state is sent at once instead of one that waits for its answer; a stop instead of any command."""
        wanted, sent = self._wanted[Kind.STATE], self._sent
        if sent is None or not self._talking or sent.command == wanted or not self._is_due(Kind.STATE, now_s):
            return None
        return wanted if sent.command.kind is Kind.STATE or self._stopped else None

    def _next(self, now_s: float) -> Command | None:
        return next((self._wanted[kind] for kind in self._order if self._is_due(kind, now_s)), None)

    def _probe(self, now_s: float) -> Command | None:
        """PING and the state in turn: a display that only receives must still show the right state."""
        if now_s < self._probed_s + self._params.probe_s:
            return None
        self._probed_s = now_s
        self._probe_by_state = not self._probe_by_state
        return codec.PING if self._probe_by_state else self._wanted[Kind.STATE]

    @property
    def _stopped(self) -> bool:
        return self._wanted[Kind.STATE] == _STOP

    @property
    def _order(self) -> tuple[Kind, ...]:
        return _STOP_ORDER if self._stopped else _ORDER

    def _is_due(self, kind: Kind, now_s: float) -> bool:
        repeat_s = self._params.repeat_s
        if now_s < self._refused_s.get(kind, -math.inf) + repeat_s:
            return False
        if self._sent_commands.get(kind) != self._wanted[kind]:
            return True
        return kind is Kind.STATE and now_s >= self._state_sent_s + repeat_s

    def _send(self, command: Command, now_s: float) -> bytes:
        sent = self._sent
        tries = sent.tries + 1 if sent is not None and sent.command == command else 1
        self._sent = _Sent(command, tries, now_s + self._params.acknowledge_s)
        self._refused_s.pop(command.kind, None)
        if command.kind is Kind.STATE:
            self._state_sent_s = now_s
        flush, self._flush_due = b"\n" if self._flush_due else b"", False
        return flush + codec.encode(command.text, checksum=self._params.checksum)
