"""Environments in their own processes."""
