"""raycheck measured: does it say the truth about renderers of which the truth is known?

In come a checkout of the sources, correct renderers, and oneray with one mistake each. Out come the sections
of references/calibration.json (false alarms, detectable biases, mistakes seen, names given) and the data that
diagnoses rest on, references/signatures and references/parts.

mutants       the catalogue of mistakes, and the programs that they make
nulls         correct renderers judged many times: false alarms, even p-values, injected biases
kills         mistakes judged, as they are and weakened; rivals are the rules of other projects
trials        one renderer on one scene, by all rules, on the same images
signatures    what each mistake adds to an image; naming tells how often a mistake is called by its name
unseen        mistakes that nobody tuned for: what is said of them, and whether it is so
part_making   what each light, path length and surface adds to an image
gradings      an honest program graded many times
assignments   an assignment tried out; simulated is oneray as the program of a slower student
checkout      which sources: the same on every machine that takes part
lines, table  results in a file, and in the README
"""
