# make demo | make test | make lint | make docs | make conformance | make bench | make extension | make release; everything lives in .venv
PYTHON ?= $(shell command -v python3.11 || command -v python3.13 || echo python3)
VENV ?= .venv
RUN = $(VENV)/bin/python

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml scripts/setup.sh
	PYTHON=$(PYTHON) sh scripts/setup.sh $(VENV)
	touch $@

demo: $(VENV)/.ready
	$(RUN) scripts/demo.py

# Files of tests side by side, as many as there are cores, but not more than four: each has a Blender.
JOBS ?= $(shell n=$$(nproc 2>/dev/null || echo 2); [ $$n -lt 4 ] && echo $$n || echo 4)
test: $(VENV)/.ready
	$(RUN) -m pytest -n $(JOBS) --dist loadfile --no-loadscope-reorder

lint: $(VENV)/.ready
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .

# Speed, memory and error tables into docs/benchmarks; the Cycles truth takes hours the first time.
bench: $(VENV)/.ready
	$(RUN) tests/benchmarks/results.py

# The documentation as a site, tutorials and reference included, into build/docs.
docs: $(VENV)/.ready
	$(VENV)/bin/pip install -q -e ".[docs]"
	$(RUN) -m sphinx -W --keep-going -q docs build/docs
	@echo "docs: build/docs/index.html"

# The extension's zips, one a platform and Python, into build/; PLATFORMS=linux-x64 PYTHONS=3.11 for
# one, TOGETHER=1 for one a platform that holds all Pythons.
extension: $(VENV)/.ready
	$(RUN) scripts/build_extension.py $(if $(PLATFORMS),--platforms $(PLATFORMS)) $(if $(PYTHONS),--pythons $(PYTHONS)) $(if $(TOGETHER),--together)

# All that is given away, into build/release: wheel, archive, zips, bills of materials, checksums.
release: $(VENV)/.ready
	$(VENV)/bin/pip install -q -e ".[release]"
	$(RUN) scripts/release.py

# Every conformance scene against Cycles, as a table; make conformance SCENES="lamps text" for some.
conformance: $(VENV)/.ready
	$(RUN) -m tests.conformance.run $(SCENES)

# The extension in real windows: make test-window BLENDER="command" (several, separated by ':').
test-window: $(VENV)/.ready
	BLENDER="$(BLENDER)" $(RUN) -m pytest tests/window

# The demo as a web page in headless Chromium (apt-get install chromium, or CHROMIUM=path).
test-web: $(VENV)/.ready
	$(RUN) -m pytest -s tests/web

# How the add-on feels in a window, into docs/benchmarks; BLENDER as for test-window.
bench-window: $(VENV)/.ready
	BLENDER="$(BLENDER)" $(RUN) tests/benchmarks/window.py

# What .glb files are to others: Khronos' validator, three.js and a headless browser (needs npm).
engines: $(VENV)/.ready
	cd tests/engines && npm install --no-audit --no-fund --no-package-lock
	$(RUN) -m pytest tests/engines

# The tests on every supported Blender: bpy 4.2, 4.5, 5.0 (Python 3.11) and 5.2 (Python 3.13).
matrix:
	sh scripts/matrix.sh

clean:
	rm -rf $(VENV) .venv-* demo_output build

.PHONY: setup demo test lint docs conformance bench extension engines release test-window test-web bench-window matrix clean
