"""The vendor's parameter file: XML to numbers and back. The file is read and written by the caller's process.

Numbers only: no entity, no document type, no number that JSON or the vendor does not allow. Unknown entries of another
version are skipped; a missing one is 0, as in the vendor's engine, and therefore mostly invalid.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import re
import stat
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Final

from robot_stack.core.atomic_file import replace_file
from robot_stack.wmx.api.values import MAX_AXES
from robot_stack.wmx.simulated.parameter_layout import AXIS_ENTRIES, GLOBAL_ENTRIES, Number

LARGEST_FILE: Final = 8 * 1024 * 1024
"""The vendor's own file of 128 axes has 1 MiB."""

_NUMBER: Final = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,4})?", re.ASCII)
_LONGEST_NUMBER: Final = 400
_log = logging.getLogger(__name__)


class ParameterFileError(Exception):
    """The text is no parameter file."""


@dataclass(frozen=True, slots=True)
class ParameterValues:
    """All parameters as numbers, in the order of GLOBAL_ENTRIES and, for each axis, of AXIS_ENTRIES."""

    of_engine: list[Number]
    of_axes: list[list[Number]]


def read_file(path: str, n_axes: int) -> ParameterValues:
    """The parameters in ``path`` for the axes 0..n_axes-1; an absent axis is all zeros.

    Raises OSError or ValueError if the file cannot be read, ParameterFileError if it is no parameter file.
    """
    if not stat.S_ISREG(os.stat(path).st_mode):  # opening a pipe would hang
        raise OSError(f"{path} is no regular file")
    with open(path, "rb") as file:
        data = file.read(LARGEST_FILE + 1)
    values = parse(data, n_axes)
    _log.debug("parameters of %d axes read from %s", n_axes, path)
    return values


def parse(data: bytes, n_axes: int) -> ParameterValues:
    """The parameters in the text of a file. Blocks of further axes, as the vendor always writes, are passed over."""
    root = _root(data)
    found: dict[int, ET.Element] = {}
    for block in root.iterfind("AxisParameters"):
        axis = _axis_number(block)
        if axis in found:
            raise ParameterFileError(f"axis {axis} has two blocks")
        found[axis] = block
    whole = root.findall("GlobalParameters")
    if len(whole) > 1 or not (whole or found):
        raise ParameterFileError("there must be one GlobalParameters")
    return ParameterValues(
        _values(whole[0] if whole else None, GLOBAL_ENTRIES, "GlobalParameters"),
        [_values(found.get(axis), AXIS_ENTRIES, f"axis {axis}") for axis in range(n_axes)],
    )


def _root(data: bytes) -> ET.Element:
    if len(data) > LARGEST_FILE:
        raise ParameterFileError(f"a parameter file has at most {LARGEST_FILE} bytes")
    try:
        text = data.decode("utf-8-sig")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise ParameterFileError("a parameter file has no document type and no entities")
        root = ET.fromstring(text)
    except (UnicodeDecodeError, ET.ParseError) as error:
        raise ParameterFileError(str(error)) from error
    if root.tag != "Parameters":
        raise ParameterFileError(f"the outermost tag must be Parameters, is {root.tag}")
    return root


def _axis_number(block: ET.Element) -> int:
    text = block.get("Axis", "")
    if not (text.isascii() and text.isdigit() and len(text) <= 3 and int(text) < MAX_AXES):
        raise ParameterFileError(f"AxisParameters: Axis must be in 0..{MAX_AXES - 1}, is {text!r}")
    return int(text)


def _values(block: ET.Element | None, entries: Mapping[str, Number], where: str) -> list[Number]:
    if block is None:
        return [0] * len(entries)
    texts: dict[str, str] = {}
    for section in block:
        _collect(section, section.tag, texts, where)
    return [_number(texts[key], f"{where}: {key}") if key in texts else 0 for key in entries]


def _collect(element: ET.Element, key: str, texts: dict[str, str], where: str, depth: int = 1) -> None:
    if not len(element):
        if key in texts:
            raise ParameterFileError(f"{where}: {key} is given twice")
        texts[key] = (element.text or "").strip()
    elif depth > 4:
        raise ParameterFileError(f"{where}: {key} is nested too deeply")
    for child in element:
        _collect(child, f"{key}/{child.tag}", texts, where, depth + 1)


def _number(text: str, where: str) -> Number:
    if len(text) > _LONGEST_NUMBER or not _NUMBER.fullmatch(text):
        raise ParameterFileError(f"{where} must be a number, is {text[:40]!r}")
    with contextlib.suppress(ValueError):
        return int(text)
    return float(text)


def write_file(path: str, values: ParameterValues) -> None:
    """Writes ``path`` atomically. Raises OSError or ValueError.

    There is a block for each of the vendor's 128 axes, with defaults for those missing in ``values``: the vendor's
    engine rejects a missing block.
    """
    replace_file(Path(path), render(values))


def render(values: ParameterValues) -> str:
    """The text of the file."""
    absent = list(AXIS_ENTRIES.values())
    axes = [*values.of_axes, *[absent] * (MAX_AXES - len(values.of_axes))]
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<Parameters ver="1.00">', "\t<GlobalParameters>"]
    lines += _lines(GLOBAL_ENTRIES, values.of_engine)
    lines.append("\t</GlobalParameters>")
    for axis, numbers in enumerate(axes):
        lines.append(f'\t<AxisParameters Axis="{axis}">')
        lines += _lines(AXIS_ENTRIES, numbers)
        lines.append("\t</AxisParameters>")
    lines.append("</Parameters>")
    return "\n".join(lines) + "\n"


def _lines(entries: Mapping[str, Number], numbers: Sequence[Number]) -> list[str]:
    lines: list[str] = []
    open_tags: list[str] = []
    for (key, default), number in zip(entries.items(), numbers, strict=True):
        *parents, tag = key.split("/")
        common = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(open_tags, parents, strict=False)))
        while len(open_tags) > common:
            lines.append("\t" * (len(open_tags) + 1) + f"</{open_tags.pop()}>")
        for parent in parents[common:]:
            lines.append("\t" * (len(open_tags) + 2) + f"<{parent}>")
            open_tags.append(parent)
        lines.append("\t" * (len(open_tags) + 2) + f"<{tag}>{number_text(number, default)}</{tag}>")
    while open_tags:
        lines.append("\t" * (len(open_tags) + 1) + f"</{open_tags.pop()}>")
    return lines


def number_text(number: Number, default: Number) -> str:
    """The number as the vendor writes it, or with as many digits as needed."""
    if isinstance(default, int):
        return str(int(number))
    text = f"{number:.6f}"
    return text if float(text) == number or not math.isfinite(number) else repr(float(number))
