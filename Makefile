# perchhw: `make demo` flies in simulation with nothing attached, `make test` runs the tests, `make check` the quick
# ones with lint and types, `make soak` the long proofs.
# Both make their own virtual environment in .venv with the versions pinned under requirements/.

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# Flying and the bench's wizards wait for some of their time: three tests more than there are cores leave none idle.
WORKERS ?= $(shell $(PYTHON) -c 'import os; print((os.cpu_count() or 1) + 3)')
INSTALL := $(BIN)/python scripts/install.py
# Two environments at a time would write the same files into this folder.
OURS := flock pyproject.toml $(INSTALL) --no-deps --editable .
# A file of tests is one process's, which makes what they share once; the longest come first (tests/tiers.py).
PYTEST := $(BIN)/python -m pytest --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder

# Some images of Python forbid it to keep compiled modules: every start would compile them all again.
unexport PYTHONDONTWRITEBYTECODE
# As the command line does: threads of the linear algebra only spin where every core has a test already.
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: demo walkthrough check test soak soak-sample sample-of-tests sample-of-flights sample-of-mutants lint lock \
	clean

demo: $(VENV)/.demo
	$(BIN)/perchhw demo --out demo-run

# A hidden change of the simulated drone is found from its own flights, and its landings return.
walkthrough: $(VENV)/.dev
	$(BIN)/perchhw gap walkthrough --out walkthrough-run

# What fails most often, in a minute once compiled: the pure parts, lint, types, layers.
CHECKED := tests/supervisor tests/onboard tests/flight_files tests/record tests/label tests/mocap tests/lab_time \
	tests/link/test_replies.py tests/link/test_uri.py tests/campaign/test_plan.py tests/lab_file/test_lab_file.py
check: $(VENV)/.dev
	$(PYTEST) --quiet -m "not slow and not soak and not further" $(CHECKED)
	$(MAKE) lint

# What a contributor must see green.
test: $(VENV)/.warm
	$(PYTEST)

# Once for a fresh clone: else each of the tests' processes compiles the same modules, all at the same time.
# A flight's kernels are compiled beside it, on the other core.
$(VENV)/.warm: $(VENV)/.dev
	: | $(BIN)/python -m sim_backend.stage >/dev/null & \
	$(BIN)/python -m pytest --collect-only --quiet >/dev/null; wait
	touch $@

# The long proofs, two hours on two cores. Each goes on where it can when it is started again, and says its seed.
SEED ?= 1
soak: $(VENV)/.dev
	$(PYTEST) -m "soak or further or hypothesis" --hypothesis-profile soak
	$(BIN)/python -m tests.lab_time.same_flight --busy 16 --flights 5 --seed $(SEED)
	$(BIN)/python -m tests.faulty_campaign --attempts 200 --seed $(SEED)
	$(BIN)/python -m tests.diagnosis.faulty_flights --flights 200 --seed $(SEED)
	$(BIN)/python -m tests.flight.stop_proof --stops 1000 --drones 7 --seed $(SEED)
	$(BIN)/python -m tests.mutation
	$(BIN)/python -m tests.firmware.mutation
	$(BIN)/python benchmarks/gap.py

# A sample of them, another one with each SEED; the three parts may run beside each other.
soak-sample: sample-of-tests sample-of-flights sample-of-mutants

sample-of-tests: $(VENV)/.dev
	$(BIN)/python -m pytest -m "further and not soak" --sample 6 --sample-seed $(SEED)

sample-of-flights: $(VENV)/.dev
	$(BIN)/python -m tests.lab_time.same_flight --busy 2 --flights 1 --seed $(SEED)
	$(BIN)/python -m tests.faulty_campaign --attempts 1 --seed $(SEED)
	$(BIN)/python -m tests.diagnosis.faulty_flights --flights 1 --seed $(SEED)
	$(BIN)/python -m tests.flight.stop_proof --stops 2 --seed $(SEED)

sample-of-mutants: $(VENV)/.dev
	$(BIN)/python -m tests.mutation --sample 6 --seed $(SEED)
	$(BIN)/python -m tests.firmware.mutation --sample 3 --seed $(SEED)

lint: $(VENV)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python scripts/uncalled.py

# pip comes last: an environment without it was not finished, and is made over.
$(BIN)/pip:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "perchhw needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: requirements/demo.lock pyproject.toml | $(BIN)/pip
	$(INSTALL) --require-hashes --requirement requirements/demo.lock
	$(OURS)
	touch $@

$(VENV)/.dev: requirements/dev.lock requirements/torch.lock pyproject.toml | $(BIN)/pip
	$(INSTALL) --require-hashes --requirement requirements/dev.lock
	$(INSTALL) --requirement requirements/torch.lock
	$(OURS)
	touch $@ $(VENV)/.demo

# Resolve the newest versions again and pin them.
lock:
	PYTHON=$(PYTHON) scripts/lock.sh

clean:
	rm -rf $(VENV) demo-run walkthrough-run
