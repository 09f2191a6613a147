"""``robot-stack replay``: nodes of a recording on the deterministic scheduler, ``python -m sim.replay.main --help``."""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from robot_stack.core.config import ConfigError, load
from robot_stack.supervisor.profile import parse_setting
from sim.replay.nodes import REPLAYED, rows_of
from sim.replay.params import ReplayParams
from sim.replay.recorded import NODES, Recorded, ReplayError, read_recording, write_thinned
from sim.replay.replay import NodeResult, Row, replay
from sim.replay.stored import stored_configuration

EXIT_EQUAL, EXIT_DIFFERENT, EXIT_REFUSED, EXIT_INTERRUPTED = 0, 1, 2, 130
_HELP: Final = """\
Runs nodes of a recording alone in virtual time, feeds them their recorded inputs, and compares their outputs with the
recorded ones by the tolerances of config/replay.yaml.

FILE is an MCAP file or the folder of a recording or of an event. The configuration and the parameters stored with it
apply, else the present ones. Nodes that need more than recorded topics are named with the reason."""
_EPILOG: Final = """\
exit codes: 0 the outputs of all compared nodes are reproduced; 1 there is a difference, or a node failed; 2 wrong use
or configuration, no recording, or no node could be compared; 130 interrupted"""


def main(arguments: Sequence[str] | None = None) -> int:
    try:
        return _replay(_options(arguments))
    except (ReplayError, ConfigError) as error:
        print(f"replay: {error}", file=sys.stderr)
        return EXIT_REFUSED
    except KeyboardInterrupt:
        print("replay: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED


def replay_recording(
    recorded: Recorded, nodes: Sequence[str], settings: Sequence[str] = (), *, present: bool = True
) -> list[NodeResult]:
    """settings: ``node.parameter=value`` on top of the parameters stored with the recording. present: with the present
    configuration instead of the stored one. Raises ConfigError.
    """
    parameters = {node: dict(values) for node, values in recorded.parameters.items()}
    for setting in settings:
        node, name, value = parse_setting(setting, set(NODES))
        parameters.setdefault(node, {})[name] = value
    params = load(ReplayParams, "replay")
    stored = None if present else recorded.configuration
    with contextlib.nullcontext() if stored is None else stored_configuration(stored):
        return [replay(node, recorded, parameters, params) for node in nodes]


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="robot-stack replay",
        description=_HELP,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("file", metavar="FILE", type=Path, help="an MCAP file, or the folder of a recording or event")
    parser.add_argument("--node", action="append", default=[], metavar="NAME", help="this node alone; may be repeated")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NODE.PARAMETER=VALUE",
        help="override a parameter; may be repeated",
    )
    parser.add_argument("--present-config", action="store_true", help="the present configuration, not the stored one")
    parser.add_argument("--until", type=float, metavar="S", default=math.inf, help="only the first S seconds")
    parser.add_argument("--thin", type=Path, metavar="FILE", help="write what the nodes need into this new MCAP file")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results")
    options = parser.parse_args(arguments)
    unknown = sorted(set(options.node) - NODES)
    if unknown:
        parser.error(
            f"--node {', '.join(unknown)}: no node of the stack; nodes that can be replayed: {_names(REPLAYED)}"
        )
    if options.thin is not None and options.thin.exists():
        parser.error(f"--thin {options.thin}: exists already; give the name of a new file")
    return options


def _replay(options: argparse.Namespace) -> int:
    nodes = options.node or list(REPLAYED)
    rows = list(dict.fromkeys(row for node in nodes for row in rows_of(node)))
    recorded = read_recording(options.file, rows, options.until)
    for damage in recorded.damages:
        print(f"warning: {damage}; the replay ends there", file=sys.stderr)
    if options.thin is not None:
        write_thinned(recorded, rows, options.thin)
        print(f"{options.thin}: {options.thin.stat().st_size / 1e6:.1f} MB for {_names(nodes)}")
    present = options.present_config or recorded.configuration is None
    print("configuration: " + ("the present one" if present else "stored with the recording"), end="")
    print(", with stored parameters" if recorded.parameters else "")
    results = replay_recording(recorded, nodes, options.set, present=present)
    # Every node of the recording is named, also those that cannot be replayed.
    if not options.node:
        results += [replay(node, recorded, {}, load(ReplayParams, "replay")) for node in _others(recorded)]
    print("\n".join(line for result in results for line in lines(result, recorded)))
    if options.json is not None:
        _write_json(options.json, results)
    if not any(result.compared for result in results):
        raise ReplayError(f"{options.file}: no node could be compared; the reasons are above")
    return EXIT_EQUAL if all(result.equal for result in results) else EXIT_DIFFERENT


def _others(recorded: Recorded) -> list[str]:
    """Nodes with a heartbeat in the recording that cannot be replayed."""
    return sorted(recorded.nodes() - set(REPLAYED))


def lines(result: NodeResult, recorded: Recorded) -> list[str]:
    """The table of a node."""
    if result.not_replayed:
        return [f"{result.node}: not replayed: {result.not_replayed}"]
    verdict = "reproduced" if result.equal else "DIFFERENT"
    head = f"{result.node}: {verdict}, {result.begin_s:.1f} s to {result.end_s:.1f} s of the recording"
    if not result.compared:
        head = f"{result.node}: nothing compared"
    notes = [f"  note: {note}" for note in result.notes]
    failures = [f"  failed: {text.strip().splitlines()[-1]}" for text in result.failures]
    return [head, *notes, *failures, *(line for row in result.rows for line in _row_lines(row, recorded))]


def _row_lines(row: Row, recorded: Recorded) -> list[str]:
    compared = row.comparison
    if compared is None:
        return [f"  {row.topic:<28} not compared: {row.skipped}"]
    if not compared.messages:
        return [f"  {row.topic:<28} not compared: no message in this time on either side"]
    counts = (
        f"{compared.recorded} recorded, {compared.replayed} replayed, {compared.matched} of {compared.messages} matched"
    )
    found = [f"  {row.topic:<28} {'' if compared.equal else 'DIFFERENT: '}{counts}"]
    if compared.first is not None:
        first = compared.first
        field = f"{first.field}: " if first.field else ""
        at = f"{first.at_s - 1e-9 * recorded.begin_ns:.3f} s"
        within = "" if not compared.equal else ", within the tolerance"
        found.append(f"    first at {at}: {field}recorded {first.recorded}, replayed {first.replayed}{within}")
    return found


def _write_json(path: Path, results: Sequence[NodeResult]) -> None:
    document: list[dict[str, Any]] = [asdict(result) | {"equal": result.equal} for result in results]
    try:
        path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise ReplayError(f"{path} cannot be written: {error.strerror or error}") from None


def _names(nodes: Any) -> str:
    return ", ".join(nodes)


if __name__ == "__main__":
    sys.exit(main())
