"""All environments of a server: their list, limits and ends."""
