"""Run the server like ``-m gym_server``, with other values for constants of its modules.

So tests of long limits need not take long:

    serve_with_limits.py '{"gym_server.cli.main._GRACE_SECONDS": 1}' --port 0

Processes that the server starts have the original constants.
"""

import importlib
import json
import sys

from gym_server.__main__ import main

# The server's processes import this file, too.
if __name__ == "__main__":
    for name, value in json.loads(sys.argv.pop(1)).items():
        module, _, constant = name.rpartition(".")
        module = importlib.import_module(module)
        # Raises AttributeError for an unknown constant.
        getattr(module, constant)
        setattr(module, constant, value)
    main()
