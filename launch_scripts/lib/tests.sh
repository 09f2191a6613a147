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

# What only computes runs beside what waits for real time, and gives way to it.
all_tests() {
  local log computing code=0
  log=$(mktemp)
  tests computing tests/contract tests/mutation tests/setup tests/unit >"$log" 2>&1 &
  computing=$!
  renice -n 19 "$computing" >/dev/null
  tests timed tests/nodes tests/scenarios || code=1
  wait "$computing" || code=1
  cat "$log"
  rm "$log"
  return $code
}
