"""What belongs to the whole process, in one place: threads, freed memory, dolfinx/PETSc, gmsh.

* `threads` says how many threads of its own fcsim uses (`fcsim.threads`): FCSIM_THREADS, else the cores that the process may use. They
  change no result.
* BLAS and OpenMP threads change the order of sums and fight with ours, MUMPS and other processes, so that `solve`, a step of a simulation
  and the command line limit them to one for as long as they run (`limited_threads`), unless the user's environment (OMP_NUM_THREADS,
  OPENBLAS_NUM_THREADS, ...) says otherwise. A program that imports fcsim keeps its own number outside these calls.
* Large arrays that are freed in one step and made again in the next stay with the process (`keep_freed_memory`).
* `dolfinx()` and `petsc()` are the only doors to those packages: where the `dolfinx_solver` wheel exists it must be imported first.
* `compiled_form` compiles forms, and mends what a killed process left where they are kept.
* `forget_outdated_kernels` has numba compile anew what calls a file that has changed.
* The working directory is a place, not a source (`without_local_options`): numba reads .numba_config.yaml there (where compiled functions
  are loaded from), dolfinx dolfinx_jit_options.json (arguments of the C compiler), PETSc .petscrc (files it writes, libraries it loads),
  matplotlib matplotlibrc (programs it calls), and `python -c` every module: a folder of somebody else's results would run their code.
* `gmsh_model()` is the only place that initialises and finalises gmsh, so that a failure inside cannot poison what comes next. A process
  has one gmsh: threads wait for each other there.
"""

from fcsim.runtime.caches import writable_caches as writable_caches
from fcsim.runtime.compiled_forms import compiled_form as compiled_form
from fcsim.runtime.freed_memory import keep_freed_memory as keep_freed_memory
from fcsim.runtime.freed_memory import release_freed_memory as release_freed_memory
from fcsim.runtime.gmsh_models import gmsh_model as gmsh_model
from fcsim.runtime.libraries import dolfinx as dolfinx
from fcsim.runtime.libraries import has_petsc as has_petsc
from fcsim.runtime.libraries import mpi as mpi
from fcsim.runtime.libraries import petsc as petsc
from fcsim.runtime.outdated_kernels import forget_outdated_kernels as forget_outdated_kernels
from fcsim.runtime.thread_limits import THREAD_VARIABLES as THREAD_VARIABLES
from fcsim.runtime.thread_limits import library_threads as library_threads
from fcsim.runtime.thread_limits import limited_threads as limited_threads
from fcsim.runtime.thread_limits import threads as threads
from fcsim.runtime.working_directory import ELSEWHERE as ELSEWHERE
from fcsim.runtime.working_directory import ISOLATED as ISOLATED
from fcsim.runtime.working_directory import load_numba_alone as load_numba_alone
from fcsim.runtime.working_directory import without_local_options as without_local_options
