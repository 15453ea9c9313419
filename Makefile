# One environment, `.venv`, made on first use by whichever target runs first.
PYTHON ?= python3
BIN := .venv/bin

.PHONY: setup demo test lint bench constraints
setup: .venv/.ready

.venv/.ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable ".[dev]"
	@touch $@

demo: setup
	@mkdir -p out
	$(BIN)/reba info datasets/simulated_palletising.mcap
	$(BIN)/reba score datasets/simulated_palletising.mcap --load 8 --coupling fair -o out/palletising.parquet --report out/palletising.html
	$(BIN)/reba improve datasets/simulated_palletising.mcap --load 8 --coupling fair
	@echo "Open out/palletising.html in a browser."

test: setup
	$(BIN)/python -m pytest -n 2

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: setup
	@mkdir -p out
	$(BIN)/python benchmarks/scoring.py --json out/scoring.json
	$(BIN)/python benchmarks/reading.py --json out/reading.json
	$(BIN)/python benchmarks/whole_command.py --json out/whole_command.json

# Write the versions of the current environment into constraints.txt.
constraints:
	$(BIN)/python -m pip freeze --exclude-editable --disable-pip-version-check > constraints.txt
