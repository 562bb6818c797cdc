"""The report of one run: a page that shows how the approach, the trigger and the landing went."""

from html import escape
from pathlib import Path
from typing import Any

from calibration.flights import Flight, UnusableFlightError
from calibration.flights.perchhw_run import flight_from_run
from calibration.flights.run_folder import RunRecord, read_run
from perchhw.attempt import Outcome
from perchhw.report import figures
from perchhw.report.style import badge, grid, page, report_style, section, table

REPORT_FILE = "report.html"

_TRIGGER_UNITS = {
    "tau": ("s", 1.0),
    "theta_x": ("1/s", 1.0),
    "d_ceil": ("m", 1.0),
    "trigger_value": ("", 1.0),
    "a_rot": ("N mm", 1e3),
    "vx": ("m/s", 1.0),
    "vy": ("m/s", 1.0),
    "vz": ("m/s", 1.0),
    "z": ("m", 1.0),
    "pitch": ("deg", 57.29577951308232),
}


def write_run_report(run_folder: Path) -> Path:
    """Write ``report.html`` into the run folder; one file that loads nothing from elsewhere.

    Raises:
        RunFolderError: the record cannot be read.
    """
    run = read_run(run_folder)
    path = run_folder / REPORT_FILE
    with report_style():
        path.write_text(_page(run), encoding="utf-8")
    return path


def _page(run: RunRecord) -> str:
    config, info = run.config, run.info
    speed, angle = config.get("speed_m_s"), config.get("angle_deg")
    title = "Landing attempt" if speed is None else f"Landing attempt: {speed:g} m/s at {angle:g} deg"
    body = section("Outcome", _facts(run), "; ".join(run.torn))
    try:
        flight = flight_from_run(run)
    except UnusableFlightError as error:
        body += section("Flight", escape(str(error)))
        return page(title, _subtitle(run), body)
    body += _figures(flight, config.get("ceiling_z"))
    evidence = info.get("evidence")
    if evidence:
        body += section("Evidence of the label", _evidence(evidence))
    return page(title, _subtitle(run), body + section("Events", _events(run)))


def _subtitle(run: RunRecord) -> str:
    return f"{run.folder.name}, started {run.info.get('started_utc', 'at an unknown time')}"


def _facts(run: RunRecord) -> str:
    info, config = run.info, run.config
    outcome = info.get("outcome")
    rows = [["outcome", badge(Outcome(outcome) if outcome in tuple(Outcome) else None)]]
    for name in ("aborted_by", "error"):
        if info.get(name):
            rows.append([name.replace("_", " "), escape(str(info[name]))])
    for sentence in info.get("accepted_mismatches") or ():
        rows.append(["mismatch, accepted", escape(str(sentence))])
    for sentence in config.get("not_compared") or ():
        rows.append(["not compared", escape(str(sentence))])
    for name in (
        "operator",
        "note",
        "drone",
        "mocap",
        "vehicle",
        "legs",
        "policy",
        "policy_crc32",
        "ceiling_z",
        "seed",
    ):
        if config.get(name) is not None:
            rows.append([name.replace("_", " "), escape(str(config[name]))])
    facts = table(["", ""], rows)
    trigger = info.get("trigger")
    return facts + (f"<h2 style='margin-top:14px'>At the trigger</h2>{_trigger(trigger)}" if trigger else "")


def _trigger(trigger: dict[str, Any]) -> str:
    shown = [(n, *_TRIGGER_UNITS[n]) for n in _TRIGGER_UNITS if isinstance(trigger.get(n), int | float)]
    header = [f"{name} ({unit})" if unit else name for name, unit, _ in shown]
    return table(header, [[f"{trigger[name] * scale:.3f}" for name, _, scale in shown]])


def _figures(flight: Flight, ceiling_z: float | None) -> str:
    side = figures.side_view(flight, ceiling_z)
    body = "" if side is None else section("Side view", side, "Strokes: fore-aft axis, dot at the nose.")
    panels = [
        ("Towards the trigger", figures.cues_over_time(flight)),
        ("Optical-flow space", figures.optical_flow_path(flight)),
        ("Rates during the flip", figures.rates_in_flip(flight)),
        ("Battery", figures.battery(flight)),
    ]
    return body + grid([section(title, drawing) for title, drawing in panels if drawing is not None])


def _evidence(evidence: dict[str, Any]) -> str:
    flat: list[list[str]] = []
    for name, value in evidence.items():
        if isinstance(value, dict):
            flat += [[escape(f"{name}: {k}"), escape(_short(v))] for k, v in value.items()]
        else:
            flat.append([escape(name), escape(_short(value))])
    return table(["", ""], flat)


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _events(run: RunRecord) -> str:
    start = run.info.get("clock_at_start", 0.0)
    rows = []
    for event in run.events:
        rest = {k: v for k, v in event.items() if k not in ("t", "event") and v is not None}
        words = ", ".join(f"{k} {_short(v)}" for k, v in rest.items() if not isinstance(v, dict | list))
        rows.append([f"{event['t'] - start:.3f}", escape(str(event["event"])), escape(words[:200])])
    return table(["s", "event", ""], rows)
