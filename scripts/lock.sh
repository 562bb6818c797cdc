#!/usr/bin/env bash
# Resolve the dependencies anew, each set in an empty environment, and pin what came out under requirements/.
set -euo pipefail
cd "$(dirname "$0")/.."
# torch 2.13.0 is the newest release whose plain wheel does not bring gigabytes of CUDA on the test machine.
TORCH=torch==2.13.0
pin() {
  local name=$1 extra=$2
  shift 2
  local folder
  folder=$(mktemp -d)
  "${PYTHON:-python3}" -m venv "$folder"
  "$folder/bin/pip" install --quiet --disable-pip-version-check "$@" ".[$extra]"
  {
    echo "# Pinned by scripts/lock.sh; change pyproject.toml and run 'make lock' instead of editing."
    "$folder/bin/pip" freeze --exclude perchhw --exclude pip --exclude setuptools | sed -E 's/^torch(==| @).*/'"$TORCH"'/; s/^(torch==[0-9.]+)\+.*/\1/'
  } > "requirements/$name.lock"
  rm -rf "$folder"
}
pin demo view
pin dev dev "$TORCH"
