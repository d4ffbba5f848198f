"""Run lines of Python, one after another in one namespace, and print the compared values.

Standard input: a JSON list of objects with "python" and "compared". Standard output: a JSON list of
one flat list of numbers or strings for each compared line.
"""

import contextlib
import json
import os
import sys

import numpy as np


def flat(value: object) -> list:
    """Return a value as a flat list."""
    return [value] if isinstance(value, str) else np.ravel(value).tolist()


def main() -> None:
    """Run the lines of standard input."""
    place: dict = {}
    values = []
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        for line in json.load(sys.stdin):
            if line["compared"]:
                values.append(flat(eval(line["python"], place)))
            else:
                exec(line["python"], place)
    json.dump(values, sys.stdout)


main()
