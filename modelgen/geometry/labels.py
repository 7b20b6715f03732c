"""Which names a payload may bear: its label continues the names of its ten parameters, XXL to ML."""

from __future__ import annotations

import re

from modelgen.errors import ModelgenError, shortened


def check_payload_label(label: object) -> None:
    """Letters first; no final R, which marks regrouping; no X, Y or Z first: MX1 is a first moment of link 1.

    Raises ModelgenError.
    """
    text = label if isinstance(label, str) else ""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,20}", text, re.ASCII) or text.endswith("R"):
        raise ModelgenError(
            f"the payload label {shortened(repr(label))} is not a letter followed by up to 20 letters, "
            "digits or _ without a final R; rename it"
        )
    if text[0] in "XYZ":
        raise ModelgenError(
            f"the payload label {text} begins with {text[0]}, so that its mass M{text} would read as a first "
            "moment; rename it, for example L"
        )
