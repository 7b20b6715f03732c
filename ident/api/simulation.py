"""`ident.simulate`: recordings of a digital twin as tables, with effects that its study does not declare."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Integral
from pathlib import Path
from typing import Any

from ident.api.study import Recording, Study
from ident.api.tables import frame
from ident.errors import IdentError, one_family
from ident.progress import watched
from ident.twin.study import LOADED_RUNS, RUNS, SimulatedStudy
from ident.twin.study import simulate as simulated


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Simulation:
    """Recordings of a robot, the study that a user would write about them, and apart from both the truth."""

    result: SimulatedStudy

    @property
    def recordings(self) -> dict[str, Any]:
        """Label -> table of t, q1.., tau_m1.. and/or tau_l1.."""
        return {its.label: frame(its.columns) for its in self.result.recordings}

    @property
    def truth(self) -> Mapping[str, Any]:
        """What the study hides."""
        return self.result.truth

    @property
    def study(self) -> Study:
        """The study with its recordings in memory: `ident.fit` and `ident.diagnose` take it."""
        keys = {key: value for key, value in self.result.study.items() if key != "recordings"}
        robot = self.result.robot_file
        keys |= {"robot": str(robot.resolve())} if robot is not None else {}
        runs = [
            Recording(dict(its.columns), its.use, name=its.label, payload=its.payload)
            for its in self.result.recordings
        ]
        return Study(recordings=runs, **keys)

    def save(self, folder: str | Path, overwrite: bool = False) -> Path:
        """Recordings, study.yaml and truth.json, as the command writes them; returns the study's path."""
        from ident.twin.writing import write_simulation

        with one_family():
            return write_simulation(self.result, Path(folder), overwrite)

    def summary(self) -> str:
        """The runs: label, use, payload, seconds, samples."""
        from ident.report.summary import text_table

        return f"{self.result.robot.name}\n{text_table(*self.table())}"

    def table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Header and rows of the runs."""
        rows: list[tuple[str, ...]] = []
        for its in self.result.recordings:
            t = its.columns["t"]
            rows.append((its.label, its.use, its.payload or "", f"{t[-1] - t[0]:.0f}", str(len(t))))
        return ("recording", "use", "payload", "seconds", "samples"), rows

    def __str__(self) -> str:
        return self.summary()

    def __repr__(self) -> str:
        return f"Simulation({self.result.robot.name}, {len(self.result.recordings)} recordings)"

    def _repr_html_(self) -> str:
        from ident.report.page import Cell, Column, Table
        from ident.report.render import render_table

        header, rows = self.table()
        cells = tuple(tuple(Cell(text) for text in row) for row in rows)
        return render_table(Table(self.result.robot.name, tuple(Column(name) for name in header), cells))


def simulate(
    robot: str | Path,
    model: str = "A",
    effects: Sequence[Any] | str = (),
    *,
    payload: float | None = None,
    duration: float | None = None,
    rate_hz: float | None = None,
    noise: float | None = None,
    seed: int = 0,
    parameters: str | Path | None = None,
    exact: bool = False,
    progress: Callable[..., Any] | bool | None = None,
) -> Simulation:
    """Simulate a robot (built-in name, robot file or URDF) whose study does not declare `effects`.

    effects: "NAME:JOINT[:param=value,...]" each, or a mapping {"effect": NAME, "joint": JOINT, ...}. payload:
    mass [kg] carried in a further run. duration [s] of every run; rate_hz of the recorder; noise of the
    torques in percent of their rms; exact: a URDF's angles and lengths as they are written. The same
    arguments give the same numbers. Raises ident.Error.
    """
    if isinstance(seed, bool) or not isinstance(seed, Integral) or seed < 0:
        raise IdentError(f"seed is {seed!r}; give a whole number from 0 on")
    runs = RUNS + (LOADED_RUNS if payload is not None else ())
    if duration is not None:
        _check("duration", duration, 5, 86400, "seconds")
        runs = tuple(_as_long_as(run, float(duration)) for run in runs)
    from ident.twin.sensors import Sensors

    sensors = Sensors()
    if rate_hz is not None:
        _check("rate_hz", rate_hz, 20, 20000, "Hz")
        sensors = replace(sensors, rate_hz=float(rate_hz))
    if noise is not None:
        _check("noise", noise, 0, 100, "percent of a torque's rms")
        floor = sensors.noise_floor if noise else 0.0
        sensors = replace(sensors, noise_percent=float(noise), noise_floor=floor)
    wanted = tuple(_request(item) for item in ([effects] if isinstance(effects, str) else effects))
    with one_family(), watched(progress) as tell:
        made = simulated(
            robot if isinstance(robot, Path) else str(robot),
            model,
            wanted,
            payload,
            seed,
            Path(parameters) if parameters is not None else None,
            sensors=sensors,
            runs=runs,
            progress=tell,
            exact=exact,
        )
        return Simulation(made)


def _check(name: str, value: Any, low: float, high: float, unit: str) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise IdentError(f"{name} is {value!r}; give a number of {unit}")
    if not low <= value <= high:
        raise IdentError(f"{name} is {value:g}; give {low:g} to {high:g} {unit}")


def _as_long_as(run: Any, duration: float) -> Any:
    """The same kind of motion with as many points a second."""
    points = max(3, round(run.points * duration / run.duration)) if run.points else 0
    return replace(run, duration=duration, points=points)


def _request(item: Any) -> Any:
    """An effect as a line or as a mapping."""
    if isinstance(item, str) or (isinstance(item, Mapping) and "effect" in item):
        return item
    raise IdentError(f"effects: {item!r} is no effect; write 'stribeck_friction:4' or a mapping with effect:")
