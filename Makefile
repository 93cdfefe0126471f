# make demo, make test, make test-quick, make test-rounding, make lint, make bench, make docs,
# make site, make mutants, make faults: each does all the set-up it needs.
# make calculix: a ccx that can load material libraries, into bubblefit's own cache folder.
# Needs Python 3.11 or newer (PYTHON=...) and make; everything else goes into .venv/.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# Retries leave room for a busy registry.
BENCHMARKS := $(wildcard benchmarks/*.py)
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --retries 5

.PHONY: demo test test-quick test-rounding lint bench docs site mutants faults calculix clean
.DELETE_ON_ERROR:

demo: $(READY)
	$(BIN)/bubblefit bubble examples/bubble-known-solution/project.toml --out out/demo --overwrite

# Without a ccx, its test decks, gfortran or a browser the tests that need one are left out, except in CI.
# Three processes keep two cores busy, as tests wait for programs, time limits and downloads.
test: $(READY)
	@[ -n "$$BUBBLEFIT_CCX" ] || sh .ci/calculix || [ -z "$$CI" ]
	@sh .ci/decks || [ -z "$$CI" ]
	@sh .ci/gfortran || [ -z "$$CI" ]
	@sh .ci/chromium || [ -z "$$CI" ]
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 3 --dist worksteal

# What a developer runs on every change: two minutes on two cores, without slow tests (tests/slow.py).
test-quick: $(READY)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -q -n 2 --dist worksteal -m "not slow"

# Golden and published numbers with other roundings than this processor's: kernels for any, numpy
# and BLAS without its vector units, data disturbed in their last digits.
test-rounding: $(READY)
	BIN=$(BIN) sh .ci/rounding

lint: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	MYPYPATH=$(VENV)/typing $(BIN)/mypy -p bubblefit
	MYPYPATH=$(VENV)/typing:benchmarks:tests $(BIN)/mypy $(BENCHMARKS:benchmarks/%.py=-m %)
	$(BIN)/python .ci/licences.py
	$(BIN)/python docs/make_site.py

bench: $(READY)
	@for script in benchmarks/bench_*.py; do echo "== $$script"; $(BIN)/python $$script || exit 1; done

# Faults that once escaped all tests, put into a copy one by one: does a test fail? Some minutes.
faults: $(READY)
	$(BIN)/python tests/faults

# Pages of the Python interface, from the docstrings.
docs: $(READY)
	$(BIN)/python docs/make_api.py

# The documents as a site, out/site/index.html; a link that leads nowhere is an error.
site: $(READY)
	$(BIN)/python docs/make_site.py

# Small faults that cosmic-ray puts into a copy of the code, and which of them no test notices: all,
# or CHANGED=1 (or =COMMIT) of the files that changed, MINUTES=5 at most, NUMBER=100 drawn by
# SEED=2, FILES="runs/folder.py", ALSO="tests/commands" beside the tests near a file.
mutants: $(READY)
	$(BIN)/python -m tests.mutants $(if $(CHANGED),--changed $(CHANGED)) \
	    $(if $(MINUTES),--minutes $(MINUTES)) $(if $(NUMBER),--number $(NUMBER)) \
	    $(if $(SEED),--seed $(SEED)) $(foreach test,$(ALSO),--also $(test)) $(FILES)

calculix:
	@sh .ci/calculix

# The link tells mypy that this folder, whatever its name, is the package bubblefit.
$(READY): pyproject.toml .ci/venv
	@PYTHON="$(PYTHON)" VENV="$(VENV)" sh .ci/venv
	$(PIP) --editable '.[dev]'
	@mkdir -p $(VENV)/typing && ln -sfn ../.. $(VENV)/typing/bubblefit
	@touch $@

clean:
	rm -rf $(VENV) out/demo out/site build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
