"""Debouncing of an emergency-stop button that is read in short intervals."""

from __future__ import annotations

from robot_stack.safety.timing import Hold


class ButtonDebounce:
    """Turns raw readings into one state. It begins pressed: until a whole debounce time of releases has been read,
    nobody knows that the button is not held down.

    A change counts after the raw reading has held it for ``debounce_s`` without a break.
    """

    def __init__(self, debounce_s: float) -> None:
        self._debounce_s = debounce_s
        self._differs_for = Hold()
        self.pressed = True

    def update(self, raw_pressed: bool, now_s: float) -> bool:
        """A raw reading at steady time ``now_s``; returns True if the debounced state has changed."""
        differs_for_s = self._differs_for.update(raw_pressed is not self.pressed, now_s)
        if differs_for_s is None or not differs_for_s >= self._debounce_s:
            return False
        self.pressed = raw_pressed
        self._differs_for.update(False, now_s)
        return True
