"""Adverse scenes with closed forms, and whether what is claimed about them holds.

`python -m docs.studies.claims --scenes N --seed S` draws scenes, runs the commands on them and
counts the claims that hold. See `scenes` for the kinds of scenes and `claims` for the claims.
"""
