# shellcheck shell=bash
# Sourced by launch_scripts/test: how the tests are run.

# Node and scenario tests run in real time; a machine that is paused meanwhile fails some. What fails is run once more
# when nothing else runs any more; what fails twice has failed.
given_tests() {
  run_tests given "$@" || run_again given
}

run_tests() {
  local code=0
  python -m pytest -o cache_dir=".pytest_cache/$1" "${@:2}" || code=$?
  ((code < 2)) || rm -f ".pytest_cache/$1/v/cache/lastfailed" # not ended by failed tests: nothing to repeat
  return $code
}

run_again() {
  local cache=.pytest_cache/$1 count
  count=$(grep -c ': true' "$cache/v/cache/lastfailed" 2>/dev/null) || return 1
  echo "== tests: $count of the $1 FAILED, listed above; once more those, alone"
  python -m pytest -o cache_dir="$cache" --last-failed --last-failed-no-failures none || return
  echo "== tests: $count passed only when repeated"
}

all_tests() {
  local code=0 file name number=0 lane lanes=("" "" "") logs failed=()
  logs=$(mktemp -d)
  # What computes runs beside what is bound to real time, and gives way to it: in a session of its own, since a kernel
  # that groups processes by session weighs nice values inside a session only. The safety kernel's own tests run under
  # coverage in tests/mutation.
  export -f run_tests
  setsid --wait bash -c '
    echo 15 2>/dev/null >/proc/self/autogroup
    renice -n 15 $$ >/dev/null
    run_tests patient tests/contract tests/mutation tests/setup tests/unit --ignore=tests/unit/safety
  ' >"$logs/patient" 2>&1 &
  local patient=$!
  trap 'kill -- -'$patient'; exit 130' INT TERM
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
  run_tests nodes ${lanes[1]} >"$logs/nodes" 2>&1 &
  local nodes=$!
  # shellcheck disable=SC2086
  run_tests engine ${lanes[2]} >"$logs/engine" 2>&1 &
  local engine=$!
  # shellcheck disable=SC2086
  run_tests timed ${lanes[0]} || failed+=(timed)
  wait "$nodes" || failed+=(nodes)
  wait "$engine" || failed+=(engine)
  run_tests scenarios "${greedy[@]}" || failed+=(scenarios)
  wait "$patient" || failed+=(patient)
  trap - INT TERM
  for file in nodes engine patient; do
    echo "== tests: $file, which ran beside"
    cat "$logs/$file"
  done
  rm -r "$logs"
  for name in "${failed[@]}"; do
    run_again "$name" || code=1
  done
  return $code
}
