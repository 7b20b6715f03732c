"""What a fit leaves over, traced to effects that the model lacks, by one criterion.

opening -> rows/ -> evidence/ -> search/, loads/ -> loop -> weighed_again, left_over -> extended/ -> telling/
-> diagnosis -> document"""

from ident.diagnosis.diagnosis import Diagnosis, diagnose_study
from ident.diagnosis.telling.findings import Alternative, Finding, Unexplained

__all__ = ["Alternative", "Diagnosis", "Finding", "Unexplained", "diagnose_study"]
