"""Which images are output together."""

from __future__ import annotations

from robot_stack.docking.vision.pairing import Attention, Exposure, ExposureSets

FRONT, REAR = "front", "rear"
BOTH = frozenset((FRONT, REAR))


def sets() -> ExposureSets[str]:
    return ExposureSets((FRONT, REAR), period_s=0.1, wait_s=0.03)


def shot(camera: str, at_s: float) -> Exposure[str]:
    return Exposure(camera, at_s, at_s + 0.01, f"{camera} {at_s:g}")


def items(taken: tuple[Exposure[str], ...]) -> list[str]:
    return [item.item for item in taken]


def test_cameras_triggered_together_leave_together_and_once() -> None:
    queue = sets()
    queue.add(shot(FRONT, 1.0))
    assert queue.take(1.01, BOTH, FRONT) == ()
    queue.add(shot(REAR, 1.0))
    assert items(queue.take(1.012, BOTH, FRONT)) == ["front 1", "rear 1"]
    assert queue.take(1.013, BOTH, FRONT) == ()
    queue.add(shot(REAR, 1.1))  # the other order
    assert queue.take(1.11, BOTH, FRONT) == ()
    queue.add(shot(FRONT, 1.1))
    assert items(queue.take(1.112, BOTH, FRONT)) == ["front 1.1", "rear 1.1"]


def test_at_other_phases_the_leading_image_leaves_at_once_beside_the_others_newest() -> None:
    queue = sets()
    queue.add(shot(FRONT, 1.0))
    assert items(queue.take(1.04, BOTH, FRONT)) == ["front 1"]  # has already waited for 0.03 s
    for k in range(1, 4):
        queue.add(shot(REAR, 0.95 + 0.1 * k))
        assert queue.take(0.96 + 0.1 * k, BOTH, FRONT) == ()
        assert queue.take(1.005 + 0.1 * k, BOTH, FRONT) == ()
        queue.add(shot(FRONT, 1.0 + 0.1 * k))
        assert items(queue.take(1.01 + 0.1 * k, BOTH, FRONT)) == [f"front {1 + 0.1 * k:g}", f"rear {0.95 + 0.1 * k:g}"]


def test_a_camera_just_dead_is_waited_for_briefly_whichever_leads() -> None:
    queue = sets()
    queue.add(shot(FRONT, 1.0))
    assert queue.take(1.039, BOTH, FRONT) == ()
    assert items(queue.take(1.041, BOTH, FRONT)) == ["front 1"]
    queue.add(shot(REAR, 1.1))
    assert queue.take(1.15, BOTH, FRONT) == ()  # the front camera's image may still arrive
    assert items(queue.take(1.172, BOTH, FRONT)) == ["rear 1.1"]
    queue.add(shot(REAR, 1.2))
    assert items(queue.take(1.21, frozenset((REAR,)), FRONT)) == ["rear 1.2"], "the front camera is known to be dead"


def test_repeated_and_late_images_are_old_but_a_restarted_clock_is_new() -> None:
    queue = sets()
    assert queue.is_new(FRONT, 5.0)
    queue.add(shot(FRONT, 5.0))
    assert not queue.is_new(FRONT, 5.0)
    assert not queue.is_new(FRONT, 4.5)
    assert queue.is_new(FRONT, 5.001)
    assert queue.is_new(FRONT, 3.9)
    assert queue.is_new(REAR, 5.0)


def test_a_camera_without_markers_is_searched_in_every_fifth_image_while_the_other_sees_some() -> None:
    attention = Attention((FRONT, REAR), 5)
    searched = []
    for _ in range(16):
        assert attention.uses(REAR)
        attention.saw(REAR)
        searched.append(attention.uses(FRONT))
    assert attention.leading == REAR
    assert searched == [True] * 6 + [False] * 4 + [True] + [False] * 4 + [True]
    attention.uses(REAR)
    attention.uses(REAR)  # two images of the rear camera without a marker
    assert attention.uses(FRONT)


def test_all_images_are_searched_while_no_marker_is_visible() -> None:
    attention = Attention((FRONT, REAR), 5)
    assert all(attention.uses(camera) for _ in range(20) for camera in (FRONT, REAR))
    assert attention.leading == FRONT


def test_the_leading_camera_stays_while_it_sees_markers() -> None:
    attention = Attention((FRONT, REAR), 5)
    for camera in (FRONT, REAR):
        attention.uses(camera)
    attention.saw(FRONT)
    attention.saw(REAR)
    assert attention.leading == FRONT
    for _ in range(2):
        for camera in (FRONT, REAR):
            attention.uses(camera)
        attention.saw(REAR)
    assert attention.leading == REAR
