"""An audit of renderers against closed forms: what each gets wrong, and what it gets right.

In come checks, each a smallest scene in a renderer's own language, the value that its picture has by a closed
form, and why that is sure. Out come records with the measured value, an interval that misses the truth with
probability 1e-5, and a verdict: finding, documented approximation, health, or undecided.

check         what a check is; the level, and how many intervals it allows
forms         the closed forms
mitsuba, cycles, luxcore, raysect, oneray: the checks of each renderer, scene by scene
checks        all of them, in their order
running       renders a check in a process of its own and judges it
workers       the programs of those processes; each imports its renderer and nothing of raycheck
judging       from batches to intervals and a verdict
results       what came out, in memory, in a file, and what a new run changed
tables        that for the terminal and docs/audit.md
"""
