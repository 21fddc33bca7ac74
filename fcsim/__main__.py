"""python -m fcsim: the command line, as mpi4py.futures starts it."""

from fcsim.command_line.main import main

if __name__ == "__main__":
    raise SystemExit(main())
