"""Parameters of the node modbus_battery_driver: ``config/modbus_battery_driver.yaml``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from robot_stack.core.config import Config
from robot_stack.drivers.battery import PackParams

Address = Annotated[int, Field(ge=0, le=65535)]


class ModbusParams(Config):
    """transport: ``tcp`` to host and port, or ``rtu`` on a serial line; a relative serial_port lies in the runtime
    folder. unit: of the device. poll_s: polling period. timeout_s: of a response.

    reopen_s: pause after a connection that failed or was lost.
    """

    transport: Literal["tcp", "rtu"]
    host: Annotated[str, Field(min_length=1)]
    port: Annotated[int, Field(ge=1, le=65535)]
    serial_port: Annotated[str, Field(min_length=1)]
    baud_rate: Literal[1200, 2400, 4800, 9600, 19200, 38400, 57600, 115200]
    parity: Literal["none", "even", "odd"]  # YAML takes N for false
    unit: Annotated[int, Field(ge=0, le=255)]
    poll_s: Annotated[float, Field(ge=0.1, le=2.0)]
    timeout_s: Annotated[float, Field(ge=0.05, le=1.0)]
    reopen_s: Annotated[float, Field(gt=0.0, le=10.0)]


class RegisterParams(Config):
    """A holding register of 16 bits. per_unit: counts per 1 V, A, percent or degree; negative inverts the sign."""

    address: Address
    signed: bool
    per_unit: Annotated[float, Field(ge=-10000.0, le=10000.0)]

    @model_validator(mode="after")
    def _divides(self) -> RegisterParams:
        if self.per_unit == 0.0:
            raise ValueError("per_unit must not be 0")
        return self


class RegistersParams(Config):
    """Addresses of the measurements: V, A (positive while charging), percent, degrees Celsius, percent of the capacity
    of a new battery. null: the device does not have it.
    """

    voltage: RegisterParams
    current: RegisterParams
    charge: RegisterParams
    temperature: RegisterParams | None
    state_of_health: RegisterParams | None


class AlarmsParams(Config):
    """Registers that are nonzero in an alarm, by alarm."""

    failure: tuple[Address, ...]
    too_hot: tuple[Address, ...]
    over_voltage: tuple[Address, ...]
    under_voltage: tuple[Address, ...]
    too_cold: tuple[Address, ...]


class ModbusBatteryDriverParams(Config):
    modbus: ModbusParams
    registers: RegistersParams
    alarms: AlarmsParams
    pack: PackParams
