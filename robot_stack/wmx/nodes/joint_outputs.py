"""Publishers of the manipulator's joints: for its planner, and as mirrors for Isaac Sim and Gazebo."""

from __future__ import annotations

from collections.abc import Sequence

from robot_stack.middleware.raw import RawSender
from robot_stack.wmx.manipulator.messages import ArrayBytes, JointStateBytes


class JointOutputs:
    """encoder, isaac, gazebo: None if not published. isaac_stamp: Isaac Sim's messages carry a stamp.

    ``send`` belongs to the feedback thread, everything else to the executor's.
    """

    def __init__(
        self,
        names: Sequence[str],
        encoder: RawSender | None,
        isaac: RawSender | None,
        gazebo: RawSender | None,
        *,
        isaac_stamp: bool,
    ) -> None:
        self._joint_states, self._array = JointStateBytes(names), ArrayBytes(len(names))
        self._encoder, self._isaac, self._gazebo = encoder, isaac, gazebo
        self._isaac_stamp = isaac_stamp
        self.look_around()

    def look_around(self) -> None:
        """Updates values too expensive to query at 500 Hz. Mirrors without a subscriber are not published."""
        self._isaac_heard = self._isaac is not None and self._isaac.has_subscribers
        self._gazebo_heard = self._gazebo is not None and self._gazebo.has_subscribers

    def send(self, positions: Sequence[float], velocities: Sequence[float], stamp_ns: int) -> None:
        """One value per name, rad and rad/s. Isaac Sim first and, as documented, before the stamp is set."""
        message = self._joint_states
        message.put(positions, velocities)
        if self._isaac is not None and self._isaac_heard:
            self._isaac.send(message.stamped(stamp_ns if self._isaac_stamp else 0))
        if self._encoder is not None:
            self._encoder.send(message.stamped(stamp_ns))
        if self._gazebo is not None and self._gazebo_heard:
            self._gazebo.send(self._array.filled(positions))

    def close(self) -> None:
        """Call before the node is destroyed, after the last message."""
        for sender in (self._encoder, self._isaac, self._gazebo):
            if sender is not None:
                sender.close()
