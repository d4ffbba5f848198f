"""The one thread that draws, and pictures as PNG."""
