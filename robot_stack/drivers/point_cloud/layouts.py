"""The layouts that vendors' drivers publish: fields by name and type. docs/drivers.md names the sources."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from robot_stack.drivers.point_cloud.cloud import TYPES, Cloud, CloudRefused, Field

AUTO: Final = "auto"
_COORDINATES = ("x", "y", "z")
_REAL = (7, 8)
_NUMBERS = tuple(TYPES)
_UNSIGNED = (2, 4, 6)
_U32, _F32, _F64 = 6, 7, 8
# Absolute times in seconds end here, and in nanoseconds begin far above: the year 5138.
_LATEST_SECONDS = 1e11


@dataclass(frozen=True, slots=True)
class Layout:
    """One vendor's points.

    intensity, ring: the fields' names, the first that exists. time, time_type: the field of each point's time and its
    PointField type. unit_s: of that field; absolute: it counts from the epoch of the sensor's clock, else from the
    header's stamp. mark: a field that distinguishes this layout from another with the same time field.
    """

    name: str
    intensity: tuple[str, ...]
    ring: tuple[str, ...]
    time: str
    time_type: int
    unit_s: float
    absolute: bool
    mark: str = ""

    def describe(self) -> str:
        time = Field(self.time, 0, self.time_type, 1).describe()
        return (
            f"{self.name}: {', '.join(_COORDINATES)}, {' or '.join(self.intensity)}, {' or '.join(self.ring)}, {time}"
        )


LAYOUTS: Final = (
    # Ouster's intensity is a count of photons without an upper end; its reflectivity is calibrated to 0-255.
    Layout("ouster", ("reflectivity", "intensity"), ("ring",), "t", _U32, 1e-9, absolute=False),
    Layout("velodyne", ("intensity",), ("ring",), "time", _F32, 1.0, absolute=False),
    Layout("livox", ("intensity", "reflectivity"), ("line",), "timestamp", _F64, 1e-9, absolute=True, mark="line"),
    Layout("livox", ("reflectivity", "intensity"), ("line",), "offset_time", _U32, 1e-9, absolute=False),
    Layout("nebula", ("intensity",), ("channel",), "time_stamp", _U32, 1e-9, absolute=False),
    # Hesai's and RoboSense's have the same names and types, and are processed alike.
    Layout("hesai", ("intensity",), ("ring",), "timestamp", _F64, 1.0, absolute=True, mark="ring"),
    Layout("robosense", ("intensity",), ("ring",), "timestamp", _F64, 1.0, absolute=True, mark="ring"),
)
NAMES: Final = tuple(dict.fromkeys(layout.name for layout in LAYOUTS))


def recognise(cloud: Cloud, wanted: str = AUTO) -> tuple[Layout, dict[str, Field]]:
    """The layout of a cloud and its fields under the contract's names: x, y, z, intensity, ring, time.

    wanted: a layout's name, or AUTO for whichever fits. Raises CloudRefused that names the fields found and expected.
    """
    candidates = [layout for layout in LAYOUTS if wanted in (AUTO, layout.name)]
    there = {field.name: field for field in cloud.fields}
    for layout in candidates:
        found = _found(layout, there)
        if found is not None:
            return layout, found
    expected = "; or ".join(layout.describe() for layout in candidates)
    raise CloudRefused(f"the fields are {cloud.describe_fields()}, expected those of {expected}")


def _found(layout: Layout, there: dict[str, Field]) -> dict[str, Field] | None:
    if layout.mark and layout.mark not in there:
        return None
    wanted: list[tuple[str, Sequence[str], Sequence[int]]] = [
        *((name, (name,), _REAL) for name in _COORDINATES),
        ("intensity", layout.intensity, _NUMBERS),
        ("ring", layout.ring, _UNSIGNED),
        ("time", (layout.time,), (layout.time_type,)),
    ]
    found: dict[str, Field] = {}
    for key, names, types in wanted:
        field = next((there[name] for name in names if name in there), None)
        if field is None or field.datatype not in types:
            return None
        found[key] = field
    return found


def check_unit(layout: Layout, time: float) -> None:
    """Raises CloudRefused if an absolute time, in the field's own unit, cannot be of that unit."""
    if layout.absolute and (time < _LATEST_SECONDS) != (layout.unit_s == 1.0):
        unit = "seconds" if layout.unit_s == 1.0 else "nanoseconds"
        raise CloudRefused(f"field {layout.time} is {time:.0f}, which are no {unit} as of {layout.name}")
