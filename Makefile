# The README's commands. Each makes or reuses .venv first: nothing to install by hand.
STAMP := .venv/.made-for-these-requirements

.PHONY: demo test test-page check clean
demo: $(STAMP)
	@.venv/bin/rig demo

test: $(STAMP)
	@tools/check

# The live page in a real Chromium, which has to be installed; says so if it is not. Pictures go to PAGE_PICTURES.
test-page: $(STAMP)
	@cd tests/page && ../../.venv/bin/python chromium.py && ../../.venv/bin/pytest -q -p no:cacheprovider live_page.py

# Static checks alone, for a quick look while editing.
check: $(STAMP)
	@tools/check static

$(STAMP): pyproject.toml constraints.txt tools/make-venv
	@tools/make-venv $(STAMP)

clean:
	rm -rf .venv .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
