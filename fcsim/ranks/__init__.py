"""Ranks of MPI that share the work of one simulation: who they are, how they exchange what they have, how they end together.

Every rank runs the same program on the same numbers; what is shared is the work on bodies (see `fcsim.assembly.shares`), and by some
methods W with its factor (`fcsim.problem.distributed`). Sharing is asked for, by `fcsim run` under a launcher or by a script's
`with sharing():`, so that ranks which each do something else are left alone; and MPI is loaded by those alone who share.
"""

from fcsim.ranks.asked import asked_ranks as asked_ranks
from fcsim.ranks.asked import own_rank as own_rank
from fcsim.ranks.asked import ranks_on_this_machine as ranks_on_this_machine
from fcsim.ranks.digest import digest_of as digest_of
from fcsim.ranks.mapped_memory import in_common as in_common
from fcsim.ranks.sharing import alone as alone
from fcsim.ranks.sharing import end_with as end_with
from fcsim.ranks.sharing import kept_alike as kept_alike
from fcsim.ranks.sharing import of_rank_0 as of_rank_0
from fcsim.ranks.sharing import partners as partners
from fcsim.ranks.sharing import section as section
from fcsim.ranks.sharing import shared as shared
from fcsim.ranks.sharing import sharing as sharing
from fcsim.ranks.sharing import told as told
from fcsim.ranks.sharing import world as world
from fcsim.ranks.sharing import writes as writes
from fcsim.ranks.tasks import common_arrays as common_arrays
from fcsim.ranks.tasks import complete_rows as complete_rows
from fcsim.ranks.tasks import elementwise as elementwise
from fcsim.ranks.tasks import for_parts as for_parts
from fcsim.ranks.tasks import held_in_common as held_in_common
from fcsim.ranks.tasks import in_parts as in_parts
from fcsim.ranks.tasks import in_parts_of_common as in_parts_of_common
from fcsim.ranks.tasks import in_pieces as in_pieces
from fcsim.ranks.tasks import largest as largest
from fcsim.ranks.tasks import shared_out as shared_out
from fcsim.ranks.tasks import written as written
from fcsim.ranks.world import RankEnded as RankEnded
from fcsim.ranks.world import World as World
