"""Error against run time: contestants race over a scene at doubling sample counts.

In come a scene with its truth and its contestants, and the seconds that each may take. Out come the curves of
the scene, its pictures at equal samples and at equal time, or for a contestant the reason why it has no
curve. What was rendered is kept on disk until the scene is finished, so that a run can be interrupted and
goes on.

racing    all scenes, one after the other; which pictures are shown
race      the rounds of one scene
measured  the figures of a contestant
curves    those figures, in memory and in a file
"""
