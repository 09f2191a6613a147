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
  local code=0 file number=0 lane lanes=("" "" "") logs
  logs=$(mktemp -d)
  # What computes runs beside what is bound to real time, and gives way to it. The safety kernel's own tests run under
  # coverage in tests/mutation.
  {
    renice -n 10 "$BASHPID" >/dev/null
    tests patient tests/contract tests/mutation tests/setup tests/unit --ignore=tests/unit/safety
  } >"$logs/patient" 2>&1 &
  local patient=$!
  # A node test takes half a core, a scenario two, and a sweep is lost where a receiver gets no time for a second.
  local greedy=(tests/scenarios tests/nodes/test_transport.py)
  # By size, so that both lanes of the robot's nodes take about the same time; those of the engine's nodes mostly wait.
  for file in $(ls -S tests/nodes/test_*.py); do
    [[ " ${greedy[*]} " == *" $file "* ]] && continue
    case $file in
      *wmx* | *manipulator* | *trajectory* | *diff_drive*) lane=2 ;;
      *mission_ride*) lane=1 ;; # long for its size
      *) lane=$(((number++ + 1) / 2 % 2)) ;;
    esac
    lanes[lane]+=" $file"
  done
  # shellcheck disable=SC2086 # file names without spaces, one word each
  tests nodes ${lanes[1]} >"$logs/nodes" 2>&1 &
  local nodes=$!
  # shellcheck disable=SC2086
  tests engine ${lanes[2]} >"$logs/engine" 2>&1 &
  local engine=$!
  # shellcheck disable=SC2086
  tests timed ${lanes[0]} || code=1
  wait "$nodes" || code=1
  wait "$engine" || code=1
  tests scenarios "${greedy[@]}" || code=1
  wait "$patient" || code=1
  for file in nodes engine patient; do
    echo "== tests: $file, which ran beside"
    cat "$logs/$file"
  done
  rm -r "$logs"
  return $code
}
