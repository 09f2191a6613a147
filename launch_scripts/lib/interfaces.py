"""Builds the interface packages (messages, services, actions) into the environment's prefix, as colcon would."""

import os
import shutil
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from steps import run_logged

PACKAGES = ("custom_msgs", "wmx_ros2_message", "control_msgs", "nav2_msgs", "tf2_msgs")
PROJECT_INCLUDE = Path(__file__).with_name("interface_build.cmake")


def sources(package: Path) -> list[Path]:
    return sorted(path for path in package.rglob("*") if path.is_file())


def build_all(packages: Iterable[Path], prefix: Path, environment: dict[str, str]) -> Iterator[Path]:
    """Builds the packages side by side, each as its own CMake project, and yields each once it is installed."""
    with ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for build in as_completed([pool.submit(_build, package, prefix, environment) for package in packages]):
            yield build.result()


def _build(package: Path, prefix: Path, environment: dict[str, str]) -> Path:
    build = prefix / "build" / package.name
    log = build / "build.log"
    cmake = str(prefix / "bin/cmake")
    before = installed(build)
    empty(build)
    run_logged([cmake, *_configuration(package, prefix, build)], environment, log)
    run_logged([cmake, "--build", str(build), "--target", "install"], environment, log)
    for stale in before - installed(build):  # of definitions that the package has lost
        stale.unlink(missing_ok=True)
    return package


def empty(build: Path) -> None:
    """Empties a build folder but for the list of installed files, of which a build that fails must not lose track.

    An incremental build after definitions were lost linked a library without some of its symbols.
    """
    kept = _manifest(build).read_bytes() if _manifest(build).exists() else None
    shutil.rmtree(build, ignore_errors=True)
    build.mkdir(parents=True)
    if kept is not None:
        _manifest(build).write_bytes(kept)


def installed(build: Path) -> set[Path]:
    """The files of the last installation from a build folder."""
    manifest = _manifest(build)
    return {Path(line) for line in manifest.read_text().splitlines()} if manifest.exists() else set()


def _manifest(build: Path) -> Path:
    return build / "install_manifest.txt"


def _configuration(package: Path, prefix: Path, build: Path) -> list[str]:
    variables = {
        "CMAKE_INSTALL_PREFIX": prefix,
        "CMAKE_PREFIX_PATH": prefix,
        "CMAKE_MAKE_PROGRAM": prefix / "bin/ninja",
        "CMAKE_PROJECT_INCLUDE": PROJECT_INCLUDE,
        "CMAKE_BUILD_TYPE": "Release",
        "Python3_EXECUTABLE": prefix / "bin/python",
        "Python3_FIND_VIRTUALENV": "ONLY",
        "BUILD_TESTING": "OFF",
    }
    definitions = [f"-D{name}={value}" for name, value in variables.items()]
    return ["-S", str(package), "-B", str(build), "-G", "Ninja", *definitions]
