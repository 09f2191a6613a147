"""The file with an Ouster sensor's metadata."""

from __future__ import annotations

from robot_stack.core.config import ConfigError, config_dir
from robot_stack.core.range_sensor import RangeSensor
from robot_stack.drivers.ouster.metadata import Metadata, parse
from robot_stack.drivers.ouster.params import OusterDriverParams


def load_metadata(params: OusterDriverParams) -> tuple[Metadata, str]:
    """The metadata and the file's name, for error messages. Raises ConfigError."""
    path = config_dir() / params.metadata_file
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        advice = f"curl -o {path} http://{params.device_ip}/api/v1/sensor/metadata"
        raise ConfigError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}; {advice}") from error
    return parse(text, str(path)), str(path)


def check(metadata: Metadata, source: str, sensor: RangeSensor) -> None:
    """Checks that the sensor is the one of ``config/robot.yaml``. Raises ConfigError."""
    if metadata.pixels_per_column > sensor.rings:
        beams = f"{metadata.pixels_per_column} beams"
        raise ConfigError(f"{source}: the sensor has {beams}, expected at most {sensor.rings} (config/robot.yaml)")
    if abs(metadata.period_s - sensor.period_s) > 1e-6:
        turn = f"lidar_mode is {metadata.lidar_mode}, a turn in {metadata.period_s} s"
        raise ConfigError(f"{source}: {turn}, expected {sensor.period_s} s (config/robot.yaml)")
