"""The C++ compiler. Standard library only: the environment's set-up imports this file by its path."""

from __future__ import annotations

import os
import shutil


def cxx_choices() -> tuple[str, ...]:
    """$CXX alone where it is set, otherwise the usual names."""
    return (chosen,) if (chosen := os.environ.get("CXX")) else ("c++", "g++", "clang++")


def cxx_compiler() -> str | None:
    """The path of the first that is installed, or None."""
    return next(filter(None, map(shutil.which, cxx_choices())), None)
