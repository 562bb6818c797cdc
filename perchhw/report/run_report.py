"""The report of one run: a page that shows how the approach, the trigger and the landing went."""

import logging
from contextlib import suppress
from datetime import datetime
from html import escape
from pathlib import Path
from typing import Any

from calibration.flights import Flight, UnusableFlightError
from calibration.flights.perchhw_run import flight_from_run
from calibration.report_style import grid, page, report_style, section, table
from onboard.atomic_file import write_atomically
from onboard.errors import PerchhwError
from onboard.record.folder import OutputFolderError
from onboard.record.run_record import RunRecord, is_run_folder
from perchhw.attempt import Outcome
from perchhw.diagnosis.diagnose import diagnose_run, judge_of
from perchhw.diagnosis.finding import Diagnosis
from perchhw.record.event_words import time_line
from perchhw.record.flown import known_vehicle_of
from perchhw.record.run import read_run
from perchhw.report import figures
from perchhw.report.flight_figures import phases, power, tracking, trigger_region
from perchhw.report.flight_picture import flight_picture, instants
from perchhw.report.outcome_style import badge

_log = logging.getLogger(__name__)

REPORT_FILE = "report.html"

_NAMED = {"policy_crc32": "policy CRC"}
"""Keys of the configuration that a person would not say so."""

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
        OutputFolderError: the folder cannot be written.
    """
    write_run_page(read_run(run_folder))
    return run_folder / REPORT_FILE


def write_run_page(run: RunRecord) -> Diagnosis:
    """As :func:`write_run_report`, of a record that was already read; gives what the page says.

    Raises:
        OutputFolderError: the folder cannot be written.
    """
    found = diagnose_run(run)
    with report_style():
        text = _page(run, found)
    try:
        write_atomically(run.folder / REPORT_FILE, text)
    except OSError as error:
        raise OutputFolderError(run.folder, error.strerror) from error
    return found


def has_current_page(run_folder: Path) -> bool:
    """Whether the run folder has a page that was written after all else in it."""
    page = run_folder / REPORT_FILE
    if not page.is_file():
        return False
    written = page.stat().st_mtime_ns
    return all(file.stat().st_mtime_ns <= written for file in run_folder.iterdir() if file.is_file())


def report_flight(run_folder: Path) -> Path | None:
    """The report of a flight that has just ended; what it fails of costs no result. No record: none."""
    if not is_run_folder(run_folder):
        return None
    try:
        return write_run_report(run_folder)
    except PerchhwError as error:
        _log.error("no report of %s: %s", run_folder, error)
        return None


def _page(run: RunRecord, found: Diagnosis) -> str:
    config, info = run.config, run.info
    speed, angle = config.get("speed_m_s"), config.get("angle_deg")
    title = "Landing attempt" if speed is None else f"Landing attempt: {speed:g} m/s at {angle:g} deg"
    if config.get("flight"):
        title = f"Test flight: {config['flight']}"
    body = section("What happened", _said(run, found), "; ".join(run.torn))
    try:
        flight = flight_from_run(run)
    except UnusableFlightError as error:
        body += section("Flight", escape(str(error)))
    else:
        body += _figures(run, flight, found)
    body += section("Time line", (phases(run) or "") + _events(run))
    body += section("What was flown", _facts(run))
    if evidence := info.get("evidence"):
        body += section("Evidence of the label", _folded("show", _evidence(evidence)))
    return page(title, _subtitle(run), body)


def _said(run: RunRecord, found: Diagnosis) -> str:
    """The outcome, the diagnosis, and what to do next."""
    outcome = run.info.get("outcome")
    shown = badge(Outcome(outcome) if outcome in tuple(Outcome) else outcome)
    said = f'<p class="said">{shown} {escape(found.sentence)}.</p><p><b>Next:</b> {escape(found.next)}.</p>'
    numbers = [[escape(name), escape(_short(value))] for name, value in found.values.items()]
    return said + (_folded("the numbers behind it", table(["", ""], numbers)) if numbers else "")


def _folded(title: str, content: str) -> str:
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def _subtitle(run: RunRecord) -> str:
    started = str(run.info.get("started_utc", "at an unknown time"))
    with suppress(ValueError):  # the record is shown as it is
        started = f"{datetime.fromisoformat(started):%Y-%m-%d %H:%M:%S} UTC"
    return f"{run.folder.name}, started {started}"


def _facts(run: RunRecord) -> str:
    info, config = run.info, run.config
    rows = []
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
        "seed",
    ):
        if config.get(name) is not None:
            rows.append([_NAMED.get(name, name), escape(str(config[name]))])
    if isinstance(ceiling := config.get("ceiling_z"), int | float):
        rows.append(["ceiling", f"{ceiling:.3f} m"])
    facts = table(["", ""], rows)
    trigger = info.get("trigger")
    return facts + (f"<h2 style='margin-top:14px'>At the trigger</h2>{_trigger(trigger)}" if trigger else "")


def _trigger(trigger: dict[str, Any]) -> str:
    shown = [(n, *_TRIGGER_UNITS[n]) for n in _TRIGGER_UNITS if isinstance(trigger.get(n), int | float)]
    header = [f"{name} ({unit})" if unit else name for name, unit, _ in shown]
    return table(header, [[f"{trigger[name] * scale:.3f}" for name, _, scale in shown]])


def _figures(run: RunRecord, flight: Flight, found: Diagnosis) -> str:
    touch = found.values.get("touch_after_s")
    touch_t = None if flight.trigger is None or not isinstance(touch, float) else flight.trigger.t + touch
    picture = flight_picture(flight, known_vehicle_of(run), touch_t)
    body = "" if picture is None else section("The flight", picture, _legend(flight, touch_t))
    panels = [
        ("Cues against the trigger region", trigger_region(flight, judge_of(run).region)),
        ("Towards the trigger", figures.cues_over_time(flight)),
        ("Tracking", tracking(flight, run.config.get("approach"))),
        ("Body rates" if flight.trigger is None else "Rates during the flip", figures.rates_in_flip(flight)),
        ("Thrust and battery", power(flight)),
    ]
    return body + grid([section(title, drawing) for title, drawing in panels if drawing is not None])


def _legend(flight: Flight, touch_t: float | None) -> str:
    shown = enumerate(instants(flight, touch_t), start=1)
    words = ", ".join(f"{number} {instant.words}" for number, instant in shown)
    return f"{words}. The drone is drawn to scale from its side; its fore legs are the thick ones."


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
    rows = [[f'<span class="n">{t:.2f}</span>', escape(words)] for t, words in time_line(run)]
    return table(["s", "what happened"], rows)
