"""Run the long tests part by part, and print a table.

    make soak                    everything, about two hours
    make soak QUICK=1            a short version of each part
    make soak SECONDS=60         parts with a duration take this long
    make soak PARTS="cuts idle"  some of the parts

A part is a command that prints a line "PART: figures" (or several, such as "PART-json: ...") and
fails by its exit status. GYM_SOAK_SERVER has options for the servers of clients, soak and idle,
such as "--max-processes 4".
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

TOP = Path(__file__).resolve().parents[1]
SOAK = TOP / "tools" / "soak"
SERVER = TOP / "inst" / "server"


class Part(NamedTuple):
    """One part.

    Attributes:
        command: the command.
        where: the folder to run it in.
        variables: additional environment variables.
        is_here: whether it can run here.
    """

    command: list[str]
    where: Path = TOP
    variables: dict[str, str] | None = None
    is_here: bool = True


def python(name: str, *arguments: object) -> Part:
    """Return a part that is a Python script."""
    script = SOAK / f"{name}.py"
    return Part([sys.executable, str(script), *map(str, arguments)], is_here=script.exists())


def r(name: str, *arguments: object) -> Part:
    """Return a part that is an R script."""
    script = SOAK / f"{name}.R"
    command = ["Rscript", "--no-init-file", str(script), *map(str, arguments)]
    return Part(command, is_here=script.exists())


def pytest(test: str, **variables: object) -> Part:
    """Return a part that runs tests of the server in their long version."""
    how = ("-q", "--color=no", "-p", "no:cacheprovider")
    return Part(
        [sys.executable, "-m", "pytest", *how, *test.split()],
        SERVER,
        {name: str(value) for name, value in variables.items()},
    )


def testthat(name: str, **variables: object) -> Part:
    """Return a part that runs a test file of the package in its long version."""
    test = (
        "library(testthat); library(gym); "
        f"test_file('tests/testthat/test-{name}.R', package = 'gym', "
        "load_package = 'installed', reporter = 'check', stop_on_failure = TRUE)"
    )
    return Part(
        ["Rscript", "--no-init-file", "-e", test],
        TOP,
        {"NOT_CRAN": "true", **{name: str(value) for name, value in variables.items()}},
    )


def parts(quick: bool, seconds: float | None) -> dict[str, Part]:
    """Return the parts by name."""

    def lasting(long: float, short: float) -> float:
        return seconds or (short if quick else long)

    fuzz = lasting(600, 10)
    return {
        "clients": python("clients", 32, 8_000 if quick else 200_000),
        "fuzz": pytest("tests/test_fuzz.py", GYM_TEST_FUZZ_SECONDS=fuzz),
        "fuzz-r": r("fuzz", fuzz),
        "cuts": pytest("tests/test_cuts.py", GYM_TEST_CUTS="all"),
        "cuts-r": testthat("cuts", GYM_TEST_CUTS="some" if quick else "all"),
        "kill-server": r("kill-server", 5 if quick else 50),
        "kill-r": r("kill-r", 3 if quick else 20),
        "idle": python("idle", 1000),
        "os-exit": pytest("tests/processes/test_worker_process.py"),
        "drawing": pytest("tests/test_drawing.py", GYM_TEST_DRAWING="all"),
        "environments": pytest(
            "tests/test_environments.py tests/rollouts/test_kept_environments.py",
            GYM_TEST_ENVIRONMENTS="all",
        ),
        "parity": testthat("parity", GYM_TEST_PARITY="all"),
        "policies": testthat("policy-on-server", GYM_TEST_POLICIES="all"),
        "orders": testthat("train-orders", GYM_TEST_ORDERS=1000),
        "spaces": testthat("round-trips", GYM_TEST_SPACES=300),
        "futures": testthat("play-futures", GYM_TEST_ALL="true", GYM_TEST_FUTURES="all"),
        "hosts": testthat("hosts", GYM_TEST_ALL="true", GYM_TEST_HOSTS="all"),
        "book": testthat("book-articles", GYM_TEST_BOOK="all"),
        "tables": testthat("learn-table", GYM_TEST_TABLES="all"),
        "coverage": r("coverage", 2000, lasting(7200, 60)),
        "soak": python("soak", lasting(1800, 60)),
    }


def run(name: str, part: Part) -> tuple[str, list[str]]:
    """Run a part; return the result and its figures."""
    if not part.is_here:
        return "MISSING", []
    process = subprocess.Popen(
        part.command,
        cwd=part.where,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **(part.variables or {})},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    figures = []
    tests = ""
    for line in process.stdout:
        print(line, end="", flush=True)
        if found := re.match(rf"{name}[-\w]*: (.*)", line):
            figures.append(found[1])
        elif re.match(r"\d+ (passed|failed|skipped|error)\b.* in [\d.]+s", line):
            tests = line.strip()
    # A skipped test proves nothing.
    held = process.wait() == 0 and (not tests or "passed" in tests)
    return "held" if held else "FAILED", figures or [tests]


def main() -> int:
    """Run the requested parts; return the exit status."""
    options = argparse.ArgumentParser()
    options.add_argument("--quick", action="store_true")
    options.add_argument("--seconds", type=float)
    options.add_argument("parts", nargs="*")
    asked = options.parse_args()
    known = parts(asked.quick, asked.seconds)
    unknown = set(asked.parts) - set(known)
    if unknown:
        options.error(f"no such parts: {', '.join(unknown)}; there are {', '.join(known)}")
    rows = []
    for name in asked.parts or known:
        print(f"\n######## {name}", flush=True)
        began = time.monotonic()
        outcome, figures = run(name, known[name])
        rows.append((name, outcome, f"{time.monotonic() - began:.0f} s", "; ".join(figures)))
    print("\n| part | outcome | took | figures |\n|---|---|---:|---|")
    for row in rows:
        print(f"| {' | '.join(row)} |")
    return int(any(outcome != "held" for _, outcome, *_ in rows))


if __name__ == "__main__":
    sys.exit(main())
