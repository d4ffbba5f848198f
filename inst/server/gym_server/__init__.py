"""Gymnasium environments over HTTP: the protocol of openai/gym-http-api, and more."""

import os

# SDL reads these when an environment first imports pygame. The server draws off screen, so it needs
# no display. (This file and __main__.py must parse on any Python, because __main__.py reports one
# that is too old.)
os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
os.environ.setdefault("SDL_AUDIODRIVER", "dummy")
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")

__version__ = "1.0.0"
