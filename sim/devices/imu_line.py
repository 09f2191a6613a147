"""The simulated inertial unit as an Xsens unit on a serial line."""

from __future__ import annotations

from pathlib import Path

from sim.devices.serial_line import SerialLine
from sim.devices.xsens import Motion, Mti
from sim.plant.imu import ImuSample


class ImuLine:
    """link: path of the terminal. The unit's clock is the simulation's, from its start."""

    def __init__(self, link: Path) -> None:
        self._line, self._unit = SerialLine(link), Mti()
        self._line.plug()

    def send(self, sample: ImuSample) -> None:
        """Waits until the host has read the sample before; one that does not read has to open the line again."""
        answer = self._unit.answer_to(self._line.received())
        if answer or not self._unit.measuring:
            self._line.send(answer)
            return
        if not self._line.wait_read():
            self._unit.measuring = False
            return
        x, y, z, w = sample.orientation_xyzw
        motion = Motion((w, x, y, z), sample.acceleration_mps2, sample.rotation_radps)
        self._line.send(self._unit.sample(motion, sample.time_s))
