"""The command line: its options, and what it does before and after it serves."""
