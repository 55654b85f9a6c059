"""What makes images, and where the work is done. Judges nothing.

In come a scene file, a number of samples and a seed, or a function with the pieces of work that it is to do.
Out come images with the seconds that they took, or the bytes of each piece. What goes wrong is a RenderError,
which says it in one sentence, or NotFound where nothing can be started at all.

renderer        what every renderer is to a judge
commands        a command line with {scene} {spp} {seed} {output}; its process is ended with all that it
                started
callables       a Python function
watched         the files that a renderer is, and waiting until they change
oneray          where oneray is, and its command line
bundle          oneray with its libraries, for another machine
builds          which raycheck and which oneray: machines that share work must have the same
pools           where pieces of work run: processes here, or the workers of a Dask cluster
workers         work in Python apart from this process, each thread with a helper that may die alone
shards          one picture split over a pool, merged to the bits of one run
mitsuba_worker  Mitsuba in a process of its own, by lines of JSON
mitsuba_scene   a scene file loaded by Mitsuba
"""
