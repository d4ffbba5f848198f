"""Processes that the server starts, and the messages between it and them."""
