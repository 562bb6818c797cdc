#!/usr/bin/env bash
# Resolve the dependencies anew, each set in an empty environment, and pin what came out under requirements/
# with the hashes of all its files (requirements/README.md).
set -euo pipefail
cd "$(dirname "$0")/.."
# torch 2.13.0 is the newest release whose plain wheel does not bring gigabytes of CUDA on the test machine.
TORCH=torch==2.13.0
HEAD="# Pinned by scripts/lock.sh; change pyproject.toml and run 'make lock' instead of editing."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

environment() {
  "${PYTHON:-python3}" -m venv "$work/$1"
  "$work/$1/bin/pip" install --quiet --disable-pip-version-check "${@:2}"
}

# Only pins go in, so that nothing is resolved here: it looks up the hashes.
hashed() {
  {
    echo "$HEAD"
    "$work/tools/bin/uv" pip compile --quiet --no-deps --no-header --no-annotate --no-emit-index-url \
      --no-emit-find-links --generate-hashes --python "$work/$1/bin/python" "$work/$1.txt"
  } > "$work/$1.lock"
  mv "$work/$1.lock" "requirements/$1.lock"
}

pin() {
  local name=$1 extra=$2
  environment "$name" "${@:3}" ".[$extra]"
  "$work/$name/bin/pip" freeze --exclude perchhw --exclude pip --exclude setuptools --exclude torch > "$work/$name.txt"
  hashed "$name"
}

environment tools uv
"$work/tools/bin/pip" freeze > "$work/tools.txt"
hashed tools
pin demo view
pin dev dev "$TORCH"
printf '%s\n' "$HEAD" "# Without hashes: requirements/README.md says why." "$TORCH" > requirements/torch.lock
