"""Gymnasium environments over HTTP: the protocol of openai/gym-http-api, and more."""

import os

# SDL reads these when pygame is first imported, which an environment may do at any time;
# the server draws off screen, also on a machine without a display.
# (This file and __main__.py must parse on any Python: __main__.py prints where it is too old.)
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("SDL_AUDIODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")

__version__ = "1.0.0"
