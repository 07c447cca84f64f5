"""Fixed vertices: painted, encircled or clicked, they keep their positions (Lau et al. 2009, section 4.5)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faceposer.geometry.picking import SurfacePoints
from faceposer.geometry.strokes import enclosed
from faceposer.session.document import Document
from faceposer.solve.constraints.fixed import FixedConstraint
from faceposer.tools.symmetry import Mirroring, surface_mirror
from faceposer.tools.tool import Gesture, PointerEvent, PosingTool, ToolContext, ToolSettings

Pixel = tuple[float, float]
Vertices = NDArray[np.int64]


class FixTool(PosingTool):
    """Fixes vertices of the face, or releases them with Ctrl.

    Attributes:
        lasso: The line being drawn around vertices, or empty.
    """

    name = "fix"
    label = "Fix"
    key = "H"
    help = "Fix vertices in place"
    empty_text = "Paint the area to hold in place, or choose a region above."
    cursor = "draw"

    def __init__(self, tool_settings: ToolSettings) -> None:
        """Use the shared ``tool_settings``."""
        super().__init__(tool_settings)
        self.lasso: list[Pixel] = []

    def begins(self, event: PointerEvent, context: ToolContext) -> bool:
        """Return True if the press ``event`` starts to paint or to encircle."""
        if event.button != "left" or event.modifiers - {"ctrl", "shift"}:
            return False
        return self._settings.options.fix_mode == "lasso" or context.pick(event.position) is not None

    def gesture(self, event: PointerEvent, context: ToolContext) -> Gesture:
        """Paint, encircle or click vertices."""
        # on press
        session, erase = context.session, "ctrl" in event.modifiers
        encircle = self._settings.options.fix_mode == "lasso"
        candidates, pixels = self._visible(context)
        try:
            with session.edit("Release vertices" if erase else "Fix vertices"):
                mirroring = Mirroring(self._settings.symmetry, session)
                begun, index = self._growing_constraint(session.document, erase)
                if index is not None:
                    mirroring.partner(begun, index)
                touched: Vertices = np.zeros(0, dtype=np.int64)
                while event.kind != "release":
                    if encircle:
                        self.lasso.append(event.position)
                    else:
                        touched = np.union1d(touched, candidates[self._under_brush(event.position, pixels, context)])
                        self._apply(begun, index, touched, erase, mirroring, context)
                    # on move, until the release
                    event = yield
                if encircle and len(self.lasso) > 2:
                    inside = candidates[enclosed(pixels, self.lasso)]
                    self._apply(begun, index, inside, erase, mirroring, context)
        finally:
            self.lasso = []

    def _visible(self, context: ToolContext) -> tuple[Vertices, NDArray[np.float64]]:
        """Return the visible vertices of the face, (n,), and their pixels, (n, 2)."""
        session = context.session
        triangles = session.model.triangles[session.model.character.solid_triangles]
        vertices = np.unique(triangles).astype(np.int64)
        pixels = context.camera.project(session.vertices[vertices])
        inside = ((pixels >= 0) & (pixels < context.size)).all(axis=1)
        vertices, pixels = vertices[inside], pixels[inside]
        seen = ~context.hidden(SurfacePoints.at_vertices(vertices))
        return vertices[seen], pixels[seen]

    def _under_brush(self, position: Pixel, pixels: NDArray[np.float64], context: ToolContext) -> NDArray[np.bool_]:
        """Return a mask of the ``pixels`` under the brush, or of the nearest one where the mesh is coarser."""
        if not len(pixels):
            return np.zeros(0, dtype=bool)
        distances = np.hypot(*(pixels - position).T)
        radius = 0.5 * self._settings.options.fix_brush * context.ui_scale
        nearest: NDArray[np.bool_] = distances <= max(radius, min(float(distances.min()), 12.0 * context.ui_scale))
        return nearest

    def _growing_constraint(self, document: Document, erase: bool) -> tuple[Document, int | None]:
        """Return the document and the index of the constraint to extend, the selected one if it is of this kind."""
        for i in sorted(self._settings.selection.within(len(document.constraints))):
            constraint = document.constraints[i]
            if isinstance(constraint, FixedConstraint) and not constraint.locked:
                return document, None if erase else i
        return document, None

    def _apply(
        self,
        begun: Document,
        index: int | None,
        vertices: Vertices,
        erase: bool,
        mirroring: Mirroring,
        context: ToolContext,
    ) -> None:
        session = context.session
        if erase:
            if self._settings.symmetry.on:
                partners = surface_mirror(session.model).vertices[vertices]
                vertices = np.union1d(vertices, partners[partners >= 0])
            session.replace(_without(begun, vertices))
            return
        if not len(vertices):
            return
        old = begun.constraints[index] if index is not None else None
        points = SurfacePoints.at_vertices(vertices)
        if isinstance(old, FixedConstraint):
            points = points.subset(~np.isin(points.faces, old.points.faces[old.points.faces < 0]))
        positions = session.model.positions_at(points, session.coefficients)
        if isinstance(old, FixedConstraint) and index is not None and old.positions is not None:
            grown = replace(
                old, anchors=old.anchors.joined(points), positions=np.concatenate([old.positions, positions])
            )
            document, place = begun.with_constraint(index, grown), index
        else:
            fixed = FixedConstraint(points, positions)
            document, place = replace(begun, constraints=(*begun.constraints, fixed)), len(begun.constraints)
        session.replace(mirroring.with_images(document, [place]))
        self._settings.selection.set(place)

    def hint(self, context: ToolContext) -> str:
        """Return the effect of a press, for the status bar."""
        verb = "Encircle" if self._settings.options.fix_mode == "lasso" else "Paint"
        return f"{verb} vertices to fix   ·   Ctrl: release   ·   [ ]: brush width"


def _without(document: Document, vertices: Vertices) -> Document:
    """Return ``document`` with ``vertices`` removed from its fixed constraints; empty constraints are removed."""
    constraints = []
    for constraint in document.constraints:
        kept = constraint
        if isinstance(constraint, FixedConstraint) and not constraint.locked:
            remaining = ~np.isin(-1 - constraint.points.faces, vertices)
            if not remaining.any():
                continue
            if not remaining.all() and constraint.positions is not None:
                kept = replace(
                    constraint, anchors=constraint.anchors.subset(remaining), positions=constraint.positions[remaining]
                )
        constraints.append(kept)
    return replace(document, constraints=tuple(constraints))


def toggle_fixed_region(names: tuple[str, ...], context: ToolContext, tool_settings: ToolSettings) -> None:
    """Fix the regions ``names`` of the face, or release them if a constraint fixes exactly these, as one step."""
    session = context.session
    regions = session.model.character.regions
    found = [regions[name] for name in names if name in regions]
    if not found:
        return
    points = SurfacePoints.at_vertices(np.unique(np.concatenate(found)))
    index = fixed_region_index(names, context)
    if index is not None:
        if not session.document.constraints[index].locked:
            tool_settings.selection.set()
            session.remove_constraints({index}, "Release a region")
        return
    fixed = FixedConstraint(points, session.model.positions_at(points, session.coefficients))
    with session.edit("Fix a region"):
        document = session.document
        session.replace(replace(document, constraints=(*document.constraints, fixed)))
        tool_settings.selection.set(len(document.constraints))


def fixed_region_index(names: tuple[str, ...], context: ToolContext) -> int | None:
    """Return the index of the constraint that fixes exactly the regions ``names``, or None."""
    regions = context.session.model.character.regions
    found = [regions[name] for name in names if name in regions]
    if not found:
        return None
    faces = np.sort(-1 - np.unique(np.concatenate(found)).astype(np.int64))
    for i, constraint in enumerate(context.session.document.constraints):
        if isinstance(constraint, FixedConstraint) and np.array_equal(np.sort(constraint.points.faces), faces):
            return i
    return None
