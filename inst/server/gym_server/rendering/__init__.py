"""The thread that draws, and pictures as PNG."""
