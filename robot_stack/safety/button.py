"""The emergency-stop button: what it says on ``/emergency_stop``, from what its contact and the others say.

Before the contact has ever been read nobody knows the button: it says nothing, so that a robot whose engine is still
starting does not latch an emergency stop. Once it has been readable for ``startup_settle_s`` without a break, a contact
that cannot be read means pressed. A contact that reads as pressed is believed from the first moment.
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
    """Says True (pressed) or False (a request to release) when there is something to say; times are steady seconds."""

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
        # A button found released has released nothing: another source's true must not be answered with a false.
        return None if was is None and not self.pressed else self.pressed

    def overheard(self, pressed: bool) -> bool:
        """Somebody has published ``pressed``; returns True if the button has to contradict with a true."""
        return self.pressed is True and not pressed
