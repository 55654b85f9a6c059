"""Pure functions of arrays: no file, no scene, no renderer.

In come residuals of regions (B, R, 3) of B independent images, with the mean, variance and number of samples
of what they are compared with; or errors at several numbers of samples. Out come p-values, intervals and
detectable biases, a verdict of PASS, FAIL or INCONCLUSIVE with what it rests on, tiles, slopes and
efficiencies.

tiles        regions of an image: the whole, a grid of squares, a quad-tree that is coarse where samples are
             skewed; means and variances over them
statistics   moments of two sets, Johnson's t, Holm, the omnibus test of all tiles, detectable bias
verdict      the three outcomes from two disjoint sets of images; what differs, and how many samples would
             decide
evidence     what many looks say together: e-values that multiply, at a level that holds for ever
consistency  the limit of a bias that falls like a power of a parameter
convergence  error against samples: fits with their errors by jackknife, bends, efficiency
spread       a figure over a few rounds
"""
