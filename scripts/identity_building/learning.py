"""Learning of the model: registration, sampled identities, and their principal components."""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np

from faceposer.identity.model import IdentityModel
from faceposer.identity.segments import segments_of
from faceposer.identity.template import head_template
from faceposer.model.character_file import load_character
from faceposer.progress import Progress
from scripts.asset_building.head import cut_skin
from scripts.asset_building.source import Source
from scripts.identity_building.correspondence import Correspondence, correspondence
from scripts.identity_building.heads import CarriedModes, Cleaner, carry
from scripts.identity_building.scans import Floats, ScannedPeople

CREDITS = (
    "Shapes learned from identities of ICT-FaceKit Light, Copyright (c) 2020 USC Institute for Creative Technologies, "
    "MIT licence, laid on MakeHuman's base mesh (CC0 1.0)."
)
#: Modes kept, and seed and number of the sampled identities; with each come its opposite and their mirror images.
N_MODES, _SEED, _N_SAMPLES = 100, 1999, 600


class Learning:
    """Steps from the scans' modes to the model; shared results are computed once."""

    def __init__(self, scans: Path, source: Source, say: Callable[[str], None]) -> None:
        """Read the mean and the modes of ``scans`` and our topology from ``source``."""
        self.people, self.template, self.say = ScannedPeople.read(scans), head_template(), say
        base = source.base_mesh()
        self.base, self.skin = base, cut_skin(base, source.mirror(len(base.vertices)))
        if not np.array_equal(self.skin.quads, self.template.control_quads):
            raise SystemExit("The built-in man is not a subdivision of the base mesh; rebuild the characters.")

    @cached_property
    def correspondence(self) -> Correspondence:
        """Our skin on the mean of the scans."""
        found = correspondence(load_character("man"), self.skin, self.people, Progress())
        used = found.registration.used
        distances = 10.0 * found.registration.distances[used]
        self.say(f"registered: {used.mean():.0%} of the vertices, {np.median(distances):.3f} mm from the scans' mean")
        return found

    @cached_property
    def carried(self) -> CarriedModes:
        """The modes on our topology."""
        result = carry(self.correspondence, self.template, self.people)
        losses = [10.0 * np.linalg.norm(self.template.skin(result.mean) - result.skin, axis=1)]
        pairs = zip(result.modes, result.skin_modes, strict=True)
        squares = sum(np.square(self.template.skin(mode) - fine).sum(axis=1) for mode, fine in pairs)
        losses.append(10.0 * np.sqrt(squares))
        for name, loss in zip(("mean", "modes"), losses, strict=True):
            self.say(f"control mesh, {name}: {loss.mean():.3f} mm mean, {np.quantile(loss, 0.99):.2f} mm 99 % quantile")
        return result

    @cached_property
    def cleaner(self) -> Cleaner:
        """The cleaning of heads."""
        return Cleaner(self.template, self.skin, self.base, self.carried.mean)

    def head(self, weights: Floats) -> Floats:
        """Return the control vertices, (C, 3), of the identity with ``weights`` of the scans' modes, (K,)."""
        return self.cleaner(self.carried.mean + np.tensordot(weights, self.carried.modes, 1))

    def heads(self, seed: int, n: int, balanced: bool) -> Floats:
        """Return ``n`` sampled heads, shape (n, C, 3).

        If ``balanced``, with `balanced_weights`, 2 n heads in all.
        """
        k = len(self.people.modes)
        weights = balanced_weights(seed, n, k) if balanced else np.random.default_rng(seed).standard_normal((n, k))
        return np.stack([self.head(row) for row in weights])

    def model(self) -> IdentityModel:
        """Learn the model."""
        heads = self.heads(_SEED, _N_SAMPLES, balanced=True)
        heads = np.concatenate([heads, np.stack([self.cleaner.mirrored(head) for head in heads])])
        self.say(f"learning from {len(heads)} heads")
        man = load_character("man")
        model = IdentityModel(N_MODES, self.template, credits=CREDITS).fit(heads)
        model.segments = segments_of(model.mean_vertices, self.template.control_quads, man.regions)
        return model


def balanced_weights(seed: int, n: int, k: int) -> Floats:
    """Return ``n`` draws from the standard normal distribution of ``k`` dimensions and their opposites, (2 n, k).

    They are turned and stretched so that their second moment is exactly the identity matrix: the sampling adds no error
    to the covariance of what is linear in them.
    """
    u, _, vt = np.linalg.svd(np.random.default_rng(seed).standard_normal((n, k)), full_matrices=False)
    weights = np.sqrt(n) * (u @ vt)
    return np.concatenate([weights, -weights])
