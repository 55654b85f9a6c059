"""python -m raycheck"""

from raycheck.cli import main

main()
