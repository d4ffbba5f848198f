"""The command line: options, and what the process does before and after serving."""
