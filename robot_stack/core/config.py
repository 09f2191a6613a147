"""Configuration: YAML files read into validated models, with one clear line when something is wrong.

Models derive from :class:`Config`: unknown keys, missing keys, wrong types, non-finite and out-of-range numbers are all
refused. The folder is ``config/`` beside the package (a checkout), ``share/robot_stack/config`` (an installation), or
the value of the environment variable ``ROBOT_STACK_CONFIG``. Files of the site that ``ROBOT_STACK_SITE`` names take the
place of those in the folder itself.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from robot_stack.core.errors import ConfigError as ConfigError

# libyaml's loader if it is installed: ten times as fast, and every process reads some files at start-up.
_LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

# Ranges that many parameters have.
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Share = Annotated[float, Field(gt=0.0, le=1.0)]
Count = Annotated[int, Field(ge=1)]

SITE_VARIABLE: Final = "ROBOT_STACK_SITE"


class Config(BaseModel):
    """Base of all parameter models: strict about names, frozen, no NaN and no infinity."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


ConfigT = TypeVar("ConfigT", bound=BaseModel)


def config_dir() -> Path:
    """The configuration folder in force. Raises ConfigError if there is none."""
    named = os.environ.get("ROBOT_STACK_CONFIG")
    candidates = (
        [Path(named)]
        if named
        else [
            Path(__file__).resolve().parents[2] / "config",
            *(Path(prefix) / "share" / "robot_stack" / "config" for prefix in _prefixes()),
        ]
    )
    for folder in candidates:
        if (folder / "robot.yaml").is_file():
            return folder
    raise ConfigError(f"no configuration folder with a robot.yaml; looked in {', '.join(map(str, candidates))}")


def chosen_site() -> str:
    """The site that ROBOT_STACK_SITE names, which is the name of its map too; empty: that of the files in config/."""
    return os.environ.get(SITE_VARIABLE, "")


def site_path(name: str) -> Path:
    """A file or folder of the chosen site, ``config/sites/<site>/<name>`` if there is one, else ``config/<name>``.

    Raises ConfigError for a site without a folder.
    """
    folder, site = config_dir(), chosen_site()
    if site and not (folder / "sites" / site).is_dir():
        known = ", ".join(sorted(path.name for path in (folder / "sites").glob("*/"))) or "none"
        raise ConfigError(f"{SITE_VARIABLE}: no site {site!r} in {folder / 'sites'}; there are {known}")
    own = folder / "sites" / site / name
    return own if site and own.exists() else folder / name


def _prefixes() -> list[str]:
    return [*filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)), sys.prefix]


def read_yaml(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file; an empty file is an empty mapping. Raises ConfigError."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text: {error.reason}") from error
    try:
        data = yaml.load(text, _LOADER)
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: not valid YAML: {_one_line(error)}") from error
    if data is None:
        return {}
    if not isinstance(data, dict):
        raise ConfigError(f"{path}: must be a mapping of names to values, is a {type(data).__name__}")
    return data


def read_json(path: Path) -> Any:
    """Raises ConfigError for a file that cannot be read, is no JSON, or is nested too deep."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from None


def validate(model: type[ConfigT], data: Mapping[str, Any], source: str) -> ConfigT:
    """``data`` as a ``model``. Raises ConfigError that names ``source`` and every offending field."""
    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        problems = "; ".join(_describe(item) for item in error.errors())
        raise ConfigError(f"{source}: {problems}") from error


def load(model: type[ConfigT], name: str, overrides: Mapping[str, Any] | None = None) -> ConfigT:
    """``<name>.yaml`` of the site or of config/ with ``overrides`` on top, validated. Raises ConfigError."""
    path = site_path(f"{name}.yaml")
    return validate(model, {**read_yaml(path), **(overrides or {})}, str(path))


def _describe(item: Any) -> str:
    field = ".".join(str(part) for part in item["loc"]) or "(whole file)"
    if item["type"] in ("missing", "extra_forbidden"):
        return f"{field}: {'is missing' if item['type'] == 'missing' else 'is not a known parameter'}"
    return f"{field}: {item['msg']} (is {item['input']!r})"


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
