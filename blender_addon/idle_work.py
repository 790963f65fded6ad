"""What a timer does in the moments between the user's events: one generator at a time."""

import time


class IdleWork:
    """What is under way, of which nothing outlives the file.

    A subclass adds what it remembers in `forget`.

    Attributes
    ----------
    job : generator
        None where nothing is under way.
    """

    def __init__(self):
        self.job = None
        self.forget()

    def forget(self):
        """All that is remembered is as in a new file."""

    def stop(self):
        """Drop what is under way."""
        if self.job is not None:
            self.job.close()
        self.job = None

    def another_file(self):
        """Nothing that is to be done outlives the file."""
        self.stop()
        self.forget()

    def go_on(self, seconds):
        """As much of the job as fits into so many seconds; whether it came to its end."""
        end = time.perf_counter() + seconds
        try:
            while self.job is not None and time.perf_counter() < end:
                next(self.job)
        except StopIteration:
            self.job = None
            return True
        return False
