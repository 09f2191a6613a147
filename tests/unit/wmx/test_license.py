"""A trial license that runs out, and devices that cannot be closed at once."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot_stack.core.config import ConfigError, validate
from robot_stack.wmx.api import EngineState, ErrorCode
from robot_stack.wmx.axes import Flag
from robot_stack.wmx.config import EngineConfig
from tests.unit.wmx.harness import POS, ThreadHarness, engine_data, runtime_folder, status, wait_status
from tests.unit.wmx.machine import Machine


@pytest.fixture(scope="module")
def trial() -> Machine:
    """300 cycles of communication."""
    return Machine(license_s=0.3)


class TestLicense:
    def test_communication_ends_with_it(self, trial: Machine) -> None:
        trial.restart()
        engine = trial.engine
        assert trial.jog(POS, 1.0) == 0
        assert not engine.condition.invalid_license
        trial.until(lambda: engine.condition.invalid_license, "the license to run out", 301)
        assert engine.condition.licensed_cycles == 300
        assert engine.condition.state is EngineState.Running
        assert not trial.flags[Flag.SERVO_ON].any()
        assert trial.engine_at_rest()
        trial.run(5)
        assert not trial.drives.servo_on.any()

    def test_no_other_communication_before_the_engine_is_started_anew(self, trial: Machine) -> None:
        trial.restart()
        engine = trial.engine
        trial.run(300)
        assert engine.start_communication() == ErrorCode.StartCommunicationError
        assert engine.set_servo_on([POS], 1) == ErrorCode.CommNotStarted
        trial.restart()
        assert engine.condition.communicating
        assert not engine.condition.invalid_license

    def test_pauses_do_not_count(self, trial: Machine) -> None:
        trial.restart()
        engine = trial.engine
        used = engine.condition.licensed_cycles
        engine.stop_communication()
        trial.run(400)
        assert engine.condition.licensed_cycles == used
        assert engine.start_communication() == 0
        trial.run(30)
        assert engine.condition.communicating

    def test_without_a_limit(self) -> None:
        endless = Machine()
        endless.restart()
        endless.run(400)
        assert endless.engine.condition.communicating

    @pytest.mark.parametrize("value", [0.0, -1.0, "hour"])
    def test_bad_configuration(self, value: object) -> None:
        with pytest.raises(ConfigError, match="license_s"):
            validate(EngineConfig, engine_data(license_s=value), "file.yaml")


@pytest.fixture
def harness() -> Iterator[ThreadHarness]:
    with runtime_folder() as folder:
        made = ThreadHarness(folder, license_s=3600.0)
        try:
            yield made
        finally:
            made.stop()


def test_clients_see_the_license(harness: ThreadHarness) -> None:
    engine = harness.communicating()
    assert not engine.core_motion.GetStatus()[1].invalidLicenseError
    harness.engine.condition.licensed_cycles = 3_600_000
    snapshot = wait_status(engine, lambda now: now.invalid_license, "the license to run out")
    assert not snapshot.communicating
    assert engine.core_motion.GetStatus()[1].invalidLicenseError
    assert engine.api.StartCommunication(1000) == ErrorCode.StartCommunicationError
    harness.end_test()


def test_a_locked_close_leaves_the_device_open(harness: ThreadHarness) -> None:
    engine = harness.connect()
    harness.server.inject_close_lock(60.0)
    assert engine.api.CloseDevice() == int(ErrorCode.CloseDeviceLockError) == 298
    assert engine.api.IsDeviceValid()
    assert engine.api.SetDeviceName("still here") == 0
    assert "being closed" in engine.api.ErrorToString(ErrorCode.CloseDeviceLockError)
    harness.server.inject_close_lock(0.0)
    assert engine.api.CloseDevice() == 0
    assert not engine.api.IsDeviceValid()


def test_close_outwaits_the_lock(harness: ThreadHarness) -> None:
    one, two = harness.connect("one"), harness.connect("two")
    harness.server.inject_close_lock(0.05)
    one.close()
    assert not one.api.IsDeviceValid()
    assert status(two).engine_state is EngineState.Running
    assert two.api.GetAllDevices()[1].count == 1
    harness.end_test()
