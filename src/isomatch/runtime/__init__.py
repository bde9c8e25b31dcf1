"""How work is run: threads, worker processes, interruption, limits of the system, stages and their progress."""
