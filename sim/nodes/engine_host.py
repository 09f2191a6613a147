"""Common base of processes with a motion engine and its machine: engine and plant in the main thread,
ROS in a second one."""

from __future__ import annotations

import gc
import sys
import threading
import traceback
from collections.abc import Callable

from pydantic import BaseModel

from robot_stack.contract.model import ContractViolation, Service
from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import AlreadyRunning, runtime_dir
from robot_stack.middleware.node import StackNode
from robot_stack.ros.process import EXIT_CRASHED, EXIT_REFUSED, StopSignal, ros_process
from robot_stack.wmx.config import EngineConfig, load_engine_config
from robot_stack.wmx.engine_server.engine import Engine
from robot_stack.wmx.engine_server.server import EngineServer
from sim.nodes.fault_service import serve_faults
from sim.plant.engine_loop import EngineLoop, EveryCycles, Plant

_CATCH_UP_S = 0.1
_SWITCH_INTERVAL_S = 0.0005
_REPORT_RATE_HZ = 1.0


class EngineHost(StackNode):
    """The node of such a process. ``build`` makes the plant; faults arrive by the service ``fault_row``."""

    def __init__(self, name: str, parameters: type[BaseModel] | None, fault_row: Service) -> None:
        super().__init__(name, parameters)
        self.config: EngineConfig = load_engine_config()
        self.plant = self.build(self.config)
        server = EngineServer(Engine(self.config, self.plant.bus), runtime_dir())
        self.loop = EngineLoop(server, self.plant, _CATCH_UP_S, self.tasks())
        serve_faults(self, fault_row, self.loop.inject)
        self.every(_REPORT_RATE_HZ, self._publish)
        self._publish()

    def build(self, config: EngineConfig) -> Plant:
        """The machine of this engine. Raises ConfigError."""
        raise NotImplementedError

    def tasks(self) -> tuple[EveryCycles, ...]:
        """Further tasks of the loop."""
        return ()

    def cycles(self, rate_hz: float) -> int:
        """Cycles between two events of ``rate_hz``."""
        return max(1, round(1.0 / (rate_hz * self.config.cycle_time_s)))

    def _publish(self) -> None:
        engine, pacer = self.loop.server.engine, self.loop.pacer
        self.set_health(True, f"engine {engine.condition.state.name}, {self.config.n_axes} axes")
        self.report.values = {
            "cycles": str(engine.condition.cycles),
            "devices": str(len(engine.devices)),
            "late cycles": str(pacer.total_overruns),
            "time given up": f"{pacer.total_dropped_s:.3f} s",
        }


def run_engine_host(make: Callable[[], EngineHost]) -> int:
    """Runs the process until SIGINT or SIGTERM. Returns the exit code."""
    should_stop = StopSignal()
    try:
        with ros_process(make) as (executor, nodes):
            host = nodes[0]
            sys.setswitchinterval(_SWITCH_INTERVAL_S)
            callbacks = threading.Thread(target=executor.spin, name="ros", daemon=True)
            callbacks.start()
            try:
                gc.collect()
                gc.freeze()  # present objects stay: exclude them from garbage collection in the loop
                host.loop.run(lambda: should_stop() or not callbacks.is_alive())
                if not should_stop():
                    raise RuntimeError("the ROS thread has ended")
            finally:
                host.loop.shut_down()
                executor.stop()
                callbacks.join(2.0)
    except (ConfigError, AlreadyRunning, ContractViolation, OSError) as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return EXIT_REFUSED
    except Exception:
        traceback.print_exc()
        return EXIT_CRASHED
    return 0
