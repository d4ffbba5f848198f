"""The command line: its options, and what the process does before and after it serves."""
