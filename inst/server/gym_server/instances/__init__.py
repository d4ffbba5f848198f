"""One environment on the server: its lock, its episodes, its resets and steps."""
