"""Verdicts: is this renderer right on average, what is wrong with it, and how sure is that?

In come a renderer, or pictures that are already there, and scenes with their truth. Out come a case for each
scene and technique, PASS, FAIL or INCONCLUSIVE with one sentence and its figures; for a wrong image what
explains it: a convention, the parts of the light that are off, mistakes of the catalogue that look like it.
Calls go down this list, the way of a picture from `raycheck verify` to its sentence:

 1 commands.verify.verify             reads the command line, and shows the table at the end
 2 judging.verify.verify              makes the cases of a run one after the other within its budget
 3 judging.agenda.oneray_agenda       says which cases: scene, technique, renderer; what is left out and why
 4 judging.judge_renderer.judge_task  renders one case: a probe, a pilot, two sets of images
 5 judging.checks.check_contract     rejects images of another size, NaN and Inf, before any statistics
 6 judging.plan.plan                  says how many samples a verdict needs, by the pilot's noise and time
 7 stats.verdict.judge                decides by the means of image and tiles, in both sets
 8 judging.conclusion.conclude        makes the judgement a sentence and figures; a FAIL is explained by
 9 judging.looks.look                 the error in 8×8 tiles by both sets of images, which goes to
10 judging.explanations.explain       what may be said of it, of all that competes:
11 judging.candidates.groups          pictures that were written or sampled in another way (conventions),
12 judging.parts.hypotheses           lights, path lengths and surfaces that have another factor, and
13 judging.mistakes.signatures_in     known mistakes, by their signatures
14 judging.sentences.reason           says where, how much, how sure, and what would decide
15 judging.cases.Case                 is the verdict, in memory and in a file

Beside this way lie
tile_errors   the error in tiles, and its noise
fitting       how likely candidates are, all by one formula
conventions   pictures that were written, or sampled, in another way
repeated      looks at a case again and again until it is decided, by evidence that multiplies
climb         the ladder again and again, with a renderer that is being written
consistent    judges the limit of a bias that shrinks with a parameter
baseline      today's verdicts beside another day's
settings      numbers of images, budgets, wishes
timetable     the seconds of a run: which cases fit into them, and the time of a picture
judge_images  verdicts on pictures that are already rendered, even a single one
inspection    raycheck diagnose: all that can be said of images that nobody has judged
compare       two images by the standard errors that they carry
verdict_pages what was rendered, the reference and where they differ, a page for each verdict
markdown      verdicts as a table and sentences, for the summary of a job
junit         verdicts as XML for continuous integration
"""
