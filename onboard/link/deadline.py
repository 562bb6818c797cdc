"""A deadline for many questions: the longer an answer takes, the longer all of them may."""

SLACK = 4.0
"""The questions may take so many times as long as one after the other, each for the mean time."""


class GrowingDeadline:
    """When to give up.

    Args:
        began: start [s].
        least_s: time that is allowed whatever is measured [s].
    """

    def __init__(self, began: float, least_s: float) -> None:
        self.began = began
        self._least = least_s
        self._expected = self._answered = 0
        self._taken = 0.0

    def expect(self, questions: int) -> None:
        """So many more answers are wanted."""
        self._expected += questions

    def answered(self, seconds: float) -> None:
        """One has come, after so long [s]: repetitions of its question included."""
        self._answered += 1
        self._taken += seconds

    @property
    def at(self) -> float:
        """The deadline as of now [s]."""
        if self._answered == 0:
            return self.began + self._least
        mean = self._taken / self._answered
        return self.began + self._least + SLACK * mean * self._expected
