"""The Containerfile uses only options that the server has."""

import json
import re
from pathlib import Path

from gym_server.cli.options import parser

SERVER = Path(__file__).parents[2]


def test_its_entry_point_is_understood():
    text = (SERVER / "Containerfile").read_text().replace("\\\n", "")
    command = json.loads(re.search(r"^ENTRYPOINT (\[.*\])$", text, re.MULTILINE)[1])
    assert command[:3] == ["python", "-m", "gym_server"]
    options = parser().parse_args(command[3:])
    assert options.token_file


def test_what_it_copies_is_there():
    text = (SERVER / "Containerfile").read_text()
    for name in re.findall(r"^COPY (\S+)", text, re.MULTILINE):
        assert (SERVER / name).is_dir()
