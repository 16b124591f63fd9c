#!/bin/bash
# What it takes to start: scenario 01 to 0.1 s of its time, wall, median of five, with its modes solved for and with them from the cache.
set -eu
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
start() { CARDAN_CACHE=$1 build/cardan run scenarios/01_flexible_slew --until 0.1 --quiet --out "$out/run"; }
median() {
  TIMEFORMAT=%R
  for _ in 1 2 3 4 5; do { time start "$1" >/dev/null 2>&1; } 2>&1; done | sort -n | sed -n 3p
}
echo "| modes of both wings | s |"
echo "|---|---:|"
echo "| solved for | $(median off) |"
start "$out/cache" >/dev/null 2>&1
echo "| from the cache | $(median "$out/cache") |"
