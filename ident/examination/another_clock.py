"""The clock of one recording beside those of the others: t in another unit, or one that runs at another rate.

Rates and accelerations go with the stamps, positions and torques do not: that a log of 5 kHz in ms is one of
5 Hz in s only the others say. (Of a TX40's judged run in ms another robot or another load was told.)
"""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

from ident.examination.changed import Changed
from ident.examination.clock import UNITS
from ident.examination.quick import Assignment, Quick
from ident.examination.stretches import Explained
from ident.examination.units import times_too

RATES = np.geomspace(1 / 40, 40, 21)
FINER, TIMES = 7, 3  # of them between the neighbours of the best one, so often


def clocks(how: Assignment, whole: Quick) -> Iterator[Changed]:
    """Each recording's stamps in each unit, and times the number with which all are explained best."""
    for sample in whole.samples:

        def taken(factor: float, sample=sample) -> Explained:  # type: ignore[no-untyped-def]
            timed = sample.timed(whole.columns, factor)
            return Explained.by(whole.of([timed if s is sample else s for s in whole.samples]), how)

        name, none = json.dumps(sample.label), taken(1.0)
        for unit, scale, _ in UNITS:
            line = f"recordings: [{{name: {name}, columns: {{t: {{scale: {scale:g}}}}}}}]"
            words = f"t is in {unit}"
            yield Changed(sample.label, ("t",), "time_unit", words, line, taken(scale))
        rates = RATES
        for _ in range(TIMES):
            tried = [taken(float(rate)) for rate in rates]
            best = int(np.argmax([its.fit.gain_over(none.fit) for its in tried]))
            if rates is RATES and best in (0, len(RATES) - 1):  # as if there were no motion, or no torque
                break
            rate, explained = float(rates[best]), tried[best]
            rates = np.geomspace(rates[max(best - 1, 0)], rates[min(best + 1, len(rates) - 1)], FINER)
        else:
            words = f"t is {times_too(1 / rate)} (its clock)"
            remedy = f"give it a columns: of its own in the study with {{t: {{scale: {rate:.3g}}}}}"
            yield Changed(sample.label, ("t",), "clock_rate", words, remedy, explained)
