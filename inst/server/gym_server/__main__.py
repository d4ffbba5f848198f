"""Start the server, or say in one line why this Python cannot run it.

The line and exit status 78 (EX_CONFIG) tell a caller that is looking for a suitable Python, such
as the R package, to try the next one. This file must therefore parse on any Python, even 2.7.
"""

import sys

CANNOT_RUN_HERE = 78


def refuse(reason):
    """Print why this Python cannot run the server, and exit with status 78."""
    version = ".".join(str(part) for part in sys.version_info[:3])
    sys.stderr.write(
        "gym_server cannot run on this Python (%s, %s): %s\n" % (version, sys.executable, reason)
    )
    sys.exit(CANNOT_RUN_HERE)


def main():
    """Run the command line and exit."""
    if sys.version_info < (3, 10):
        refuse("Python 3.10 or newer is needed")
    try:
        from gym_server.cli.main import main as serve
    except ImportError as error:
        refuse(error)
    sys.exit(serve())


if __name__ == "__main__":
    main()
