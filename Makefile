# `make run` flies, `make test` checks, `make docs` writes the book into out/docs, `make bench`
# times, `make hostile` attacks for some hours, `make test-all` checks with every Python that fullam
# is made for and that is on this machine. Each makes what it needs in .venv, test-all in .venv-3.11
# and so on.
PYTHON ?= python3
PYTHONS := 3.11 3.12 3.13
VENV := .venv
BIN := $(VENV)/bin

.PHONY: run test test-all docs bench hostile clean

run: $(VENV)/run.stamp
	$(BIN)/fullam run task-2 --controller dc-pid --seed 0 --out out/task-2.npz --figure out/task-2.png

test: $(VENV)/test.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q -n auto --maxprocesses 4 --dist loadfile

# An interpreter is one on the PATH that starts (a shim of pyenv may not), or one of pyenv's own.
test-all:
	@tested=; failed=; for v in $(PYTHONS); do \
	  python=$$(command -v python$$v); \
	  "$${python:-false}" -c '' 2> /dev/null || python=$$(ls -d \
	    "$${PYENV_ROOT:-$$HOME/.pyenv}"/versions/$$v.*/bin/python$$v 2> /dev/null | tail -n 1); \
	  if [ -z "$$python" ]; then echo "Python $$v: not on this machine, not tested"; continue; fi; \
	  echo "Python $$v: $$python"; tested="$$tested $$v"; \
	  $(MAKE) --no-print-directory test VENV=.venv-$$v PYTHON="$$python" || failed="$$failed $$v"; \
	done; \
	echo "tested with Python:$${tested:- none}; failed:$${failed:- none}"; \
	[ -n "$$tested" ] && [ -z "$$failed" ]

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
	rm -rf $(VENV) $(PYTHONS:%=.venv-%) out
