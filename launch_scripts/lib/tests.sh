# shellcheck shell=bash
# Sourced by launch_scripts/test: how the tests are run.

# Node and scenario tests run in real time; a machine that is paused meanwhile fails some. What fails twice has failed.
tests() {
  local cache=.pytest_cache/$1 count
  shift
  python -m pytest -o cache_dir="$cache" "$@" && return
  count=$(grep -c ': true' "$cache/v/cache/lastfailed")
  echo "== tests: $count FAILED, listed above; once more those"
  python -m pytest -o cache_dir="$cache" --last-failed --last-failed-no-failures none || return
  echo "== tests: $count passed only when repeated"
}

all_tests() {
  local log patiently code=0
  log=$(mktemp)
  # What computes runs beside what is bound to real time, and gives way to it. The safety kernel's own tests run under
  # coverage in tests/mutation.
  tests patient tests/contract tests/mutation tests/setup tests/unit --ignore=tests/unit/safety >"$log" 2>&1 &
  patiently=$!
  renice -n 19 "$patiently" >/dev/null
  tests timed tests/nodes tests/scenarios || code=1
  echo "== tests: those that ran beside"
  wait "$patiently" || code=1
  cat "$log"
  rm "$log"
  return $code
}
