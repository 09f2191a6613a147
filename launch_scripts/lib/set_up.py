"""Makes or refreshes the environment in .venv. Started by launch_scripts/setup; needs only the standard library."""

import fcntl
import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
import venv
from pathlib import Path
from types import ModuleType

import interfaces
import registration
from steps import Fault, Steps, digest, run

ROOT = Path(__file__).resolve().parents[2]
PREFIX = ROOT / ".venv"
LOCK = ROOT / "requirements.lock"
PYTHON = PREFIX / "bin/python"
OWN = ("robot_stack", "sim")  # import packages of the project


def main() -> int:
    started = time.monotonic()
    for name in _FOREIGN:
        os.environ.pop(name, None)
    with_lock = os.open(ROOT, os.O_RDONLY)  # one set-up at a time, also when tests and a demo call it at once
    fcntl.flock(with_lock, fcntl.LOCK_EX)
    try:
        count = set_up()
    except Fault as fault:
        print(f"setup: {fault}", file=sys.stderr)
        return 1
    took = time.monotonic() - started
    print(f"setup: {'ready' if count else 'nothing to do'} ({took:.1f} s), Python {sys.version.split()[0]} in {PREFIX}")
    return 0


def set_up() -> int:
    """Runs the steps that are due; returns how many."""
    check_compiler()
    keep_or_make_environment()
    steps = Steps(PREFIX / ".setup")
    packages = digest(LOCK)
    steps.run("packages", "1/6 Python packages from requirements.lock", packages, install_packages)

    project = digest(packages, str(ROOT), ROOT / "pyproject.toml")
    steps.run("project", "2/6 the project itself, editable", project, install_project)

    library = ROOT / "launch_scripts/lib"
    programs = (library / "interfaces.py", library / "generate_interfaces.py")
    toolchain = digest(packages, programs, sorted(library.glob("*.cmake")))
    packages_of_interfaces = [ROOT / name for name in interfaces.PACKAGES]
    due = {package: digest(toolchain, str(package), interfaces.sources(package)) for package in packages_of_interfaces}
    build_interfaces(steps, due)

    nodes = digest(packages, str(ROOT), registration.sources(ROOT))
    steps.run("nodes", "4/6 nodes for `ros2 run robot_stack`", nodes, register_nodes)

    modules = digest(packages, str(ROOT), *due.values(), *(sorted((ROOT / name).rglob("*.py")) for name in OWN))
    steps.run("bytecode", "5/6 compiled modules of packages and project", modules, compile_modules)

    # What a loop is called with may be decided anywhere, and what is compiled already costs only seconds.
    steps.run("loops", "6/6 inner loops, compiled", modules, compile_loops)
    return steps.done


def check_compiler() -> None:
    cxx = core_module("cxx")
    if cxx.cxx_compiler() is None:
        raise Fault(f"no C++ compiler ({', '.join(cxx.cxx_choices())}); Debian, Ubuntu: apt install g++")


def keep_or_make_environment() -> None:
    """Keeps .venv where it was made by the interpreter in use and still runs, else recreates it."""
    if Path(sys.prefix).resolve() == PREFIX.resolve():
        return
    if made_by_this_python() and subprocess.run([PYTHON, "-c", ""], capture_output=True, check=False).returncode == 0:
        return
    print(f"  environment with Python {sys.version.split()[0]} in {PREFIX}", flush=True)
    if PREFIX.exists():
        shutil.rmtree(PREFIX)
    venv.EnvBuilder(symlinks=True, with_pip=True).create(PREFIX)


def made_by_this_python() -> bool:
    settings = PREFIX / "pyvenv.cfg"
    if not settings.exists():
        return False
    entries = dict(line.split(" = ", 1) for line in settings.read_text().splitlines() if " = " in line)
    same_version = entries.get("version") == ".".join(map(str, sys.version_info[:3]))
    return same_version and Path(entries.get("home", "")).resolve() == Path(sys.executable).resolve().parent


def install_packages() -> None:
    begun = PREFIX / ".setup/packages.begun"
    interrupted = begun.exists()
    begun.parent.mkdir(exist_ok=True)
    begun.touch()
    if subprocess.run([PYTHON, "-m", "pip", "--version"], capture_output=True, check=False).returncode:
        run([str(PYTHON), "-m", "ensurepip"])  # making the environment was interrupted
    try:
        install_with_uv(interrupted)
    except Fault as fault:
        print(f"setup: {fault}\nsetup: going on with pip, which takes longer", file=sys.stderr)
        run([*pip("install"), "--require-hashes", "-r", str(LOCK)])
    begun.unlink()


def install_with_uv(again: bool) -> None:
    """Installs the lock by uv, itself in the lock; ``again`` replaces what an interrupted run may have left half."""
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as only_uv:
        only_uv.write(locked("uv"))
        only_uv.flush()
        run([*pip("install"), "--require-hashes", "-r", only_uv.name])
    options = [*(["--reinstall"] if again else []), *([] if sys.stderr.isatty() else ["--quiet"])]
    install = [str(PREFIX / "bin/uv"), "pip", "install", "--python", str(PYTHON), "--require-hashes", *options]
    install += ["--requirement", str(LOCK)]
    try:
        run(install)
    except Fault:
        # Where a proxy opens what comes over the network, only the system knows its certificate; pip asks the system.
        run([*install, "--system-certs"])


def pip(verb: str) -> list[str]:
    return [str(PYTHON), "-m", "pip", verb, "--disable-pip-version-check", "--no-input", "--quiet"]


def locked(name: str) -> str:
    """The lines of one package in the lock: its pin and its hashes."""
    lines = LOCK.read_text().splitlines(keepends=True)
    start = next((i for i, line in enumerate(lines) if line.startswith(f"{name}==")), None)
    if start is None:
        raise Fault(f"{LOCK.name} has no {name}; run launch_scripts/lock")
    end = next((i for i in range(start + 1, len(lines)) if not lines[i].startswith(" ")), len(lines))
    return "".join(lines[start:end])


def install_project() -> None:
    for folder in PREFIX.glob("lib/python*/site-packages/*.egg-info"):
        if folder.is_dir() and not (folder / "PKG-INFO").exists():
            shutil.rmtree(folder)  # of an interface package whose installation was interrupted; pip fails on it
    quiet = {"PYTHONWARNINGS": "ignore"}  # setuptools warns of every editable installation
    command = [*pip("install"), "--no-deps", "--no-build-isolation", "--editable", str(ROOT)]
    run(command, {**build_environment(), **quiet})


def build_interfaces(steps: Steps, due: dict[Path, str]) -> None:
    stale = [package for package, key in due.items() if not steps.is_done(package.name, key)]
    if not stale:
        return
    print(f"  3/6 interface packages: {', '.join(package.name for package in stale)}", flush=True)
    started = time.monotonic()
    for package in interfaces.build_all(stale, PREFIX, build_environment()):
        steps.finish(package.name, due[package])
        print(f"    {package.name} built after {time.monotonic() - started:.1f} s", flush=True)


def build_environment() -> dict[str, str]:
    return {
        **os.environ,
        **core_module("wheels_env").ros_environment(PREFIX),
        "PATH": f"{PREFIX / 'bin'}{os.pathsep}{os.environ.get('PATH', '')}",
    }


# A sourced ROS installation must not mix into packages, into builds against the wheels, or into what runs here.
_FOREIGN = {
    "AMENT_PREFIX_PATH",
    "CMAKE_PREFIX_PATH",
    "COLCON_PREFIX_PATH",
    "LD_LIBRARY_PATH",
    "PYTHONPATH",
    "PYTHONHOME",
}


def core_module(name: str) -> ModuleType:
    """A module of robot_stack.core by its path: the package itself may need what is only being installed."""
    spec = importlib.util.spec_from_file_location(name, ROOT / f"robot_stack/core/{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def compile_modules() -> None:
    """Where Python keeps no compiled modules, each of a dozen processes would recompile all of them."""
    folders = [sysconfig.get_path("purelib", "venv", vars={"base": str(PREFIX)}), *(str(ROOT / name) for name in OWN)]
    command = [str(PYTHON), "-m", "compileall", "-q", "-q", "--workers", "0", *folders]
    subprocess.run(command, check=False)  # some packages carry files of other Python versions, which are never imported


def compile_loops() -> None:
    run([str(PYTHON), "-m", "sim.compile"], build_environment())


def register_nodes() -> None:
    registration.register(ROOT, PREFIX, core_module("wheels_env").ros_environment(PREFIX, base={}))


if __name__ == "__main__":
    sys.exit(main())
