"""Verdicts: is this renderer right on average, what is wrong with it, and how sure is that?

In come a renderer, or pictures that are already there, and scenes with their truth. Out come a case for each
scene and technique, PASS, FAIL or INCONCLUSIVE with one sentence and its figures; for a wrong image the parts
of the light that are off, and the mistakes of the catalogue that look like it. A verdict flows down this
list:

verify     the public function: takes a run apart into cases and keeps to its budget
agenda     which cases: a scene, a technique, a renderer; what is left out and why
settings   numbers of images, budgets, wishes
renders    one case: a probe, a pilot, two sets of images
pictures   one case of pictures that are already rendered, even a single one
plan       how many samples a verdict needs, from the pilot's noise and time
checks     mistakes of convention, named before any statistics: sizes, NaN, seeds, upside down, gamma,
           clamping
telling    a judgement as the figures and the sentence of a case
evidence   the error of an image in tiles, with its noise
diagnosis  known mistakes, by their signatures, that explain the evidence
parts      lights, path lengths and surfaces whose factor explains it
findings   all that can be said of images that nobody has judged: raycheck diagnose
sentences  where, how much, how sure, and what would decide, in words
verdicts   the cases of a run, in memory and in a file
compare    two images by the standard errors that they carry
junit      verdicts as XML for continuous integration
"""
