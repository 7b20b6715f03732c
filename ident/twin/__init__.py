"""The digital twin: recordings of a robot, with effects that the study does not declare."""

from ident.twin.requests import EffectRequestError, parse_effect
from ident.twin.sensors import Sensors
from ident.twin.study import PlannedRun, SimulatedRecording, SimulatedStudy, simulate
from ident.twin.writing import write_simulation

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
