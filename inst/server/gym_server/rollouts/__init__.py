"""Whole episodes, played by policies that are data, in processes of the pool."""
