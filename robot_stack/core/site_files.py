"""Files beside a site's map that can be edited on the robot: zones, route graph.

The edited file is the robot's own data and is in force instead of the site's as long as it exists: the site's folder
belongs to the software.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from robot_stack.core.runtime import data_home
from robot_stack.core.site_map import map_folder


@dataclass(frozen=True, slots=True)
class SiteFile:
    """Where a file of a map may lie. site: beside the map. own: edited on this robot, in the user's data."""

    site: Path
    own: Path

    @property
    def in_force(self) -> Path:
        """The own file, else the site's, which need not exist. An own file that cannot be read stays in force."""
        try:
            self.own.stat()
        except (FileNotFoundError, NotADirectoryError):
            return self.site
        except OSError:
            pass
        return self.own

    @property
    def existing(self) -> Path | None:
        """The file in force, None if the site has none."""
        path = self.in_force
        return None if path == self.site and not path.exists() else path


def site_file(map_name: str, file_name: str) -> SiteFile:
    """map_name: of ``config/maps``, or a path, whose own files are those of this path alone.

    Raises ConfigError if there is no such map.
    """
    folder = map_folder(map_name)
    name = folder.name
    if "/" in map_name:
        name += f"-{hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:16]}"
    return SiteFile(folder / file_name, data_home() / Path(file_name).stem / f"{name}.geojson")
