"""Type hashes: upstream's, needed to communicate with others, and our own, so that every change is detected."""

from __future__ import annotations

import pytest

from tests.contract.type_hashes import (
    OWN_LOCK,
    OWN_PACKAGES,
    UPSTREAM_LOCK,
    UPSTREAM_PACKAGES,
    installed,
    locked,
)


@pytest.mark.parametrize("package", UPSTREAM_PACKAGES)
def test_types_of_upstream_packages_have_upstreams_hashes(package: str) -> None:
    """A full upstream package may hold more types than ours; the types of ours must be upstream's."""
    expected = {name: value for name, value in locked(UPSTREAM_LOCK).items() if name.startswith(f"{package}/")}
    present = installed(package)

    assert expected
    assert {name: present.get(name) for name in expected} == expected


def test_the_upstream_types_of_the_stack_are_locked() -> None:
    """The upstream types that the stack needs."""
    names = locked(UPSTREAM_LOCK)

    needed = {
        "control_msgs/action/FollowJointTrajectory",
        "nav2_msgs/action/NavigateToPose",
        "tf2_msgs/msg/TFMessage",
    }
    assert needed <= set(names)
    assert all(value.startswith("RIHS01_") and len(value) == len("RIHS01_") + 64 for value in names.values())


@pytest.mark.parametrize("package", OWN_PACKAGES)
def test_own_types_are_as_locked(package: str) -> None:
    expected = {name: value for name, value in locked(OWN_LOCK).items() if name.startswith(f"{package}/")}

    assert installed(package) == expected, (
        "an interface changed; if that is meant: python -m tests.contract.type_hashes"
    )
