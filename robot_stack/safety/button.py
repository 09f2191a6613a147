"""The emergency-stop button: what it says on ``/emergency_stop``, from what its contact and the others say.

Before the contact has ever been read nobody knows the button: it says nothing, so that a robot whose engine is still
starting does not latch an emergency stop. From the first reading on, an unreadable contact means pressed.
"""

from __future__ import annotations

from enum import Enum

from robot_stack.safety.debounce import Debounce


class Contact(Enum):
    """One reading of the contact. UNREADABLE: no status, a stale one, or a lost bus."""

    RELEASED = "released"
    PRESSED = "pressed"
    UNREADABLE = "unreadable"


class EmergencyButton:
    """Says True (pressed) or False (a request to release) when there is something to say; times are steady seconds."""

    def __init__(self, debounce_s: float) -> None:
        self._debounced = Debounce(debounce_s)

    @property
    def pressed(self) -> bool | None:
        """The debounced button, None until it is known."""
        return self._debounced.state

    def update(self, contact: Contact, now_s: float) -> bool | None:
        """A reading, taken every few milliseconds; returns what to publish, None for nothing."""
        was = self.pressed
        if contact is Contact.UNREADABLE and was is None:
            return None
        if not self._debounced.update(contact is not Contact.RELEASED, now_s):
            return None
        # A button found released has released nothing: another source's true must not be answered with a false.
        return None if was is None and not self.pressed else self.pressed

    def overheard(self, pressed: bool) -> bool:
        """Somebody has published ``pressed``; returns True if the button has to contradict with a true."""
        return self.pressed is True and not pressed
