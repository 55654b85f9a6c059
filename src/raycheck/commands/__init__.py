"""The commands, a module each: raycheck NAME is the function NAME of commands/NAME.py, or its Typer app.

In come words of a command line. A command parses them, calls a public function of a package, prints what
comes out and ends with an exit status: 0, 1 if something is wrong, 2 if nothing could be judged, 3 if it
stays open. Its module is imported when it is called, and imports what it needs alone.

options      those that several commands share
support      errors on one line, the terminal, a progress bar
grade_check  raycheck grade --check
"""
