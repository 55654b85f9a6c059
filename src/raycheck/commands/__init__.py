"""The commands, a module each: raycheck NAME is the function NAME of commands/NAME.py, or its Typer app.

In come words of a command line. A command reads them, calls a public function of a package, prints what
comes out and ends with an exit status of `base.statuses`. Its module is imported when its words are read, and
imports at its top only what reads them; what does the work is imported when it is done, so that --help,
--version and a wrong word take no time.

app      the command line as a whole
edge     errors, bugs and interruptions in a line and an exit status
options  options that several commands share
terminal tables, a progress bar
pytest_plugin  tests that judge a renderer, for pytest
work     what a command does where that is more than a call
"""
