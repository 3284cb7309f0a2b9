# Two commands for a fresh machine with python3 and make:
#   make run    open the bundled figure (without a display: write its picture here)
#   make test   run all tests
#   make quick  run the tests that do not draw, start programs or compute for long: about a minute
# Others: make lint, make house, make record TO=FOLDER, make bench, make golden [NAME...],
# make notebooks, make manual, make gallery, make figure, make clean.

PYTHON ?= python3
VENV ?= .venv
CORES := $(shell getconf _NPROCESSORS_ONLN)
WORKERS ?= $(shell expr $(CORES) + 1)
BIN := $(VENV)/bin
READY := $(VENV)/.ready

# One test process per core and one more, as some tests wait (WORKERS=0 for a single process). Each
# computes and draws with one thread, so that no test waits for the threads of another one. Compiled
# files make the next start much faster.
TESTING := PYTHONDONTWRITEBYTECODE= LP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest

# Words after `golden` are names of pictures, not targets.
ifeq ($(firstword $(MAKECMDGOALS)),golden)
PICTURES := $(wordlist 2,$(words $(MAKECMDGOALS)),$(MAKECMDGOALS))
.PHONY: $(PICTURES)
$(PICTURES): ; @:
endif

.PHONY: run test suite quick lint style types house record compiled bench golden manual gallery
.PHONY: notebooks figure system clean

# A window may open even if pictures cannot be drawn without one, so failures are ignored here.
# Compiled files are kept, so that only the first start takes long.
run: $(READY)
	@sh .ci/system "$(BIN)/python" || true
	@PYTHONDONTWRITEBYTECODE= $(BIN)/viewer $(FILES)

# Types are checked while the tests run, as mypy uses only one core.
test: $(READY)
	@$(MAKE) --no-print-directory --jobs=4 style types suite

suite: system compiled
	@VIEWER_TEST_BUDGET=300 $(TESTING) -n $(WORKERS) --dist worksteal $(TESTS)

# A test that draws nevertheless fails, because it finds no OpenGL. None of these tests waits, so
# there is one process per core.
quick: $(READY)
	@__EGL_VENDOR_LIBRARY_DIRS=/nonexistent DISPLAY= VIEWER_TEST_BUDGET=60 \
		$(TESTING) -n $(CORES) --dist worksteal -m "not slow" $(TESTS)

lint: $(READY)
	@$(BIN)/ruff check --fix viewer tests assets
	@$(BIN)/ruff format viewer tests assets
	@$(BIN)/mypy

style: $(READY)
	@$(BIN)/ruff check viewer tests assets
	@$(BIN)/ruff format --check viewer tests assets

# In CI, the next run has a fresh checkout and would not find the cache. mypy turns the garbage
# collector on after loading, which would take a fifth of the time; without, it needs 2 GB of memory
# instead of 0.6 GB, while the tests need theirs: not on machines with less than 6 GB.
types: $(READY)
	@$(BIN)/python -c 'import gc, os; from mypy.__main__ import console_entry; \
		bytes = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"); \
		gc.enable = gc.disable if bytes > 6e9 else gc.enable; \
		console_entry()' $(if $(CI),--cache-dir=/dev/null)

# Sizes of the tree, beside those of the last tag.
house: $(READY)
	@$(BIN)/python tests/house.py

# What the program says and writes for many files, to be compared with that of another version.
record: $(READY)
	@$(BIN)/python tests/record.py $(or $(TO),$(error type make record TO=FOLDER))

# The tests compile every module: if one process has done so before, each of the others needs 10 s
# less. Failures here are ignored, as they recur and are reported in the tests.
compiled: $(READY)
	@$(TESTING) --collect-only --quiet $(TESTS) >/dev/null 2>&1 || true

bench: $(READY) system
	@$(BIN)/python tests/bench/run.py

golden: $(READY) system
	@VIEWER_UPDATE_GOLDEN="$(or $(PICTURES),all)" $(TESTING) -q tests/rendering tests/app

# Executes the notebooks of viewer/examples, and stores them with their outputs.
notebooks: $(READY)
	@$(BIN)/python tests/notebooks.py $(NAMES)

# Regenerates the reference tables of the manual from the registries.
manual: $(READY)
	@$(BIN)/python tests/manual/reference.py

# Redraws the pictures of README and manual from bundled data.
gallery: $(READY) system
	@$(BIN)/python assets/make_gallery.py

# Rebuilds the bundled figures and the studio, which also need scipy and scikit-image.
figure: $(READY)
	@$(BIN)/pip install --quiet scipy scikit-image xatlas
	@$(BIN)/python assets/make_fox.py
	@$(BIN)/python assets/make_body.py
	@$(BIN)/python assets/make_studio.py

# The environment, rebuilt when the dependencies change.
$(READY): pyproject.toml
	@sh .ci/environment "$(PYTHON)" "$(VENV)"
	@touch $@

# Installs software OpenGL and the tools of the window tests if they are missing.
system: $(READY)
	@sh .ci/system "$(BIN)/python"

clean:
	rm -rf $(VENV) build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
