import sys

import pytest
from conftest import SERVER

from gym_server.envs.extras import REQUIREMENTS


@pytest.mark.skipif(sys.version_info < (3, 11), reason="tomllib came with Python 3.11")
def test_the_hints_name_what_the_package_declares():
    import tomllib

    project = tomllib.loads((SERVER / "pyproject.toml").read_text())["project"]
    declared = project["optional-dependencies"]
    for extra, requirements in REQUIREMENTS.items():
        assert [name.partition(">")[0] for name in declared[extra]] == list(requirements)
    together = declared["all"][0]
    assert all(extra in together for extra in REQUIREMENTS)
