import subprocess
import sys

import pytest

resource = pytest.importorskip("resource", reason="this system has no such limits")

PROGRAM = """
import resource
from gym_server.cli.open_files import allow_many_open_files
resource.setrlimit(resource.RLIMIT_NOFILE, ({soft}, {hard}))
allow_many_open_files()
print(*resource.getrlimit(resource.RLIMIT_NOFILE))
"""


@pytest.mark.parametrize(
    ("soft", "hard", "then"), [(256, 2000, 2000), (300, 300, 300), (2000, 2000, 2000)]
)
def test_the_limit_is_raised_as_far_as_is_allowed(soft, hard, then):
    # In a process of its own, because the limit cannot be raised again.
    words = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(soft=soft, hard=hard)],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert words.split() == [str(then), str(hard)]
