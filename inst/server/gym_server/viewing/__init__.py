"""What people who watch an environment see."""
