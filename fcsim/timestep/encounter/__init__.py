"""The contacts of a step and what their law makes of them: from positions to the contact side of the problem."""

from fcsim.timestep.encounter.contact_side import Encounter as Encounter
from fcsim.timestep.encounter.detected import LawInput as LawInput
from fcsim.timestep.encounter.detected import asked_again as asked_again
from fcsim.timestep.encounter.detected import encounter as encounter
from fcsim.timestep.encounter.detected import met_on_the_way as met_on_the_way
from fcsim.timestep.encounter.redetection import Redetection as Redetection
