"""Guarantees that processes of an ordinary user cannot give on a busy machine."""

from __future__ import annotations

import pytest

from robot_stack.cli.rights import rights
from robot_stack.supervisor.params import load_params

_MISSING = [right for right in rights(load_params()) if not right.granted]

needs_rights = pytest.mark.skipif(
    bool(_MISSING), reason=f"no {', no '.join(right.name for right in _MISSING)}: see launch_scripts/grant_rights"
)
