"""A robot file of two joints that move in one vertical plane, small enough to derive in a second."""

TWO_LINKS = """\
name: two_links
convention: mdh
gravity: [0, -9.81, 0]
links:
  - {joint: revolute, antecedent: 0, alpha: 0, d: 0,   theta: q1, r: 0}
  - {joint: revolute, antecedent: 1, alpha: 0, d: 0.3, theta: q2, r: 0}
"""
