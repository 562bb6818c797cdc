# perchhw: `make demo` flies in simulation with nothing attached, `make test` runs the tests.
# Both make their own virtual environment in .venv with the versions pinned under requirements/.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: demo walkthrough test lint lock clean

demo: $(VENV)/.demo
	$(BIN)/perchhw demo --out demo-run

# A hidden change of the simulated drone is found from its own flights, and its landings return.
walkthrough: $(VENV)/.dev
	$(BIN)/perchhw gap walkthrough --out walkthrough-run

# Flights in real time have the machine to themselves; the rest runs on all cores.
test: $(VENV)/.dev
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal --ignore tests/flight
	$(BIN)/python -m pytest tests/flight

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "perchhw needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: requirements/demo.lock pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements/demo.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

$(VENV)/.dev: requirements/dev.lock requirements/torch.lock pyproject.toml | $(BIN)/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes --requirement requirements/dev.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement requirements/torch.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@ $(VENV)/.demo

# Resolve the newest versions again and pin them.
lock:
	PYTHON=$(PYTHON) scripts/lock.sh

clean:
	rm -rf $(VENV) demo-run walkthrough-run
