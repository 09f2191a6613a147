"""Faults of a simulated camera, raised by ``/sim/inject_camera_fault``."""

from __future__ import annotations

from collections.abc import Iterable

from sim.camera.conditions import CLEAR, Conditions, Glare, Shadow
from sim.plant.fault_table import FaultKind
from sim.plant.sensor_faults import SensorFaults, sensor_fault

# A deep shadow and its soft rim; a veil as bright as a low sun makes it.
_SHADOW_SOFTNESS_M = 0.02
_VEIL_DN = 30.0
_GLARE_PLACE = (0.35, 0.40)  # of the image's width and height


def kinds(cameras: tuple[str, ...], markers: tuple[str, ...]) -> tuple[FaultKind, ...]:
    """Of which camera, or of which marker."""
    return (
        sensor_fault("silent", "the camera sends nothing", targets=cameras),
        sensor_fault("frozen", "the camera repeats its last picture with new stamps", targets=cameras),
        sensor_fault("noisy", "the sensor is noisier", ("factor", 1.0, 100.0, 6.0), cameras),
        sensor_fault("glare", "the sun shines into the lens", ("radius of the bloom, px", 1.0, 1000.0, 120.0), cameras),
        sensor_fault("rain", "drops on the lens", ("share of a lens full of them", 0.01, 1.0, 0.6), cameras),
        sensor_fault("shadow", "a shadow's edge across the boards", ("share of light lost", 0.05, 1.0, 0.7), cameras),
        sensor_fault("blur", "out of focus, or a fogged lens", ("standard deviation, px", 0.1, 30.0, 3.0), cameras),
        sensor_fault("dark", "poor light", ("share of daylight", 0.001, 1.0, 0.02), cameras),
        sensor_fault("dirt", "dirt on a marker", ("share of it that is dirty", 0.01, 1.0, 0.3), markers),
        sensor_fault("cover", "a marker is covered", targets=markers),
    )


class CameraFaults(SensorFaults):
    """The faults in force. cameras: their short names; markers: ids of all boards; size: height, width of pictures."""

    def __init__(self, cameras: Iterable[str], markers: Iterable[int], size: tuple[int, int]) -> None:
        rows = kinds(tuple(cameras), tuple(str(marker) for marker in sorted(markers)))
        super().__init__({kind.name: kind for kind in rows})
        self._size = size

    def is_active(self, kind: str, camera: str, now_s: float) -> bool:
        return (kind, camera) in self.active(now_s)

    def conditions(self, camera: str, now_s: float) -> Conditions:
        """The present conditions of a camera."""
        names = self.active(now_s)
        if not names:
            return CLEAR

        def value(kind: str, otherwise: float) -> float:
            amount = self.value(kind, now_s, camera)
            return otherwise if amount is None else amount

        height, width = self._size
        radius, depth = value("glare", 0.0), value("shadow", 0.0)
        column, row = _GLARE_PLACE[0] * width, _GLARE_PLACE[1] * height
        return Conditions(
            illumination=value("dark", 1.0),
            shadow=Shadow(softness_m=_SHADOW_SOFTNESS_M, depth=depth) if depth else None,
            glare=Glare(column, row, radius, _VEIL_DN) if radius else None,
            rain=value("rain", 0.0),
            blur_px=value("blur", 0.0),
            noise_factor=value("noisy", 1.0),
            dirt={int(marker): self.value(kind, now_s, marker) or 0.0 for kind, marker in names if kind == "dirt"},
            covered=frozenset(int(marker) for kind, marker in names if kind == "cover"),
        )
