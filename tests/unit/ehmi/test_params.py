"""``config/ehmi_bridge.yaml`` and ``config/ehmi_display.yaml``."""

from __future__ import annotations

from robot_stack.contract.topics import EHMI_STATUS
from robot_stack.core.config import load
from robot_stack.ehmi.params import EhmiParams
from sim.ehmi.params import EhmiDisplayParams

LINK_LOST_S = 5.0  # row EHMI_LINK_LOST


def test_the_link_is_back_before_it_counts_as_lost():
    link = load(EhmiParams, "ehmi_bridge").link
    assert link.acknowledge_s * link.tries < link.repeat_s
    assert link.back_off_limit_s + link.acknowledge_s < LINK_LOST_S
    assert EHMI_STATUS.stale_s == LINK_LOST_S


def test_a_host_that_repeats_is_not_silent_for_the_firmware():
    display, link = load(EhmiDisplayParams, "ehmi_display"), load(EhmiParams, "ehmi_bridge").link
    assert display.firmware.host_timeout_s > 2.0 * link.repeat_s
    assert display.firmware.latency_s + display.firmware.latency_jitter_s < link.acknowledge_s
