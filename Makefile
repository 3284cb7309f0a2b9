# Two commands for a fresh machine with python3 and make:
#   make run    open the bundled figure (without a display: write its picture here)
#   make test   run all tests
# Others: make lint, make bench, make golden, make manual, make figure, make clean.

PYTHON ?= python3
VENV ?= .venv
WORKERS ?= auto
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: run test lint bench golden manual figure system clean

# A window may open even where pictures cannot be drawn without one: go on either way.
run: $(READY)
	@sh .ci/system "$(BIN)/python" || true
	@$(BIN)/viewer $(FILES)

# One process of tests per core (WORKERS=0 for none), each drawing with one thread: no test waits for
# the threads of another one's pictures.
test: $(READY) system
	@$(BIN)/ruff check viewer tests assets
	@$(BIN)/ruff format --check viewer tests assets
	@$(BIN)/mypy
	@LP_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile $(TESTS)

lint: $(READY)
	@$(BIN)/ruff check --fix viewer tests assets
	@$(BIN)/ruff format viewer tests assets
	@$(BIN)/mypy

bench: $(READY) system
	@$(BIN)/python tests/bench/run.py

golden: $(READY) system
	@VIEWER_UPDATE_GOLDEN=1 $(BIN)/python -m pytest -q tests/rendering tests/app

# Writes the reference tables of the manual anew, from the registries.
manual: $(READY)
	@$(BIN)/python tests/manual/reference.py

# Makes the bundled figures anew; they need scipy and scikit-image beside the rest.
figure: $(READY)
	@$(BIN)/pip install --quiet scipy scikit-image xatlas
	@$(BIN)/python assets/make_fox.py
	@$(BIN)/python assets/make_body.py

# The environment, made anew when the dependencies change.
$(READY): pyproject.toml
	@sh .ci/environment "$(PYTHON)" "$(VENV)"
	@touch $@

# OpenGL in software and the tools of the window tests, where they are missing.
system: $(READY)
	@sh .ci/system "$(BIN)/python"

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
