"""Trace what a fit leaves over to the physical effects that the model lacks.

rows -> candidates -> scoring -> (generic rival, events) -> refine -> verdict; `loop` runs it, `document` writes it.
"""
