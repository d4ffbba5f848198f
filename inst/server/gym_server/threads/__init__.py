"""What one thread does to another one that is stuck."""
