"""Messages as bytes: strict JSON, checked against the official schemas in both directions.

The schemas are those of https://github.com/VDA5050/VDA5050 (MIT licence, in their folder).
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from functools import cache
from importlib.resources import files
from itertools import islice
from typing import Any, Final

import numpy as np
from jsonschema import Draft202012Validator, FormatChecker

from robot_stack.fleet.errors import Error, ErrorType, Refused, shortened
from robot_stack.fleet.link import Topic
from robot_stack.fleet.names import written
from robot_stack.fleet.version import Version

Data = dict[str, Any]

MAX_DEPTH: Final = 16
_LARGEST: Final = 2**53  # integers that JSON numbers carry exactly
_SHOWN_PROBLEMS: Final = 3
_TIMESTAMP = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?Z", re.ASCII)
_FORMATS = FormatChecker(formats=())


def _is_timestamp(text: object) -> bool:
    """ISO 8601 in UTC, as the header's table has it."""
    if not isinstance(text, str):
        return True
    if _TIMESTAMP.fullmatch(text) is None:
        return False
    np.datetime64(text[:-1])  # refuses the 30th of February
    return True


_FORMATS.checks("date-time", raises=ValueError)(_is_timestamp)


@cache
def _validator(topic: Topic, version: Version) -> Draft202012Validator:
    text = files("robot_stack.fleet").joinpath("schemas", version, f"{topic}.schema").read_text(encoding="utf-8")
    schema = json.loads(text)
    # Where a schema contradicts its specification, the specification prevails (2.1.0: 5, 3.0.0: 7).
    if (topic, version) == (Topic.STATE, Version.V2):
        schema["properties"]["actionStates"]["items"]["properties"]["actionStatus"]["enum"].append("PAUSED")
    if (topic, version) == (Topic.ORDER, Version.V3):
        edge = schema["definitions"]["edge"]["properties"]
        edge["maximumRotationSpeed"] = edge["maxRotationSpeed"]
    return Draft202012Validator(schema, format_checker=_FORMATS)


def decode(topic: Topic, payload: bytes, max_bytes: int, version: Version) -> Data:
    """The message in ``payload``. Raises Refused with a validationError, and nothing else."""
    if len(payload) > max_bytes:
        raise Refused(_error(topic, f"{len(payload)} bytes, at most {max_bytes} are accepted"))
    try:
        data = json.loads(payload.decode("utf-8"), object_pairs_hook=_object, parse_constant=_no_constant)
        _check_values(data)
    except (ValueError, RecursionError) as error:
        raise Refused(_error(topic, f"no acceptable JSON: {error}")) from error
    problems = [
        f"{error.json_path}: {error.message}"
        for error in islice(_validator(topic, version).iter_errors(data), _SHOWN_PROBLEMS)
    ]
    if problems:
        raise Refused(_error(topic, "; ".join(map(shortened, problems)), data))
    message: Data = data
    return message


def encode(topic: Topic, data: Data, version: Version) -> bytes:
    """``data`` has the names of 2.1.0.

    Raises ValueError for a message that the schema forbids, which is a defect of this program.
    """
    data = written(data, version)
    problem = next(_validator(topic, version).iter_errors(data), None)
    if problem is not None:
        raise ValueError(f"{topic}: {problem.json_path}: {problem.message}")
    return compact(data)


def compact(data: Any) -> bytes:
    return json.dumps(data, separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode()


def timestamp(unix_s: float) -> str:
    """``unix_s`` as the header has it, in ms."""
    return f"{np.datetime64(round(unix_s * 1e3), 'ms')}Z"


def _object(pairs: list[tuple[str, Any]]) -> Data:
    data = dict(pairs)
    if len(data) < len(pairs):
        twice = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"the key {shortened(twice)!r} occurs twice in one object")
    return data


def _no_constant(text: str) -> Any:
    raise ValueError(f"{text} is no JSON number")


def _check_values(root: Any) -> None:
    """Depth, finite numbers and encodable texts. Raises ValueError."""
    level: list[Any] = [root]
    for _ in range(MAX_DEPTH):
        below: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                below += value.keys()
                below += value.values()
            elif isinstance(value, list):
                below += value
            elif isinstance(value, str):
                value.encode()  # UnicodeEncodeError, a ValueError: half a surrogate pair
            elif isinstance(value, float):
                if not math.isfinite(value):
                    raise ValueError("a number is out of range")
            elif isinstance(value, int) and abs(value) > _LARGEST:
                raise ValueError("an integer is out of range")
        if not below:
            return
        level = below
    raise ValueError(f"nested deeper than {MAX_DEPTH} levels")


_REFERENCES = ("headerId", "orderId", "orderUpdateId")


def references(topic: Topic, data: Any) -> tuple[tuple[str, str], ...]:
    """What a refused message can be recognised by (7.1), as far as it is readable."""
    known = data if isinstance(data, dict) else {}
    found = ((key, known[key]) for key in _REFERENCES if isinstance(known.get(key), int | str))
    return (("topic", topic.value), *((key, str(value)) for key, value in found))


def _error(topic: Topic, description: str, data: Any = None) -> Error:
    return Error(ErrorType.VALIDATION, f"{topic}: {description}", references(topic, data))
