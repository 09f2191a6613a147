"""Process wmx_engine: the simulated motion engine on virtual drives, for the profiles that have no machine."""

from __future__ import annotations

from robot_stack.contract import services
from robot_stack.wmx.config import EngineConfig
from sim.nodes.engine_host import EngineHost, run_engine_host
from sim.plant.engine_loop import Plant
from sim.plant.virtual_plant import VirtualPlant


class WmxEngine(EngineHost):
    """No parameters of its own: the engine's axes are in the file of config/ that the profile names."""

    def __init__(self) -> None:
        super().__init__("wmx_engine", None, services.INJECT_ENGINE_FAULT)

    def build(self, config: EngineConfig) -> Plant:
        return VirtualPlant(config)


def main() -> None:
    raise SystemExit(run_engine_host(WmxEngine))


if __name__ == "__main__":
    main()
