"""The bench walk-through: a drone that is not as its file says, measured on the bench, flies better after."""

from perchhw.walkthrough.bench.walkthrough import BenchWalkthrough, run_bench_walkthrough

__all__ = ["BenchWalkthrough", "run_bench_walkthrough"]
