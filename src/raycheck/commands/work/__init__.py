"""What commands do once their words are read: each module is imported by the command of its name, when it is
called.

In come the values of a command line. Out come tables and sentences on standard output, progress on standard
error, and what the exit status depends on. A command whose work is one call of another package has no module
here.

climb               the ladder's verdicts as a renderer is being written
completion          what a shell reads to complete a command line
grade, grade_check  a class graded, an assignment tried out
reference           references made, with how long that takes
report              the races of a report
selftest            attacks on the grader
techniques, verify  their tables
"""
