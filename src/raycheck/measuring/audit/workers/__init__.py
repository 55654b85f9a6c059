"""Programs that render for the audit, each in the Python of its renderer.

In comes a job as JSON on standard input: {"scene": …, "settings": {…}, "samples": …, "seeds": […]}. Out come,
on the last line of standard output, {"version": …, "pictures": […]}, one picture (H, W, C) for each seed, or
{"error": …}. They import nothing of raycheck, which is not installed where they run.
"""
