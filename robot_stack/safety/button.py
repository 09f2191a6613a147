"""The emergency-stop button: its messages on ``/emergency_stop``, from its contact and other sources' messages.

Before the first reading of the contact the button is unknown and publishes nothing, so that a robot whose engine is
still starting does not latch an emergency stop. After ``startup_settle_s`` of readings without a break, an unreadable
contact means pressed. A reading of pressed counts from the first one.
"""

from __future__ import annotations

from enum import Enum

from robot_stack.safety.debounce import Debounce
from robot_stack.safety.timing import Hold
from robot_stack.wmx.axes import StatusSnapshot


class Contact(Enum):
    """One reading of the contact. UNREADABLE: no status, a stale one, or a lost bus."""

    RELEASED = "released"
    PRESSED = "pressed"
    UNREADABLE = "unreadable"


def read_contact(status: StatusSnapshot | None, byte: int, bit: int) -> Contact:
    """The contact at an input bit of the motion engine. Normally closed: a cut wire reads as pressed."""
    if status is None or not status.communicating:
        return Contact.UNREADABLE
    return Contact.RELEASED if status.input_bit(byte, bit) else Contact.PRESSED


class EmergencyButton:
    """Returns True (pressed) or False (a request to release) when a message is due; times are steady seconds."""

    def __init__(self, debounce_s: float, startup_settle_s: float) -> None:
        self._debounced = Debounce(debounce_s)
        self._startup_settle_s = startup_settle_s
        self._readable_for = Hold()
        self._settled = False

    @property
    def pressed(self) -> bool | None:
        """The debounced button, None until it is known."""
        return self._debounced.state

    @property
    def settled(self) -> bool:
        """True once an unreadable contact counts as pressed."""
        return self._settled

    def update(self, contact: Contact, now_s: float) -> bool | None:
        """A reading, taken every few milliseconds; returns what to publish, None for nothing."""
        was = self.pressed
        readable_for_s = self._readable_for.update(contact is not Contact.UNREADABLE, now_s)
        if readable_for_s is None and not self._settled:
            return None
        self._settled = self._settled or (readable_for_s is not None and readable_for_s >= self._startup_settle_s)
        if not self._debounced.update(contact is not Contact.RELEASED, now_s):
            return None
        # A button first read as released publishes no release: another source's true must not be followed by a false.
        return None if was is None and not self.pressed else self.pressed

    def contradicts(self, pressed: bool) -> bool:
        """Handles a message of any source; returns True if the button has to contradict with a true."""
        return self.pressed is True and not pressed
