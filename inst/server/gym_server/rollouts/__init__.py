"""Whole episodes, played by policies that are sent as data, in processes of the pool."""
