"""The digital twin: recordings of a robot, with effects that the study does not declare."""

from ident.simulate.requests import EffectRequestError, parse_effect
from ident.simulate.sensors import Sensors
from ident.simulate.study import PlannedRun, SimulatedRecording, SimulatedStudy, simulate
from ident.simulate.writing import write_simulation

__all__ = [
    "EffectRequestError",
    "PlannedRun",
    "Sensors",
    "SimulatedRecording",
    "SimulatedStudy",
    "parse_effect",
    "simulate",
    "write_simulation",
]
