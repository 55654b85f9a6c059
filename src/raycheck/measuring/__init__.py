"""What rendering costs, how far it holds, and the pages that show it.

In come scenes and renderers. Out come figures with their spread over interleaved rounds, tables of them for
the terminal and docs/, files that they are kept in, plots, and the report: pages that need no network.

contestants   renderers that race: a command for each picture, or Mitsuba in a process that stays; process
              time
prices        what each technique costs, against the plain random walk
price_tables  those as tables
races         error against run time at doubling sample counts
race_plots    the figures of a race as plots and tables
speed         what scripts/benchmark.py measured
stability     how far renderers hold in stiff cases
log_log       curves in a plot with logarithmic axes, as data for it
matrix        verdicts by scene and technique, and why there is none
report        the pages
step          a step of a long measurement, for a progress bar
"""
