"""One environment on the server: its lock, episodes, resets and steps."""
