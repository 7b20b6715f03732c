"""Trace what a fit leaves over to the physical effects that the model lacks.

rows -> candidates -> scoring -> (generic rival, events) -> state (refined together) -> loop -> diagnosis ->
document.
"""

from ident.diagnosis.diagnosis import Diagnosis, diagnose_study
from ident.diagnosis.findings import Finding, Unexplained

__all__ = ["Diagnosis", "Finding", "Unexplained", "diagnose_study"]
