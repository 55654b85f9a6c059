"""What an image ought to be.

In comes a scene with the values of its parameters. Out comes the mean of every pixel and its variance, with
how noisy and how skewed a single sample is: by Mitsuba, from many independent batches, and by a closed form
in those pixels that have one, which outranks it. A reference belongs to one state of a scene file; a stale
one is refused.

references    the images in references/NAME.exr, whether they are fresh, what they hold
manifest      how each was made
making        new ones: small batches plan, many large ones give mean and variance
mitsuba       batches by Mitsuba 3, and which of its variants works here
drift         what another version of Mitsuba changes
expected      reference and closed form together: what verdicts compare with
provenance    what a kept result rests on, and why it is stale
closed_forms  exact images of the scenes whose light can be written down
"""
