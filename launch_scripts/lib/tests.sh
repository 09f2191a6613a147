# shellcheck shell=bash
# Sourced by launch_scripts/test: how the tests are run. junit: folder of JUnit files, empty for none.

# Every run is the same, and a test that fails has failed: nothing is repeated. Random examples: launch_scripts/explore.
given_tests() {
  run_tests given "$@"
}

# While editing. The safety kernel's tests run here; in a whole run they run under coverage.
fast_tests() {
  run_tests fast tests/contract tests/unit --fast --numprocesses 2 --dist loadfile "$@"
}

run_tests() {
  python -m pytest -o cache_dir=".pytest_cache/$1" ${junit:+--junitxml="$junit/$1.xml"} "${@:2}"
}

# One after the other, each with its slow modules (tests/slow.txt) first. The scheduled tests give the same result at any
# load, but would slow the pages of the touch screen.
all_tests() {
  local failed=()
  # Node tests mostly wait: four files at a time, whichever worker is free takes the next.
  run_tests nodes tests/nodes tests/ui --numprocesses 4 --dist loadfile --no-loadscope-reorder || failed+=(nodes)
  # Whole robots and single nodes on the deterministic scheduler. Each worker makes the shared begins of its files.
  run_tests simulated tests/simulated --numprocesses 2 --dist loadfile --no-loadscope-reorder || failed+=(simulated)
  # What only real processes can show, each a whole robot and its world, which need both cores.
  run_tests scenarios tests/scenarios || failed+=(scenarios)
  # What computes. The safety kernel's own tests run under coverage in tests/mutation.
  run_tests kernels tests/mutation tests/setup tests/contract tests/unit --ignore=tests/unit/safety \
    --numprocesses 2 --dist loadfile --no-loadscope-reorder || failed+=(kernels)
  ((${#failed[@]} == 0)) || { echo "== tests: FAILED in ${failed[*]}" && return 1; }
}
