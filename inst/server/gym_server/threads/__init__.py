"""What the threads are doing in environments, and the lock of each."""
