.PHONY: test check format bench docs wheel

test:          ## all tests
	python -m pytest

check:         ## what CI checks beside the tests
	.ci/check

format:        ## put the code in shape
	ruff check --fix .
	ruff format .

bench:         ## ratios of speed and memory
	python benchmarks/run.py

docs:          ## the generated pages of docs/ and the pictures
	python docs/build.py

wheel:         ## what pip installs
	python -m pip wheel --no-deps --wheel-dir dist .
