"""What everything else stands on: files, processes, images, and what can go wrong. Knows no scene and no
light.

In come paths, words of a command line, pictures in whatever format a renderer writes. Out come arrays of
linear radiance in double precision, files that are there whole or not at all, and errors that are one plain
sentence.

arrays     types of arrays
errors     what a user can mend, each a PlainError: NotFound, RenderError, ReferenceError_, ImageError,
           PatchError. The command line prints them on one line.
statuses   how a program ends
data       where scenes and references are, in a checkout and in an installed package: the one place that
           knows
files      a file written whole, what killed processes left of one swept away, a folder that one process at
           a time works in
processes  a program run to its end, or ended with all that it started
machine    this machine, its cores, and the version of raycheck, as results name them
text       numbers for people: percent, signed, duration, number; numbers rounded for a file; ASCII for what a
           terminal lacks; the known word that is nearest to a wrong one
images     pictures read (EXR, PFM, RGBE, 8 bits) and written; sRGB
pictures   pictures for a page: exposure, error maps, data URIs
seeds      seeds that are the same in every run, and none used twice
"""
