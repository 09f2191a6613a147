"""Enters the package robot_stack into the environment's ament index, with one executable per node for `ros2 run`."""

import os
import shlex
import shutil
import subprocess
import sysconfig
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from steps import Fault, replace_file

PACKAGE = "robot_stack"
_LIST_NODES = "from robot_stack.contract.processes import available\nfor row in available(): print(row.name)"
_LAUNCHER = """#!/bin/sh
# Written by launch_scripts/setup: starts the node {node} on the environment's own interpreter.
{exports}
exec {python} -m robot_stack.ros.main {node} "$@"
"""
_SEARCH_PATHS = ("LD_LIBRARY_PATH", "AMENT_PREFIX_PATH")
_HOOK = Path(__file__).with_name("underlay.py")
# Hooks run in the order of their names: this one before that of the wheels, ros_wheels_bootstrapper.
_HOOK_NAME = "robot_stack_underlay"


def sources(root: Path) -> list[Path]:
    """Files a change of which calls for a new registration."""
    here = Path(__file__)
    contract = root / PACKAGE / "contract"
    return [
        here,
        _HOOK,
        root / PACKAGE / "package.xml",
        root / PACKAGE / "core/wheels_env.py",
        *sorted(contract.glob("*.py")),
    ]


def register(root: Path, prefix: Path, variables: dict[str, str]) -> None:
    """Writes index entries, package.xml, the links to config/ and launch files, the start-up hook, and the launchers.

    Args:
        variables: environment of the node processes, as robot_stack.core.wheels_env gives it for an empty environment.
    """
    _install_hook(prefix)
    index = prefix / "share/ament_index/resource_index"
    manifest = root / PACKAGE / "package.xml"
    replace_file(index / "packages" / PACKAGE, "")
    replace_file(index / "package_run_dependencies" / PACKAGE, ";".join(run_dependencies(manifest)))
    replace_file(prefix / "share" / PACKAGE / "package.xml", manifest.read_text())
    _link(prefix / "share" / PACKAGE / "config", root / "config")
    _link(prefix / "share" / PACKAGE / "launch", root / "launch_scripts/launch")
    _write_launchers(prefix, node_names(prefix), variables)


def _install_hook(prefix: Path) -> None:
    # By name: Debian's interpreter has another default scheme, whose folder is no folder of hooks.
    site = Path(sysconfig.get_path("purelib", "venv", vars={"base": str(prefix)}))
    replace_file(site / f"{_HOOK_NAME}.py", _HOOK.read_text())
    replace_file(site / f"{_HOOK_NAME}.pth", f"import {_HOOK_NAME}\n")


def run_dependencies(manifest: Path) -> list[str]:
    tree = ElementTree.parse(manifest)
    return sorted({str(entry.text) for tag in ("depend", "exec_depend") for entry in tree.iter(tag)})


def node_names(prefix: Path) -> list[str]:
    """Names of the node processes that are built, from the contract's process table."""
    listing = subprocess.run(
        [prefix / "bin/python", "-c", _LIST_NODES],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if listing.returncode:
        raise Fault(f"cannot read the process table robot_stack.contract.processes:\n{listing.stderr}")
    return listing.stdout.split()


def _write_launchers(prefix: Path, nodes: list[str], variables: dict[str, str]) -> None:
    folder = prefix / "lib" / PACKAGE
    if folder.exists():
        for stale in {path.name for path in folder.iterdir()} - set(nodes):
            (folder / stale).unlink()
    exports = "\n".join(_export(name, value) for name, value in variables.items())
    python = shlex.quote(str(prefix / "bin/python"))
    for node in nodes:
        replace_file(folder / node, _LAUNCHER.format(node=node, exports=exports, python=python), mode=0o755)


def _export(name: str, value: str) -> str:
    if name in _SEARCH_PATHS:
        return f'export {name}={shlex.quote(value)}"${{{name}:+:${name}}}"'
    return f'export {name}="${{{name}:-{value}}}"'


def _link(link: Path, target: Path) -> None:
    if link.is_symlink() and os.readlink(link) == str(target):
        return
    if link.is_dir() and not link.is_symlink():
        shutil.rmtree(link)
    link.unlink(missing_ok=True)
    link.symlink_to(target)
