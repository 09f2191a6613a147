"""Runs a generator of rosidl, ``generate_interfaces.py GENERATOR ARGUMENT...``, and keeps the parsed definitions.

A package has six generators or more, each a process of its own that parses every interface definition. rosidl's parser
takes half of a generator's time. Here the first generator stores the result in the build folder, and the others load
it. The generators' output is the same.
"""

import fcntl
import hashlib
import pickle
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rosidl_parser import definition, parser
from steps import replace_file

_ARGUMENTS = "--generator-arguments-file"  # lies in the build folder
_FOLDER = "parsed_interfaces"


def main(command: list[str]) -> None:
    generator, arguments = command[0], command[1:]
    build = Path(arguments[arguments.index(_ARGUMENTS) + 1]).parent
    parser.parse_idl_string = stored(parser.parse_idl_string, build / _FOLDER)
    sys.argv = command
    sys.path[0] = str(Path(generator).parent)  # as if Python had been started with the generator
    runpy.run_path(generator, run_name="__main__")


def stored(parse: Callable[[str], Any], folder: Path) -> Callable[..., Any]:
    """Returns ``parse`` with its results stored by text and parser; of concurrent processes the first one parses."""
    folder.mkdir(exist_ok=True)
    sources = (parser.__file__, parser.grammar_file, definition.__file__)
    version = b"".join(Path(source).read_bytes() for source in sources)

    def load_or_parse(text: str, png_file: str | None = None) -> Any:
        result = folder / hashlib.sha256(version + text.encode()).hexdigest()
        with result.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not result.exists():
                replace_file(result, pickle.dumps(parse(text)))
        return pickle.loads(result.read_bytes())

    return load_or_parse


if __name__ == "__main__":
    main(sys.argv[1:])
