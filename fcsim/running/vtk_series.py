"""The VTK time series of a run: deformable blocks, contact points and rigid bodies, for ParaView and for `fcsim render`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.mesh.part import Body, RigidBody
from fcsim.running.series.bodies import Blocks, RigidSurfaces
from fcsim.running.series.collection import COLLECTION, SERIES, Entry, earlier_collections, entries_in, write_collection
from fcsim.running.series.points import contact_points, found_points, link_points
from fcsim.running.series.vtk import VTK

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkUnstructuredGrid

    from fcsim.assembly.model import Model
    from fcsim.contact_detection.contacts import Contacts
    from fcsim.timestep.state import State
    from fcsim.timestep.step import Step


class SeriesWriter:
    """Writes the VTK series of a model into `directory`: `.write(step)` adds one instant.

    directory  made if absent; holds run.pvd, which lists all of blocks_00010.vtu, contacts_00010.vtp, rigid_00010.vtp, ... as blocks of
               these names. Where it exists (a continued run), its entries are kept up to the time of the first step written.
    model      dimension; bodies (Body | RigidBody); node_offset (nbodies + 1,); reference (nodes, d) [m];
               node_displacement(x), node_velocity(v, x) -> (nodes, d) [m], [m/s]

    Arrays that have a unit carry it in their name, "displacement [m]" (`series.units`); field data body_names of
    contacts and rigid names the bodies (not of blocks: meshio reads no .vtu with texts).

    blocks     points in the reference configuration; point data displacement [m], velocity [m/s]; cell data von_mises [Pa]
               (at the cell's centre), body; field data round_off_of_stress [Pa], what von_mises may have of it in linear parts
    contacts   points at the foot points; reaction (global axes), reaction_normal, reaction_tangential [N], gap [m], status (0 open,
               1 stick, 2 slip), sliding_velocity [m/s], mu, slave and master (numbers of the bodies), identity
               (of the same contact at all instants), normal, displacement [m] of the master surface there, rolling_moment
               [N m] and rolling (0, 1) with rolling resistance, spinning_moment [N m] and spinning (0, 1) with spinning resistance;
               and what the law remembers, by its names (fracture, slip, ...); field data gravity [m/s^2] where it is, overlap [m] and
               overlap_place where the witness saw any
    links      where there are any: points where their rows act, as the bodies stand; force [N] on the first body (global axes), link
               (its number in the linkage), gap [m]
    rigid      the surfaces of the rigid bodies; point data displacement [m], velocity [m/s]; cell data body

    Every file is written under a temporary name and renamed, the collection last, so that an interrupted run leaves whole files.
    Raises MissingDependency without VTK, OSError where a file cannot be written.
    """

    def __init__(self, directory: str | Path, model: Model) -> None:
        self.directory = Path(directory)
        self.directory.mkdir(parents=True, exist_ok=True)
        self._model = model
        self._vtk = VTK()
        deformable = [k for k, body in enumerate(model.bodies) if isinstance(body, Body)]
        rigid = [k for k, body in enumerate(model.bodies) if isinstance(body, RigidBody)]
        self._blocks = Blocks(self._vtk, model, deformable) if deformable else None
        self._rigid = RigidSurfaces(self._vtk, model, rigid) if rigid else None
        self._entries = entries_in(self.directory)

    def write(self, step: Step) -> None:
        """Write the data sets of a step and take them up in the collection.

        Reads step.number; step.state.t, .x, .v; step.contacts; step.contact_force (nc, d) [N] in the frame (N, T1[, T2]);
        step.contact_status (nc,); step.result.u [m/s]; step.rolling_moment; step.spinning_moment;
        step.law_variables. Entries of the same or a later time are replaced.
        """
        datasets = {"contacts": (contact_points(self._vtk, step, self._model.node_displacement(step.state.x)), "vtp")}
        if step.linked is not None:
            datasets["links"] = (link_points(self._vtk, step, step.linked), "vtp")
        self._write(step.number, step.state, datasets)

    def write_beginning(self, state: State, contacts: Contacts) -> None:
        """Write the state in which a run begins, and the contacts found there, as instant 0: all that a run leaves that fails at once."""
        displacement = self._model.node_displacement(state.x)
        self._write(0, state, {"contacts": (found_points(self._vtk, self._model, contacts, displacement, state.t), "vtp")})

    @property
    def empty(self) -> bool:
        """Whether there is no instant yet."""
        return not self._entries

    def _write(self, number: int, state: State, datasets: dict[str, tuple[vtkPolyData | vtkUnstructuredGrid, str]]) -> None:
        """Write the bodies and the other data sets of an instant."""
        t = float(state.t)
        displacement, velocity = self._model.node_displacement(state.x), self._model.node_velocity(state.v, state.x)
        if self._blocks:
            strained = self._model.strained_displacement(state.x)
            datasets["blocks"] = (self._blocks.dataset(displacement, velocity, strained, state), "vtu")
        if self._rigid:
            datasets["rigid"] = (self._rigid.dataset(displacement, velocity), "vtp")
        files = {name: f"{name}_{number:05d}.{datasets[name][1]}" for name in SERIES if name in datasets}
        for name, file in files.items():
            self._vtk.write(datasets[name][0], self.directory / file, t)
        written = set(files.values())
        kept = [entry for entry in self._entries if entry.t < t and entry.file not in written]
        self._entries = [*kept, *(Entry(t, file, name) for name, file in files.items())]
        write_collection(self.directory / COLLECTION, self._entries)
        for path in earlier_collections(self.directory):  # their entries are in the one collection now
            path.unlink()
