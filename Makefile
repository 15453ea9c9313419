# One environment, `.venv`, made on first use by whichever target runs first.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: setup demo test test-fast test-lowest test-newest test-versions lint docs bench fuzz wheel-demo constraints
setup: .venv/.ready

# What the commands need; enough for the demo.
.venv/.base: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable .
	@touch $@

# Everything, for tests, documentation and benchmarks.
.venv/.ready: .venv/.base
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[dev]"
	@touch $@

demo: .venv/.base
	@mkdir -p out
	$(BIN)/reba score datasets/balancing_keypoints.trc --report out/balancing.html
	$(BIN)/reba info datasets/simulated_palletising.mcap
	$(BIN)/reba score datasets/simulated_palletising.mcap --load 8 --coupling fair -o out/palletising.parquet --report out/palletising.html
	$(BIN)/reba improve datasets/simulated_palletising.mcap --load 8 --coupling fair
	@echo "Open out/palletising.html and out/balancing.html in a browser."

# Two processes on two cores: threads of the linear algebra on top of them would only wait for each other.
test test-fast test-lowest test-newest test-versions: export OMP_NUM_THREADS := 1

test: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal

# Without what starts browsers, clusters, planners or many processes; names what takes longer than 2 s and is to be marked.
test-fast: setup
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not slow" --durations=10 --durations-min=2

# The fast tests with the lowest versions that pyproject.toml declares.
test-lowest: setup
	PYTHON=$(PYTHON) .ci/versions lowest

# The fast tests with the newest versions that exist, on the newest Python that is found.
test-newest: setup
	PYTHON=$(PYTHON) .ci/versions newest

# Both, at the same time.
test-versions: setup
	PYTHON=$(PYTHON) .ci/versions lowest newest

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: setup
	$(BIN)/sphinx-build -W --keep-going -q docs out/docs
	@echo "Open out/docs/index.html in a browser."

# `python benchmarks/all.py --help`, and of each script beside it, says what can be chosen: make bench BENCH=--quick
BENCH :=

bench: setup
	$(BIN)/python benchmarks/all.py $(BENCH)

# Damaged files for every reader and loader; minutes. `python fuzz/run.py --help` says what can be chosen, for example
# make fuzz FUZZ="--engine atheris --inputs 20000 --jobs 2", which is guided by coverage.
FUZZ := --inputs 1500 --jobs 2

fuzz: setup
	$(BIN)/python fuzz/run.py $(FUZZ)

# Build wheel and sdist, and run the demo from the installed wheel in a fresh environment.
wheel-demo:
	PYTHON=$(PYTHON) .ci/wheel_demo

# Write the versions of the current environment into constraints.txt.
constraints:
	$(BIN)/python -m pip freeze --exclude-editable --disable-pip-version-check > constraints.txt
