"""Terms that a study leaves out of the model, and that its torques ask for.

Whether a drive rubs is no choice of a study's: of a TX40 whose study left out viscous friction 25 % were left
for 4, 87 foretold for 12, and a fit said nothing.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ident.equations.columns import left_out
from ident.examination.check import Check
from ident.examination.fits.hypothesis import CLEARLY, Asked, falls
from ident.examination.fits.stretches import RARE, Explained, all_rows, steadily
from ident.recordings.study import Study


def asked_for(study: Study, asked: Asked) -> Iterator[Check]:
    """Each term without which, beside the others, clearly less is explained, all along. asked: with all."""
    columns, how, whole = asked.quick.columns, asked.how, all_rows(asked.quick)
    every = Explained.by(whole, how)
    for term in study.without:
        names = left_out(study.with_(without=(term,)), columns.parameters, columns.regroups)
        gone = np.isin(columns.parameters, list(names))
        bare = Explained.by(whole.of([s.lacking(gone) for s in whole.samples]), how)
        if every.fit.gain_over(bare.fit) > CLEARLY and steadily(bare, every, RARE):
            said = term.replace("_", " ").replace(":", " of joint ")
            yield Check(
                "left_out",
                (),
                f"the study leaves out {said}, and its torques ask for it: with it, "
                f"{falls(bare.fit, every.fit)} over all recordings",
                f"take {term} out of the study's without",
            )
