"""``python -m robot_stack.supervisor``: the supervisor of one stack. Operators use ``robot-stack up``.

This module is named ``__main__`` for a reason: multiprocessing would import any other main module again in each child.
"""

from __future__ import annotations

import argparse
import os
import sys
from datetime import datetime
from pathlib import Path

from robot_stack.core.config import ConfigError
from robot_stack.core.runtime import AlreadyRunning, hold_lock, ros_domain_id
from robot_stack.core.wheels_env import ros_environment
from robot_stack.supervisor import child, logs, orphans, segments
from robot_stack.supervisor.client import LOCK_NAME
from robot_stack.supervisor.params import load_params
from robot_stack.supervisor.profile import load_plan
from robot_stack.supervisor.supervisor import Supervisor

# One thread per process: the stack has more processes than a small computer has cores, and pools of threads that wait
# for each other cost more than they bring.
_ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}


def main() -> int:
    options = _options()
    try:
        lock = hold_lock(LOCK_NAME)
        plan = load_plan(
            options.profile,
            settings=options.set,
            only=options.only,
            without=options.without,
            speed=options.speed,
            system_time=options.system_time,
            fleet=options.fleet,
        )
        params = load_params()
        if not plan.processes:
            raise ConfigError(f"profile {plan.name}: none of its processes is built: {', '.join(plan.missing)}")
        run_dir = logs.new_run(options.log_dir, ros_domain_id(), datetime.now(), params.keep_runs)
    except (ConfigError, AlreadyRunning, ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if run_dir == Path(os.devnull):
        print(f"{options.log_dir}: no space left, this run has no logs", file=sys.stderr)
    if not options.foreground:
        child.write_to(run_dir / "supervisor.log")
    os.environ.update(ros_environment())
    for name, value in _ONE_THREAD.items():
        os.environ.setdefault(name, value)
    left = orphans.find()
    if left:
        ids = orphans.end(left, patience_s=params.terminate_s)
        print(f"ended processes of an earlier supervisor: {', '.join(map(str, ids))}", file=sys.stderr)
    orphans.remove_stale_sockets()
    segments.remove_dead()
    child.go_first(params.own_niceness)
    Supervisor(plan, params, run_dir).run()
    lock.close()
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m robot_stack.supervisor", description=__doc__)
    parser.add_argument("--profile", required=True)
    parser.add_argument("--set", action="append", default=[], metavar="NODE.PARAMETER=VALUE")
    parser.add_argument("--only", action="append", default=[], metavar="PROCESS")
    parser.add_argument("--without", action="append", default=[], metavar="PROCESS")
    parser.add_argument("--fleet", metavar="URL")
    parser.add_argument("--speed", type=float)
    parser.add_argument("--system-time", action="store_true")
    parser.add_argument("--log-dir", type=Path, default=logs.default_log_dir())
    parser.add_argument("--foreground", action="store_true", help="log to stderr")
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
