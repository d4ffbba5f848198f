"""Runs the server as ``-m gym_server`` does, with constants of its modules set to other values.

So a test of what takes long does not take long itself:

    serve_with_limits.py '{"gym_server.cli.main._GRACE_SECONDS": 1}' --port 0

The processes that the server starts have the constants as they are.
"""

import importlib
import json
import sys

from gym_server.__main__ import main

# Those processes import this file as well.
if __name__ == "__main__":
    for name, value in json.loads(sys.argv.pop(1)).items():
        module, _, constant = name.rpartition(".")
        module = importlib.import_module(module)
        # An AttributeError for a constant that there is not.
        getattr(module, constant)
        setattr(module, constant, value)
    main()
