"""What one thread can do about another one that is stuck."""
