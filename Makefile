# `make run` flies, `make test` checks, `make docs` writes the book into out/docs, `make bench`
# times, `make hostile` attacks for some hours. Each makes what it needs in .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: run test docs bench hostile clean

run: $(VENV)/run.stamp
	$(BIN)/fullam run task-2 --controller dc-pid --seed 0 --out out/task-2.npz --figure out/task-2.png

test: $(VENV)/test.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q -n auto --maxprocesses 4 --dist loadfile

docs: $(VENV)/docs.stamp
	$(BIN)/python notebooks/book/build.py

bench: $(VENV)/bench.stamp
	$(BIN)/python -m pytest -q benchmarks

hostile: $(VENV)/test.stamp
	$(BIN)/python tests/hostile/lowest.py
	$(BIN)/python tests/hostile/run.py

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/test.stamp: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	touch $@

$(VENV)/docs.stamp: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $@

$(VENV)/bench.stamp: $(BIN)/python pyproject.toml
	$(BIN)/python -m pip install --quiet --editable '.[test,bench]'
	touch $@

clean:
	rm -rf $(VENV) out
