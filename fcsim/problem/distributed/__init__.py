"""W over ranks of MPI: each has the shares h C h^T of its own bodies, and the factor of what only they take part in."""

from fcsim.problem.distributed.bodies import BodiesOverRanks as BodiesOverRanks
from fcsim.problem.distributed.bodies import Compliances as Compliances
from fcsim.problem.distributed.bodies import bodies_by_ranks as bodies_by_ranks
from fcsim.problem.distributed.delassus import DistributedDelassus as DistributedDelassus
from fcsim.problem.distributed.delassus import whole_delassus as whole_delassus
from fcsim.problem.distributed.factor import DistributedFactor as DistributedFactor
from fcsim.problem.distributed.halo import Halo as Halo
from fcsim.problem.distributed.halo import SharesByParts as SharesByParts
from fcsim.problem.distributed.layout import ContactLayout as ContactLayout
from fcsim.problem.distributed.layout import contact_layout as contact_layout
from fcsim.problem.distributed.parts import ContactParts as ContactParts
from fcsim.problem.distributed.parts import Needed as Needed
