# The README's commands. Each makes or reuses .venv first: nothing to install by hand.
STAMP := .venv/.made-for-these-requirements

.PHONY: demo test test-all test-peers test-kernels test-page check nights mutants figures campaigns figure bench docs clean
demo: $(STAMP)
	@.venv/bin/rig demo --loop

test: $(STAMP)
	@tools/check

# With the tests of tests/long.txt too, which take as long as all others together: before a release.
test-all: $(STAMP)
	@tools/check all

# Our drivers and twins against clients and servers that others wrote; a part of `make test` as well.
test-peers: $(STAMP)
	@.venv/bin/pytest -q -p no:cacheprovider tests/peers

# The tests under each kernel of the linear algebra that this processor can run, since each rounds otherwise: before a
# release.
test-kernels: $(STAMP)
	@tools/kernels

# The live page in a real Chromium, which has to be installed; says so if it is not. Pictures go to PAGE_PICTURES; AXE may
# name the axe.min.js of axe-core, which then finds no barrier on any page.
test-page: $(STAMP)
	@cd tests/page && ../../.venv/bin/python chromium.py && ../../.venv/bin/pytest -q -p no:cacheprovider live_page.py serve_page.py new_page.py people_page.py drift_page.py

# What the tests do a bounded share of, in full: nights, crash points, power cuts, real kills. Hours.
nights: $(STAMP)
	.venv/bin/rig night --seeds 5000
	.venv/bin/rig night --seeds 10 --full
	.venv/bin/python -m proving.night.planted_bugs
	for part in points folded log file; do .venv/bin/python -m proving crashes $$part || exit 1; done
	.venv/bin/python -m proving crashes power-cuts --seeds 50
	.venv/bin/python -m proving crashes kills --only attitude --seeds 67
	.venv/bin/python -m proving crashes kills --only pressure --seeds 17

# Lines of the engine, the run file and the statistics changed one by one: do the tests notice? An hour.
mutants: $(STAMP)
	@tools/mutants

# The figures of proving/notes/figures.md that carry their commit: times and memories (half an hour), a bounded share of each
# campaign (an hour or two), or one of them: `make figure NAME`.
figures: $(STAMP)
	@.venv/bin/python -m benchmarks.figures

campaigns: $(STAMP)
	@.venv/bin/python -m benchmarks.figures --campaigns

figure: $(STAMP)
	@.venv/bin/python -m benchmarks.figures $(NAMED)

ifeq (figure,$(firstword $(MAKECMDGOALS)))
NAMED := $(filter-out figure,$(MAKECMDGOALS))
.PHONY: $(NAMED)
$(NAMED):
	@:
endif

# Ratios against peers and physical limits beside the last ones on this kind of machine, and what made a loss.
bench: $(STAMP)
	@.venv/bin/python -m benchmarks.ledger

# The site of the documents, in build/docs; a minute, and the first time it installs Sphinx.
docs: $(STAMP)
	@tools/docs

# Static checks alone, for a quick look while editing.
check: $(STAMP)
	@tools/check static

$(STAMP): pyproject.toml constraints.txt locks/run.txt locks/build.txt locks/make.txt locks/schematron.txt tools/make-venv
	@tools/make-venv $(STAMP)

clean:
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
