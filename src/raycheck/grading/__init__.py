"""Grading of course assignments: submissions that nobody trusts, judged by pixels alone.

assignment.py reads what is asked, submission.py what is handed in; sandbox.py runs it, pixels.py takes its
pictures over the border, judge.py gives verdicts and points, results.py, pages.py, tables.py and
gradescope.py write them down. piece.py grades one submission in a process of its own, course.py a class.
"""
