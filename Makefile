# Everything runs in .venv, which the first target makes; nothing outside it is touched.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
RESULTS := .cache/results

.PHONY: run test lint types contracts suite slow clean
.DEFAULT_GOAL := run

$(READY): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "nat-bench needs Python 3.11 or newer; name one with: make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable ".[cluster,matlab,onnx,openvino,train,video]" --group dev
	@touch $@

# The headline on the bundled sample night_mini with the bundled weights, ending in the table.
run: $(READY)
	$(BIN)/nat-bench run --tracker siamrpnpp --enhancer none --enhancer ldenhancer --results $(RESULTS)

test: lint types contracts suite

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(READY)
	$(BIN)/mypy

contracts: $(READY)
	$(BIN)/lint-imports
	$(BIN)/deptry nat2024 trackers enhancers reports

suite: $(READY)
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal

# What takes long and changes seldom: yardsticks of the benchmarks, ResNet-50, whole measurements.
slow: $(READY)
	$(BIN)/python -m pytest --numprocesses 2 --dist worksteal -m slow

clean:
	rm -rf $(VENV) .cache build dist
