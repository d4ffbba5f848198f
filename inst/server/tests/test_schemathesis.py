"""Schemathesis generates valid and invalid requests from the OpenAPI document.

``GYM_TEST_SCHEMA_CASES=5000``, which ``make soak`` sets, generates that many.
"""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
CASES = int(os.environ.get("GYM_TEST_SCHEMA_CASES", "0"))

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("schemathesis") is None,
    reason="schemathesis is not installed (the extra `dev` brings it)",
)


def run(server, folder, seed, *arguments):
    """Return the report of schemathesis, and the number of its cases."""
    result = subprocess.run(
        [
            *(sys.executable, "-c", "from schemathesis.cli import schemathesis; schemathesis()"),
            *("--config-file", HERE / "schemathesis_run" / "schemathesis.toml"),
            *("run", f"http://127.0.0.1:{server.port}/v1/openapi.json"),
            *("--checks", "all", "--seed", str(seed), "--request-timeout", "60"),
            # It would be the last request.
            *("--exclude-operation-id", "shutdown"),
            *arguments,
        ],
        cwd=folder,
        env={
            **os.environ,
            "SCHEMATHESIS_HOOKS": "schemathesis_run.hooks",
            "PYTHONPATH": os.pathsep.join([str(HERE), str(HERE.parent)]),
            "NO_COLOR": "1",
        },
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=1800,
    )
    assert result.returncode == 0, result.stdout
    return int(re.search(r"(\d+) generated", result.stdout)[1])


@pytest.mark.slow
def test_the_server_answers_as_its_document_says(serve, tmp_path, capsys):
    server = serve("--monitor-dir", str(tmp_path / "monitors"))
    cases, seed = 0, 1
    if not CASES:
        cases = run(server, tmp_path, seed, "--phases", "fuzzing,stateful", "-n", "4")
    while cases < CASES:
        cases += run(server, tmp_path, seed, "-n", "100")
        seed += 1
    if CASES:
        with capsys.disabled():
            print(f"\nschemathesis: {cases} cases, 0 failures")
    status, health = server.get("/v1/health/")
    assert (status, health["status"]) == (200, "ok")
    assert "Traceback" not in server.stop()[2]
