# Two commands do all set-up: `make demo` and `make test`. Everything is installed into .venv.
PYTHON ?= python3
VENV   ?= .venv
BIN     = $(VENV)/bin

.PHONY: demo test long reliability lint regenerate bench docs notebooks picture clean

demo: $(VENV)/.installed
	$(BIN)/ident demo

TEST = $(BIN)/python -m pytest -n logical --maxprocesses 4 --dist worksteal

test: $(VENV)/.installed-test
	$(TEST)

# All of them: also those that look a second time at what another test asks, on measured robots.
long: $(VENV)/.installed-test
	$(TEST) --long

lint: $(VENV)/.installed-dev
	$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

regenerate: $(VENV)/.installed
	$(BIN)/regenerate-model kuka_lwr4p

bench: $(VENV)/.installed-test
	$(BIN)/python benchmarks/regressor_speed.py

# Mutated robot files, studies, recordings, command lines, kills; N="--robots 20000 --kills 0" says how many.
reliability: $(VENV)/.installed-test
	$(BIN)/python -m tests.reliability $(N)

docs: $(VENV)/.installed-dev
	$(BIN)/python docs/pages.py build/docs

notebooks: $(VENV)/.installed-test
	$(BIN)/python -m pytest --long tests/test_notebooks.py

# Modules are compiled when they are first imported: compiling all of them took half a minute. The pip that
# comes with Python 3.11 takes half as long again as today's to choose among the versions of 140 packages.
PIP = $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(PIP) --upgrade pip

$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(PIP) -e .
	touch $@

$(VENV)/.installed-test: pyproject.toml | $(BIN)/python
	$(PIP) -e '.[test]'
	touch $(VENV)/.installed $@

$(VENV)/.installed-dev: pyproject.toml | $(BIN)/python
	$(PIP) -e '.[dev]'
	touch $(VENV)/.installed $(VENV)/.installed-test $@

picture: $(VENV)/.installed
	$(BIN)/ident demo -o build/demo
	mkdir -p notebooks/images && cp build/demo/results/plots/1_*.svg notebooks/images/residual.svg

clean:
	rm -rf $(VENV) build *.egg-info
