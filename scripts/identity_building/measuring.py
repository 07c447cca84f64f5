"""Accuracy of the model on identities that it has not been learned from."""

import numpy as np

from faceposer.geometry.nearest_surface import NearestSurface
from faceposer.identity.model import IdentityModel
from scripts.identity_building.learning import Learning
from scripts.identity_building.scans import N_SKIN, Floats

_SEED, _N_HEADS, _N_SURFACES = 7, 100, 10
# Noise in centimetres that keeps modes at rest which a segment hardly shows.
_SEGMENT_NOISE = 0.02
_COUNTS = (10, 20, 40, 60, 80, 100)


def measured(learning: Learning, model: IdentityModel) -> list[str]:
    """Return a table of errors in millimetres by the number of modes, as lines of text."""
    heads = learning.heads(_SEED, _N_HEADS, balanced=False)
    template = learning.template
    skins = np.stack([template.skin(head) for head in heads])
    general = 10.0 * model.generalization(skins, _COUNTS)
    outer = 10.0 * model.generalization(skins, _COUNTS, counted=learning.carried.known)
    specific = 10.0 * model.specificity(learning.heads(_SEED + 1, 4 * _N_HEADS, balanced=False), _COUNTS)
    compact = model.compactness()
    segments = [10.0 * _segment_error(model, skins, count) for count in _COUNTS]
    lines = ["modes  variance  unseen identities, on outer skin  with segments  specificity"]
    for row, count in enumerate(_COUNTS):
        errors = f"{general[row]:14.3f} mm  {outer[row]:10.3f} mm  {segments[row]:10.3f} mm  {specific[row]:8.2f} mm"
        lines.append(f"{count:5d}  {compact[count - 1]:8.3%}  {errors}")
    return [*lines, f"surface of the scans' identities: {_surface_error(learning):.3f} mm mean"]


def _segment_error(model: IdentityModel, skins: Floats, count: int) -> float:
    """Return the mean vertex error in centimetres if each segment has coefficients of its own."""
    errors = []
    for skin in skins:
        rows = model.project_segments(skin, noise=_SEGMENT_NOISE, n_modes=count)
        errors.append(np.linalg.norm(model.instance(rows) - skin, axis=1).mean())
    return float(np.mean(errors))


def _surface_error(learning: Learning) -> float:
    """Return the mean distance in millimetres of carried heads from the same identities of the scans."""
    people, carried, frame = learning.people, learning.carried, learning.correspondence.registration.frame
    distances = []
    for weights in np.random.default_rng(_SEED).standard_normal((_N_SURFACES, len(people.modes))):
        skin = learning.template.skin(carried.mean + np.tensordot(weights, carried.modes, 1))
        scan = frame.apply(people.mean[:N_SKIN] + np.tensordot(weights, people.modes[:, :N_SKIN].astype(float), 1))
        surface = NearestSurface(scan, people.triangles, np.arange(len(people.triangles)))
        _, apart = surface.points(skin[carried.known])
        distances.append(apart.mean())
    return 10.0 * float(np.mean(distances))
