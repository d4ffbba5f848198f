"""What one thread can do about another that is stuck."""
