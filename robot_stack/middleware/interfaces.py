"""Message classes for the contract's type names."""

from __future__ import annotations

import importlib
from functools import cache
from typing import Any


@cache
def interface_class(type_name: str) -> Any:
    """The class of ``package/msg/Name``, ``package/srv/Name`` or ``package/action/Name``. Raises ImportError."""
    package, kind, name = type_name.split("/")
    module = importlib.import_module(f"{package}.{kind}")
    try:
        return getattr(module, name)
    except AttributeError as error:
        raise ImportError(f"{package} has no {kind} named {name}") from error
