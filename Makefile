# make demo and make test work on a fresh machine with Python 3.11 or newer: they create .venv themselves.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
DEMO ?= demo-run
# how many processes share the tests, a file each at a time (fixtures of a file are made once); 0 runs them in this one
JOBS ?= 2
PYTEST = $(BIN)/python -m pytest -n $(JOBS) --dist loadfile
# the matrices are small: more threads only wait for each other
export OPENBLAS_NUM_THREADS ?= 1

# every ten seconds how far a command is that says nothing itself
SAYING = while sleep 10 >/dev/null 2>&1; do echo "  ... $$(du -sm .venv | cut -f1) of 1300 MB"; done & trap "kill $$!" EXIT;

.PHONY: demo test check lowest highest fmt lint types docs pictures bench fuzz clean

$(READY): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.11")'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@echo "Installing Monodyn, with all that its tests and tools need, into .venv: 1.3 GB, one to five minutes."
	@$(SAYING) $(BIN)/python -m pip install --disable-pip-version-check --progress-bar off -e '.[dev]'
	$(BIN)/monodyn warm  # once, by two processes: tests that run side by side would compile the same
	touch $@

demo: $(READY)  ## the main job on the bundled clip
	$(BIN)/monodyn demo --out $(DEMO) --force

test: $(READY)  ## all tests but the slow ones: two to three minutes on two cores, once compiled
	$(PYTEST) -m "not slow"

check: $(READY)  ## exactly what CI runs: format, lint, types, all tests; MONODYN_DATA names a folder with recordings
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright  # says nothing for a minute
	$(PYTEST)

# The oldest and the newest versions that pyproject.toml admits, with this Python: the demo and the tests in an
# environment and a cache of compiled functions of their own. TESTS='-m "not slow"' runs a part of them.
lowest: RESOLUTION = lowest-direct
highest: RESOLUTION = highest
lowest highest:
	$(PYTHON) -m venv --clear .venv-$@
	.venv-$@/bin/python -m pip install --quiet --disable-pip-version-check uv
	.venv-$@/bin/uv pip install --python .venv-$@ --resolution $(RESOLUTION) -e '.[dev]'
	.venv-$@/bin/uv pip freeze --python .venv-$@
	NUMBA_CACHE_DIR=$(CURDIR)/.venv-$@/numba .venv-$@/bin/monodyn demo --out .venv-$@/demo
	NUMBA_CACHE_DIR=$(CURDIR)/.venv-$@/numba .venv-$@/bin/python -m pytest -n $(JOBS) --dist loadfile $(TESTS)

fmt: $(READY)  ## format and fix what can be fixed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

lint: $(READY)
	$(BIN)/ruff check .

types: $(READY)
	$(BIN)/pyright  # says nothing for a minute

docs: $(READY)  ## check that the documentation says what the code does
	$(BIN)/python -m pytest tests/test_docs.py tests/test_architecture.py tests/test_messages.py

pictures: $(READY)  ## the pictures of the README, from a run of the bundled clip; needs chromium
	$(BIN)/python examples/make_pictures.py

bench: $(READY)  ## accuracy and growth (need MONODYN_DATA), speed, next to mujoco.sysid too, and streams: ten minutes
	@if test -n "$$MONODYN_DATA"; then $(BIN)/python benchmarks/accuracy.py && $(BIN)/python benchmarks/published.py \
	&& $(BIN)/python benchmarks/encoders.py --only scaling; \
	else echo "accuracy.py, published.py, encoders.py: SKIPPED, MONODYN_DATA is not set; it names the folder with the recordings."; fi
	$(BIN)/python benchmarks/speed.py
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev,bench]'
	$(BIN)/python benchmarks/against_sysid.py
	$(BIN)/python benchmarks/live.py --only paced

FUZZ ?= --cases 1000
fuzz: $(READY)  ## a thousand cases of bad input, signals, full disks, two runs at once; FUZZ="--cases 100 --seed 7"
	$(BIN)/python benchmarks/fuzz.py --gate $(FUZZ)

clean:
	rm -rf .venv .venv-lowest .venv-highest build dist $(DEMO)
