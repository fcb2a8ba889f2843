.PHONY: test check format bench docs wheel integrations

test:          ## all tests
	python -m pytest

check:         ## the checks of CI other than the tests
	.ci/check

format:        ## format the code and apply ruff's fixes
	ruff check --fix .
	ruff format .

bench:         ## print the ratios of speed and memory
	python benchmarks/run.py

docs:          ## rewrite the generated docs and pictures
	python docs/build.py

wheel:         ## the wheel that pip installs
	python -m pip wheel --no-deps --wheel-dir dist .

integrations:  ## run the integrations in their real frameworks, each in its own environment
	python tests/frameworks/run.py
