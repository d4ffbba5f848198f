"""Processes of the server's own, and how it talks with them."""
