"""Figures of the learning itself: how a trial converges, and which moment goes with which tau.

Paper, figures of EPHE's convergence and of the rotation action.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from calibration.report_style import BLUE, MUTED, ORANGE, TRIGGER, new_figure
from onboard.arrays import FloatArray
from onboard.policy.action import action_moments
from onboard.policy.files import Policy
from perchhw.learning.example_data import Convergence
from perchhw.learning.results import columns
from perchhw.learning.sweep_folder import Row
from perchhw.report.rate_maps import GOOD_RATE, RATE_COLOURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

A_ROT_LABEL = r"$a_{Rot}$ (N mm, negative = nose up)"
_NEWTON_MILLIMETRE = 1e-3  # N m
_BINS = 12
_BAND = (10.0, 90.0)  # percentiles


def convergence(trial: Convergence) -> "Figure":
    """Rewards, tau_cr and a_rot over the rollouts of one trial, with mean and two sigma of each episode."""
    figure = new_figure(10.6, 3.5)
    panels = figure.subplots(1, 3)
    per_episode = trial.rewards.shape[1]
    rollout = np.arange(trial.rewards.size) + 1.0
    best = trial.best.ravel()
    moment = 1.0 / _NEWTON_MILLIMETRE
    series: tuple[tuple[FloatArray, str], ...] = (
        (trial.rewards.ravel(), "reward"),
        (trial.samples[..., 0].ravel(), r"$\tau_{cr}$ (s)"),
        (trial.samples[..., 1].ravel() * moment, A_ROT_LABEL),
    )
    for axes, (values, label) in zip(panels, series, strict=True):
        axes.plot(
            rollout[~best], values[~best], "o", ms=3.4, mfc="white", mec=MUTED, mew=0.8, label="other samples"
        )
        axes.plot(
            rollout[best],
            values[best],
            "o",
            ms=4,
            color=ORANGE,
            mec="white",
            mew=0.4,
            label="best of the episode",
        )
        axes.set(xlabel="rollout", ylabel=label)
    edges = np.arange(len(trial.mu)) * per_episode + 0.5
    edges = np.append(edges, edges[-1] + per_episode)
    means = trial.rewards.mean(axis=1)
    panels[0].stairs(means, edges[:-1], baseline=None, color=BLUE, lw=1.8, label="mean of the episode")
    panels[0].set_ylim(-0.03, 1.03)
    for k, scale in ((0, 1.0), (1, moment)):
        mu, sigma = trial.mu[:, k] * scale, np.abs(trial.sigma[:, k] * scale)
        axes = panels[k + 1]
        axes.stairs(
            mu + 2 * sigma,
            edges,
            baseline=mu - 2 * sigma,
            fill=True,
            color=BLUE,
            alpha=0.16,
            lw=0,
            label=r"$\mu \pm 2\sigma$",
        )
        axes.stairs(mu, edges, baseline=None, color=BLUE, lw=1.8, label=r"$\mu$")
    panels[2].invert_yaxis()
    panels[0].legend(fontsize=8, frameon=False, loc="lower right")
    panels[1].legend(*_only(panels[1], r"$\mu \pm 2\sigma$", r"$\mu$"), fontsize=8, frameon=False, loc="best")
    return figure


def _only(axes: "Axes", *labels: str) -> tuple[list[Any], list[str]]:
    """Handles and labels of a legend, of these only."""
    found = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    return [found[label] for label in labels], list(labels)


def moment_against_tau(
    pairs: tuple[Row, ...], policy: Policy | None, validation: tuple[Row, ...] | None
) -> "Figure":
    """a_rot of the pairs against their tau, with the policy's answer to the same cues; then the policy's own
    triggers. Colours are landing rates."""
    figure = new_figure(10.6, 3.9)
    own = None if validation is None else columns(validation, "tau", "a_rot", "landing_rate")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    cues = columns(pairs, "tau", "theta_x", "d_ceil", "a_rot", "landing_rate")
    dots = _scatter(left, cues[0], cues[3], cues[4])
    left.set_title("(a) sensory-motor pairs", loc="left", fontsize=10.5)
    if policy is not None:
        good = cues[4] >= GOOD_RATE
        answers = action_moments(policy.compiled(), np.column_stack(cues[:3])[good].astype(np.float32))
        _band(
            left,
            cues[0][good],
            np.asarray(answers, np.float64),
            "policy at the cues of pairs of 0.8 or more: median, 10 and 90 %",
        )
        left.legend(fontsize=8, loc="lower left", facecolor="white", edgecolor="none", framealpha=1.0)
    if own is not None:
        _scatter(right, *own)
    right.set_title("(b) two-stage policy, mean of each condition", loc="left", fontsize=10.5)
    left.set(xlabel=r"$\tau$ at the trigger (s)", ylabel=A_ROT_LABEL)
    right.set(xlabel=r"$\tau$ at the trigger (s)")
    left.invert_yaxis()
    figure.colorbar(dots, ax=[left, right], pad=0.01, label="landing rate")
    return figure


def _scatter(axes: "Axes", tau: FloatArray, a_rot: FloatArray, rate: FloatArray) -> Any:
    order = np.argsort(rate)
    return axes.scatter(
        tau[order], a_rot[order] / _NEWTON_MILLIMETRE, c=rate[order], s=13, cmap=RATE_COLOURS, vmin=0.0,
        vmax=1.0, edgecolors="white", linewidths=0.3, zorder=3,
    )  # fmt: skip


def _band(axes: "Axes", tau: FloatArray, a_rot: FloatArray, label: str) -> None:
    """Median and the middle 80 % of moments by tau, in bins of equal number."""
    order = np.argsort(tau)
    chunks = [c for c in np.array_split(order, min(_BINS, max(1, len(order) // 5))) if len(c)]
    middle = np.array([np.median(tau[c]) for c in chunks])
    low, mid, high = (
        np.array([np.percentile(a_rot[c], p) for c in chunks]) / _NEWTON_MILLIMETRE
        for p in (_BAND[0], 50, _BAND[1])
    )
    for edge in (low, high):
        axes.plot(middle, edge, color=TRIGGER, lw=1.2, ls="--", zorder=5)
    axes.plot(middle, mid, color=TRIGGER, lw=2, zorder=5, label=label)


def moment_correlation(pairs: tuple[Row, ...]) -> float | None:
    """Correlation of |a_rot| with tau over the pairs of 0.8 or more; None for fewer than three."""
    tau, a_rot, rate = columns(pairs, "tau", "a_rot", "landing_rate")
    good = rate >= GOOD_RATE
    if good.sum() < 3:
        return None
    return float(np.corrcoef(tau[good], np.abs(a_rot[good]))[0, 1])
