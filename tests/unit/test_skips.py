from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import ValidationError

from tests import skips

ROOT = Path(__file__).parents[2]
CONFTEST = """
from tests import skips

def pytest_configure(config):
    row = skips.Skip(test="test_listed.py", reason="no oil", runs="elsewhere")
    config.pluginmanager.register(skips.OnlyListedSkips([row]))
"""
MARKED = "import pytest\n@pytest.mark.skip(reason={reason!r})\ndef test_marked(): pass\n"
FILES = {
    "test_listed": MARKED.format(reason="no oil: add some"),
    "test_unlisted": MARKED.format(reason="no oil"),
    "test_within": "import pytest\ndef test_within(): pytest.skip('no oil')\n",
    "test_module": "import pytest\npytest.skip('no oil', allow_module_level=True)\n",
    "test_expected": "import pytest\n@pytest.mark.xfail(reason='no water')\ndef test_expected(): assert False\n",
}


def test_a_skip_that_is_not_listed_fails(tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(CONFTEST)
    for name, text in FILES.items():
        (tmp_path / f"{name}.py").write_text(text)
    command = [sys.executable, "-m", "pytest", "-rA", "--continue-on-collection-errors", "--rootdir", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(
        [*command, "-c", os.devnull], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60.0
    )
    summary = done.stdout.partition("short test summary info")[2]
    assert "SKIPPED [1] test_listed.py" in summary
    for line in ("ERROR test_unlisted.py", "FAILED test_within.py", "ERROR test_module.py", "XFAIL test_expected.py"):
        assert line in summary
    assert "1 failed, 1 skipped, 1 xfailed, 2 errors" in summary


def test_every_row_names_a_test_that_there_is() -> None:
    for row in skips.load():
        assert (ROOT / row.test).exists(), row


def test_every_slow_module_is_there() -> None:
    for line in (ROOT / "tests" / "slow.txt").read_text().splitlines()[1:]:
        assert (ROOT / line).is_file(), line


def test_a_row_without_a_reason_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "skips.yaml"
    file.write_text("- {test: tests/unit/, runs: nowhere}\n")
    with pytest.raises(ValidationError, match="reason"):
        skips.load(file)
