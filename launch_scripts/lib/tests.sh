# shellcheck shell=bash
# Sourced by launch_scripts/test: how the tests are run.

# Every run is the same, and a test that fails has failed: nothing is repeated. Random examples: launch_scripts/explore.
given_tests() {
  run_tests given "$@"
}

# While editing. The safety kernel's tests run here; in a whole run they run under coverage.
fast_tests() {
  run_tests fast tests/contract tests/unit --fast --numprocesses 2 --dist loadfile "$@"
}

run_tests() {
  python -m pytest -o cache_dir=".pytest_cache/$1" "${@:2}"
}

all_tests() {
  local failed=() simulated log
  log=$(mktemp)
  # Whole robots and single nodes on the deterministic scheduler: the same result at any load. They take what the node
  # tests leave of the processors, which mostly wait: three files at a time, whichever worker is free takes the next.
  nice -n 19 bash -c "$(declare -f run_tests); run_tests simulated tests/simulated --numprocesses 2" >"$log" 2>&1 &
  simulated=$!
  run_tests nodes tests/nodes tests/ui --numprocesses 3 --dist loadfile || failed+=(nodes)
  wait "$simulated" || failed+=(simulated)
  cat "$log" && rm "$log"
  # What only real processes can show, each a whole robot and its world, which need both cores.
  run_tests scenarios tests/scenarios || failed+=(scenarios)
  # What computes, the longest first. The safety kernel's own tests run under coverage in tests/mutation.
  run_tests kernels tests/mutation tests/setup tests/contract tests/unit --ignore=tests/unit/safety \
    --numprocesses 2 --dist loadfile --no-loadscope-reorder || failed+=(kernels)
  ((${#failed[@]} == 0)) || { echo "== tests: FAILED in ${failed[*]}" && return 1; }
}
