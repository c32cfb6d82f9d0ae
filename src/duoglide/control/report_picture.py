"""The picture of a run's report: following error and lateness over time, and its notebook table."""

from __future__ import annotations

from matplotlib.axes import Axes

from duoglide.control.report import RunReport
from duoglide.drawing.notebook import notebook_html
from duoglide.drawing.over_time import draw_curves, draw_key, finish
from duoglide.drawing.picture import COLOURS, LIMIT, Picture, drawn
from duoglide.storage.records import EventKind

_MARKED = (EventKind.FAULT, EventKind.EMERGENCY, EventKind.TIMEOUT, EventKind.QUICK_STOP)


def plot(report: RunReport, size: tuple[float, float] = (7.0, 4.2)) -> Picture:
    """Draw ``report``: see ``RunReport.plot``."""
    history = report.history
    with drawn(size) as figure:
        error, late = figure.subplots(2, 1, sharex=True, height_ratios=(1.4, 1.0))
        draw_curves(error, history.times, history.following_error * 1e3)
        error.set_title(f"Following error [µm]{_worst_of(history.cycles)}")
        draw_key(error)
        late.plot(history.times, history.lateness, color=COLOURS[0], linewidth=0.9)
        late.set_title(f"Lateness [µs]{_worst_of(history.cycles)}")
        for axes in (error, late):
            axes.set_ylim(bottom=0.0)
            _mark_faults(axes, report)
        finish((error, late), "time from the first cycle [s]")
    return figure


def report_html(report: RunReport) -> str:
    """Return what a notebook shows of a report."""
    late = report.lateness
    head = [
        ("end", report.ending),
        ("duration", f"{report.duration:.3f} s"),
        ("cycles", f"{report.cycles}, {report.skipped} left out"),
        (
            "lateness",
            f"median {late.median:.0f} µs, 99 % {late.p99:.0f} µs, worst {late.worst:.0f} µs",
        ),
        ("feedback late or lost", f"{report.lost} frames"),
        *(("fault", trip.words) for trip in report.faults),
        ("log", str(report.log) if report.log is not None else "none"),
    ]
    names = ("velocity", "acceleration", "jerk")
    axes = [
        ("carriage", "1", "2", "3"),
        ("worst following error", *(f"{value:.3f} mm" for value in report.following_error)),
        *(
            (f"plan's use of {name}", *(f"{100.0 * share:.1f} %" for share in row))
            for name, row in zip(names, report.limit_use, strict=True)
        ),
    ]
    figure = plot(report, (5.4, 3.2)) if len(report.history.times) else None
    return notebook_html("Run", [head, axes], figure)


def _worst_of(cycles: int) -> str:
    return f", worst of every {cycles} cycles" if cycles > 1 else ""


def _mark_faults(axes: Axes, report: RunReport) -> None:
    """Draw a line where something stopped the run; times of events are on the monotonic clock."""
    for time, event in report.events:
        if event.kind in _MARKED:
            axes.axvline(time - report.history.start, color=LIMIT, linestyle=":", linewidth=1.0)
