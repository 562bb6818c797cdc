"""Examples for a report of learning: one trial of the sweep once more, and one attempt of the policy."""

import math
from pathlib import Path

import numpy as np

from calibration.flights import Flight, PoseSource, Trigger
from calibration.flights.flight import POSE_CHANNELS, finite_masks
from calibration.flights.perchhw_run import load_run
from onboard.arrays import FloatArray
from onboard.errors import InputError
from onboard.policy.files import Policy
from onboard.policy.trigger import trigger_values
from perchhw.learning.bands import best_per_condition
from perchhw.learning.ephe import MOMENT_SCALE, TAU_SCALE, sample
from perchhw.learning.errors import LearningInputError
from perchhw.learning.example_data import Convergence, Examples
from perchhw.learning.grid import Condition, generator
from perchhw.learning.one_trial import run_trial
from perchhw.learning.results import LearningResults
from perchhw.learning.reward import reward
from perchhw.learning.setup import LearningSetup, recorded_setup
from perchhw.learning.sweep_folder import Row
from perchhw.learning.trial import fly, new_bench

_PURPOSE = 3
_PERIOD = 0.01  # s, of the samples
_TRUE_CHANNELS = ("vx", "vy", "vz", "gx", "gy", "gz", "legs_attached", "body_contact")
_UNITS = np.array([1.0 / TAU_SCALE, MOMENT_SCALE])
"""From the units of EPHE to s and N m."""


def make_examples(
    results: LearningResults, condition: Condition | None, repeat: int, run: Path | None
) -> Examples:
    """The examples of a folder: what cannot be made is left out with its reason.

    Args:
        results: the folder.
        condition: of the examples; None for one from the middle of the grid.
        repeat: which trial of it.
        run: run folder of a flown approach; None for a simulated one.

    Raises:
        RunFolderError, UnusableFlightError: the run cannot be used.
        LearningInputError: it has no cues.
    """
    shown = condition or typical_condition(results)
    flight = None if run is None else _flown(run)
    try:
        setup = recorded_setup(results.settings, str(results.folder))
    except InputError as error:
        return Examples(flight=flight, doubts=(f"no trial and no approach are simulated: {error}",))
    key = (shown.speed, shown.angle_deg, repeat)
    row = next((r for r in results.pairs if (r["speed_m_s"], r["angle_deg"], r["trial"]) == key), None)
    if flight is None and results.policy is not None:
        flight = example_flight(results.policy, setup, shown)
    trial = example_trial(setup, shown, repeat, row) if results.pairs else None
    return Examples(trial=trial, flight=flight)


def _flown(run: Path) -> Flight:
    flight = load_run(run)
    if not flight.has("tau", "theta_x", "d_ceil"):
        raise LearningInputError(f"{run}: has no cues (topic `cues`): give the run of a flown approach")
    return flight


def typical_condition(results: LearningResults) -> Condition:
    """The condition of a sweep, or else of a validation, nearest to 2.5 m/s and 45 deg."""
    rates = best_per_condition(results.pairs or results.validation or ())
    return min(rates, key=lambda c: abs(c.speed - 2.5) / 0.1 + abs(c.angle_deg - 45.0) / 3.75)


def example_trial(setup: LearningSetup, condition: Condition, repeat: int, row: Row | None) -> Convergence:
    """Learn one pair again.

    Args:
        setup: of the sweep.
        condition: of the approach. repeat: which of its trials.
        row: that trial in the sweep's table, to compare with; None where the sweep has none.
    """
    parameters, rules = setup.load()
    ephe = rules.ephe
    whole = run_trial(parameters, rules, setup.seed, condition, repeat)
    record, episodes = whole.record, int(whole.record["episodes"])
    samples = np.empty((episodes * ephe.rollouts, 2))
    for k in range(len(samples)):
        # The same random numbers up to rollout k: its sample comes next.
        before = run_trial(parameters, rules, setup.seed, condition, repeat, stop=k)
        samples[k] = sample(before.rng, before.record["mu"], before.record["sigma"], ephe)
    rewards = np.array([reward(out, rules.reward) for out in whole.bench.outs[: len(samples)]])
    rewards = rewards.reshape(episodes, ephe.rollouts)
    order = np.argsort(-rewards, axis=1, kind="stable")[:, : ephe.best]
    best = np.zeros(rewards.shape, np.bool_)
    np.put_along_axis(best, order, True, axis=1)
    return Convergence(
        condition=condition,
        repeat=repeat,
        mu=_history(record, "mu", episodes),
        sigma=_history(record, "sigma", episodes),
        samples=samples.reshape(episodes, ephe.rollouts, 2) * _UNITS,
        rewards=rewards,
        best=best,
        landing_rate=float(record["landing_rate"]),
        converged=bool(record["converged"]),
        as_recorded=row is not None
        and row["mu_tau"] == record["mu"][0]
        and row["reward"] == record["reward"],
    )


def _history(record: np.void, name: str, episodes: int) -> FloatArray:
    """(episodes + 1, 2) of the distribution, the final one last, in s and N m."""
    values: FloatArray = np.vstack([record[f"{name}_history"][:episodes], record[name]]) * np.abs(_UNITS)
    return values * np.sign(_UNITS) if name == "mu" else values


def example_flight(policy: Policy, setup: LearningSetup, condition: Condition) -> Flight:
    """Fly one attempt of a policy in the simulation, sampled at 100 Hz until it has come to rest.

    Motion, feet and cues are the true ones; the trigger's snapshot is what the policy saw.

    Args:
        policy: two-stage policy.
        setup: vehicle, randomisation, sensing and seed.
        condition: of the approach.
    """
    parameters, rules = setup.load()
    compiled, angle = policy.compiled(), math.radians(condition.angle_deg)
    bench = new_bench(parameters, 1)

    def fly_until(seconds: float) -> None:
        """The same attempt every time, ended early: its state at that moment stays in the bench."""
        ended = rules._replace(rollout=rules.rollout._replace(at_most=seconds))
        fly(generator(setup.seed, _PURPOSE, condition), bench, 0, compiled, condition.speed, angle, ended)

    fly_until(rules.rollout.at_most)
    whole = bench.outs[0].copy()
    rows = []
    for moment in np.arange(0.0, whole["duration"], _PERIOD):
        fly_until(float(moment))
        state = bench.state[0]
        motion = (*state["position"], *state["quaternion"], *state["velocity"], *state["omega"])
        rows.append([state["time"], *motion, state["foot_attached"].sum(), state["body_contact"]])
    t, *columns = np.array(rows, dtype=np.float64).T.copy()
    data = dict(zip((*POSE_CHANNELS, *_TRUE_CHANNELS), columns, strict=True))
    data |= _cues(policy, data, setup.ceiling_z)
    trigger = None
    if whole["triggered"]:
        seen = {name: float(whole[name]) for name in ("tau", "theta_x", "d_ceil", "a_rot")}
        trigger = Trigger(float(whole["trigger_time"]), seen)
    return Flight(
        name=f"{condition.speed:g} m/s at {condition.angle_deg:g} deg, simulated",
        source=Path("simulation"),
        format="simulation",
        pose_source=PoseSource.TRUTH,
        t=t,
        data=data,
        valid=finite_masks(data),
        trigger=trigger,
        commanded_speed=condition.speed,
        commanded_angle_deg=condition.angle_deg,
        ceiling_z=setup.ceiling_z,
    )


def _cues(policy: Policy, data: dict[str, FloatArray], ceiling_z: float) -> dict[str, FloatArray]:
    """The cues and the trigger value at every sample; NaN while the vehicle does not climb."""
    d_ceil = ceiling_z - data["z"]
    climbing = (data["vz"] > 0.0) & (d_ceil > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        tau = np.where(climbing, d_ceil / data["vz"], np.nan)
        theta_x = np.where(climbing, data["vx"] / d_ceil, np.nan)
    states = np.column_stack([tau, theta_x, d_ceil]).astype(np.float32)
    values = np.asarray(trigger_values(policy.compiled(), states), np.float64)
    return {"tau": tau, "theta_x": theta_x, "d_ceil": d_ceil, "trigger_value": values}
