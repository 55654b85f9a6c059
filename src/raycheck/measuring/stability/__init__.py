"""How far a renderer holds in stiff cases: sweeps over decades against closed forms.

In come cases, each a scene of scenes/stiff with a parameter that is swept, what the picture ought to be with
60 digits, and how far it should hold. Out come, for oneray and for Mitsuba where it is installed, the points
of each sweep, the last value that holds and the first that does not.

cases          all of them, in their order; each module below has those of one subject
case           what a case is; the numbers of a scene as a program parses them
formulas       closed forms that several cases share
spheres, gaps, scales, angles, sums, bounces, narrow, choices: the cases
sweeps         renders the values of a case, and what counts as holding
renderers      oneray, and Mitsuba in a process that may crash (mitsuba_worker)
precisions     generated scenes in oneray's --precision auto and in double
results        what came out, in memory and in a file
tables, plots  that for the terminal, the README and the report
"""
