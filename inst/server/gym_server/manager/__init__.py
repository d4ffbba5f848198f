"""All environments of a server: their list, their limits, and their ends."""
