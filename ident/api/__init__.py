"""The door for Python (contract 8): studies of files or tables, and results that answer questions.

Everything here wraps a value of the inner rooms, in `.result`, and computes nothing of its own.
"""
