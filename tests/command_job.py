"""The command line as a job of ranks that are there already: ``command_job.py FOLDER WORDS``."""

import os
import signal
import sys

from latinpc.cli import main

folder, pipe = os.getcwd(), signal.getsignal(signal.SIGPIPE)
os.chdir(sys.argv[1])
try:
    main(sys.argv[2:])
finally:
    os.chdir(folder)
    signal.signal(signal.SIGPIPE, pipe or signal.SIG_DFL)
