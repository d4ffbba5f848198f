"""Processes that the server starts, and its messages to and from them."""
