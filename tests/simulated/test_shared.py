"""Runs that go on from a shared begin are the same as runs of their own."""

from __future__ import annotations

import mmap
from pathlib import Path

from tests.simulated import shared
from tests.simulated.stage import Stage, staged


def ride(stage: Stage) -> tuple[float, str]:
    """Drives, and ends and restarts a process with state files. Returns time and digest."""
    stage.drive_at(0.5)
    stage.estop(True)
    stage.wait_safety("EMERGENCY_STOP")
    stage.kill("safety_monitor")
    stage.wait_restarted("safety_monitor")
    return stage.now_s, stage.ride.digest.hexdigest()


@shared.shared(staged, digest=True)
def test_a_run_that_goes_on_is_as_one_of_its_own() -> None:
    with staged(digest=True) as stage:
        assert stage.now_s > 1.0
        assert stage.ride.digest.messages > 1000, "begun before the test"
        folder, gone_on = stage.stack.folder, ride(stage)
    assert not folder.exists()
    with staged(digest=True) as stage:
        assert stage.stack.folder != folder, "of its own"
        assert ride(stage) == gone_on


def test_files_are_restored_with_their_identity(tmp_path: Path) -> None:
    folder = tmp_path / "run" / "state"
    (folder / "nodes").mkdir(parents=True)
    page_file, journal = folder / "nodes" / "page", folder / "journal"
    page_file.write_bytes(b"page")
    journal.write_bytes(b"begun\n")
    with open(page_file, "r+b") as file, mmap.mmap(file.fileno(), 4) as page:
        files = shared.Files([folder])
        page[:] = b"else"
        journal.unlink()
        journal.write_bytes(b"begun\nended\n")
        (folder / "new").touch()
        files.restore()
        assert page[:] == page_file.read_bytes() == b"page"
        page[:] = b"next"
        assert page_file.read_bytes() == b"next", "the page is still that of the file"
        assert journal.read_bytes() == b"begun\n"
        assert sorted(path.name for path in folder.iterdir()) == ["journal", "nodes"]
        files.restore()
        assert page[:] == page_file.read_bytes() == b"page"
        files.forget()
    assert [path.name for path in folder.parent.iterdir()] == ["state"]
