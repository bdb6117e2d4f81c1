"""A share that was counted, with its interval."""

from dataclasses import dataclass

from scipy.stats import binomtest


@dataclass(frozen=True)
class Proportion:
    """So many of so many, and the 95 % interval of Clopper and Pearson (1934) for the share."""

    count: int
    total: int

    @property
    def share(self) -> float:
        """count / total."""
        return self.count / self.total

    @property
    def interval(self) -> tuple[float, float]:
        """It covers the true share with probability 95 % at least."""
        interval = binomtest(self.count, self.total).proportion_ci(0.95, method="exact")
        return float(interval.low), float(interval.high)
