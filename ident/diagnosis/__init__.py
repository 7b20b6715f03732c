"""What a fit leaves over, traced to effects that the model lacks, by one criterion.

opening -> rows, fine -> state (whitened, turn_over) -> candidates, events -> refine -> evidence, nameless
-> loop -> diagnosis"""

from ident.diagnosis.diagnosis import Diagnosis, diagnose_study
from ident.diagnosis.findings import Alternative, Finding, Unexplained

__all__ = ["Alternative", "Diagnosis", "Finding", "Unexplained", "diagnose_study"]
