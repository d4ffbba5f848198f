import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import SERVER


def run(*arguments, **options):
    return subprocess.run(
        [sys.executable, *arguments], cwd=SERVER, capture_output=True, text=True, **options
    )


def test_a_python_without_flask_says_so_in_one_line_and_ends_with_78(tmp_path):
    (tmp_path / "flask.py").write_text("raise ImportError(\"No module named 'flask'\")\n")
    refused = run("-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{_AS_MODULE}")
    assert refused.returncode == 78
    assert refused.stdout == ""
    assert refused.stderr.count("\n") == 1
    version = ".".join(map(str, sys.version_info[:3]))
    assert refused.stderr == (
        f"gym_server cannot run on this Python ({version}, {os.path.abspath(sys.executable)}): "
        "No module named 'flask'\n"
    )


def test_an_old_python_says_so_in_one_line_and_ends_with_78():
    refused = run("-c", f"import sys; sys.version_info = (3, 9, 2)\n{_AS_MODULE}")
    assert refused.returncode == 78
    assert refused.stderr.startswith("gym_server cannot run on this Python (3.9.2, ")
    assert refused.stderr.count("\n") == 1


_AS_MODULE = """
import runpy
sys.argv = ["gym_server", "--version"]
runpy.run_module("gym_server", run_name="__main__")
"""


@pytest.mark.parametrize("name", ["__init__.py", "__main__.py"])
def test_what_an_old_python_reads_it_can_parse(name):
    source = Path(SERVER, "gym_server", name).read_text()
    tree = ast.parse(source, feature_version=(3, 4))
    newer = (ast.JoinedStr, ast.AnnAssign, ast.NamedExpr, ast.AsyncFunctionDef)
    for node in ast.walk(tree):
        assert not isinstance(node, newer)
        if isinstance(node, ast.FunctionDef):
            assert node.returns is None
            assert all(argument.annotation is None for argument in node.args.args)
        if isinstance(node, ast.ImportFrom):
            assert node.module != "__future__"


def test_what_is_heavy_is_not_imported_at_the_start():
    loaded = run("-c", "import sys, gym_server.cli.main; print(*sys.modules)").stdout.split()
    assert not {"pygame", "moviepy", "PIL", "matplotlib", "cv2"} & set(loaded)
