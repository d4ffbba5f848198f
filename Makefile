# make demo and make test work on a fresh machine. tools/setup says what they install, and where.

.PHONY: help demo pages bench test test-all soak check lint coverage document site clean
.NOTPARALLEL:

# R reads and writes UTF-8 only if the locale says so, and a bare container has no locale.
ifeq ($(LC_ALL)$(LC_CTYPE)$(LANG),)
ifeq ($(shell uname -s),Linux)
export LANG = C.UTF-8
endif
endif

help:
	@echo 'make demo      solve CartPole from R, print the result, draw it into pictures/'
	@echo 'make pages     build the vignettes and install them with the package; two minutes'
	@echo 'make bench     measure steps a second, and compare with reticulate, the classic client and'
	@echo '               Python; half an hour. QUICK=1 is shorter, PARTS="wire" runs one part,'
	@echo '               PARTS=gradients compares PPO with Stable-Baselines3 in some hours'
	@echo 'make test      test the main promises: of the server (pytest) and of the R package'
	@echo '               (testthat); three minutes'
	@echo 'make test-all  run every test of both'
	@echo 'make soak      run the long tests: crowds, faults, fuzzing, half an hour of use; two hours.'
	@echo '               QUICK=1 is shorter, PARTS="clients cuts" runs two parts'
	@echo 'make check     R CMD build and R CMD check, in a temporary folder'
	@echo 'make lint      lint R (lintr, layers), Python (ruff, import-linter, mypy) and spelling'
	@echo 'make coverage  list the files that every test together reaches least; an hour'
	@echo 'make site      build the site (pkgdown) in site/ and check its links; ten minutes'
	@echo 'make document  make man/ and NAMESPACE from the comments in R/ (roxygen2)'
	@echo 'make clean     remove everything that these made'
	@echo
	@echo 'Each first installs what is missing: on Debian and Ubuntu R and Python by apt, everything'
	@echo 'else into .venv/ and .r-library/. GYM_PYTHON=... names another Python.'

demo:
	@tools/setup demo
	@tools/in-env Rscript --no-init-file tools/demo.R

pages:
	@tools/setup pages
	@tools/in-env Rscript --no-init-file tools/pages.R

bench:
	@tools/setup bench
	@tools/in-env Rscript --no-init-file tools/bench.R $(if $(QUICK),quick) $(PARTS)

test:
	@tools/setup test
	@tools/in-env tools/test

test-all:
	@tools/setup test sb3
	@tools/in-env tools/test all

soak:
	@tools/setup test
	@tools/in-env .venv/bin/python tools/soak.py $(if $(QUICK),--quick) \
	  $(if $(SECONDS),--seconds $(SECONDS)) $(PARTS)

check:
	@tools/setup check
	@tools/in-env Rscript --no-init-file tools/check.R

lint:
	@tools/setup lint
	@tools/in-env tools/lint

coverage:
	@tools/setup coverage
	@tools/in-env tools/coverage

document:
	@tools/setup document
	@tools/in-env Rscript --no-init-file -e 'roxygen2::roxygenise()'

site:
	@tools/setup site
	@tools/in-env Rscript --no-init-file tools/site.R

clean:
	rm -rf .venv .r-library .cran-library pictures site gym.Rcheck gym_*.tar.gz
	find inst -name __pycache__ -prune -exec rm -rf {} +
	rm -rf inst/server/.pytest_cache inst/server/.ruff_cache inst/server/.mypy_cache
