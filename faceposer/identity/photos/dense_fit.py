"""Refinement of heads by the colours of photos: analysis by synthesis, coarse to fine.

It starts from the fit of landmarks, which stay. Photos are blurred by less and less; at the end, segments of the face
get coefficients of their own. Where colours make things worse, the fit of landmarks remains.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from faceposer.identity.photos.dense_term import DensePhoto
from faceposer.identity.photos.face_crop import FaceCrop
from faceposer.identity.photos.head_basis import FacePoints, HeadBasis
from faceposer.identity.photos.landmark_fit import LandmarkFit
from faceposer.identity.photos.skin_light import SkinLight
from faceposer.identity.photos.skin_samples import SkinSamples
from faceposer.identity.photos.terms import LandmarkTerm
from faceposer.identity.photos.unknowns import FitState, Layout, NormalEquations
from faceposer.progress import Progress

Array = NDArray[np.float64]

# Number of steps for which what is visible is computed once.
_SEEN_FOR = 8


@dataclass(frozen=True)
class DenseSettings:
    """Settings of the refinement.

    Attributes:
        weight: Weight of the colours of a sample relative to an independent one.
        n_samples: Number of samples of each photo in a step.
        levels: Blur in pixels and number of steps of each level.
        n_modes: Number of modes of heads.
        segment_steps: Number of steps with segments after the last level; 0 for none.
        segment_modes: Number of modes of segments.
        segment_spread: Standard deviation of the coefficients of a segment about those of the whole.
        damping: Enlargement of the diagonal of the curvature.
    """

    weight: float = 0.25
    n_samples: int = 2500
    levels: tuple[tuple[float, int], ...] = ((4.0, 6), (2.0, 6), (1.0, 8))
    n_modes: int = 100
    segment_steps: int = 6
    segment_modes: int = 40
    segment_spread: float = 0.4
    damping: float = 0.01


@dataclass(frozen=True, eq=False)
class DenseFit:
    """A head refined by colours.

    Attributes:
        state: Head, texture, poses and cameras; the coefficients of segments follow those of the whole head.
        rows: Coefficients of the head, one row per segment, shape (s, K).
        lights: The light in each photo as coefficients of harmonics for the colours of displays, (9, 3) each.
        residuals: Median difference of colours, 0 to 1, of each photo.
        refined: False if the fit of landmarks was better, and was kept.
        lamps: The light in each photo under which colours were compared.
    """

    state: FitState
    rows: Array
    lights: tuple[Array, ...]
    residuals: tuple[float, ...]
    refined: bool
    lamps: tuple[SkinLight, ...] = ()


class DenseFitter:
    """Refinement of one head in photos."""

    def __init__(
        self,
        crops: Sequence[FaceCrop],
        start: LandmarkFit,
        basis: HeadBasis,
        samples: SkinSamples,
        settings: DenseSettings | None = None,
    ) -> None:
        """Prepare the refinement of ``start``, a fit of the faces of ``crops``."""
        self.settings = settings or DenseSettings()
        self._crops, self._start, self._basis, self._samples = crops, start, basis, samples
        self._rng = np.random.default_rng(0)
        self._watch: Callable[[FitState], None] = lambda _: None
        self._skin_triangles = basis.editor.template.triangles
        self._expression = basis.model.basis.reshape(basis.model.n_coefficients, -1, 3)[:, : basis.n_skin]

    def fit(self, progress: Progress | None = None, watch: Callable[[FitState], None] | None = None) -> DenseFit:
        """Return the refined head; ``watch`` is called with its state after each step."""
        self._watch = watch or (lambda _: None)
        *_, last = self._descents(progress or Progress())
        return self._better(*last)

    def stages(self) -> Iterator[DenseFit]:
        """Yield the refined head before and, if there are any, after steps with segments."""
        for found in self._descents(Progress()):
            yield self._better(*found)

    def _descents(self, progress: Progress) -> Iterator[tuple[FitState, tuple[LandmarkTerm, ...], SkinSamples]]:
        """Yield state, terms and samples after the last level, and after the steps with segments."""
        start, settings = self._start, self.settings
        state = replace(start.state, texture=np.zeros(len(self._samples.colours)))
        terms, skin = start.terms, self._samples
        total = sum(steps for _, steps in settings.levels) + settings.segment_steps
        done, photos = 0, list[DensePhoto]()
        for blur, steps in settings.levels:
            photos = self._photos(skin, blur, photos)
            state = self._descended(state, photos, terms, steps, (done, total), progress)
            done += steps
        yield state, terms, skin
        if settings.segment_steps:
            terms, skin = self._with_segments(terms, skin)
            widened = np.concatenate([state.shape, np.zeros(len(terms[0].points.identity) - len(state.shape))])
            state = replace(state, shape=widened)
            photos = self._photos(skin, settings.levels[-1][0], photos)
            yield self._descended(state, photos, terms, settings.segment_steps, (done, total), progress), terms, skin

    def _descended(
        self,
        state: FitState,
        photos: list[DensePhoto],
        terms: tuple[LandmarkTerm, ...],
        steps: int,
        done: tuple[int, int],
        progress: Progress,
    ) -> FitState:
        seen: list[NDArray[np.int64]] = []
        for step in range(steps):
            progress.at("Fitting the head to colours", (done[0] + step) / done[1])
            if step % _SEEN_FOR == 0:
                rest = self._rest(state)
                seen = [
                    photo.visible(
                        state, number, rest + np.tensordot(view.pose, self._expression, 1), self._skin_triangles
                    )
                    for number, (photo, view) in enumerate(zip(photos, state.views, strict=True))
                ]
            equations = NormalEquations(Layout.of(state))
            self._start.priors.add(state, equations)
            for number, (photo, term) in enumerate(zip(photos, terms, strict=True)):
                term.add(state, number, equations)
                photo.add(state, number, photo.chosen(state, number, seen[number], self._rng), equations)
            state = state.moved(equations.layout, equations.step(self.settings.damping))
            self._watch(state)
        return state

    def _photos(self, skin: SkinSamples, blur: float, known: Sequence[DensePhoto] = ()) -> list[DensePhoto]:
        """Return the photos, blurred, in the light and with the noise of the ``known`` ones, if there are any."""
        settings = self.settings
        photos = []
        for number, crop in enumerate(self._crops):
            image = ndimage.gaussian_filter(crop.image.astype(np.float32), (blur, blur, 0.0))
            photo = DensePhoto(image, skin, settings.weight, settings.n_samples)
            if known:
                photo.light, photo.noise = known[number].light, known[number].noise
            photos.append(photo)
        return photos

    def _rest(self, state: FitState) -> Array:
        """Return the neutral skin of the head of ``state``, shape (N, 3)."""
        basis = self._basis
        rows = self.rows(state)
        offsets = basis.editor.model.vertices(rows) - basis.editor.model.mean_vertices
        turned = basis.editor.template.skin(offsets @ basis.editor.rotation.T)
        result: Array = basis.character.vertices[: basis.n_skin] + turned
        return result

    def rows(self, state: FitState) -> Array:
        """Return the coefficients of the head of ``state``, one row per segment."""
        model = self._basis.editor.model
        assert model.segments is not None
        k, s = model.n_coefficients, len(model.segments.names)
        rows = np.tile(state.shape[:k], (s, 1))
        own = state.shape[k:].reshape(s, -1) if len(state.shape) > k else np.zeros((s, 0))
        rows[:, : own.shape[1]] += self.settings.segment_spread * own
        return rows

    def _with_segments(
        self, terms: tuple[LandmarkTerm, ...], skin: SkinSamples
    ) -> tuple[tuple[LandmarkTerm, ...], SkinSamples]:
        """Return the terms with modes of segments after those of whole heads."""
        weights = self._segment_weights()
        at_landmarks = self._landmark_weights(weights, terms[0].points)
        widened = tuple(
            replace(term, points=replace(term.points, identity=self._widened(term.points.identity, at_landmarks)))
            for term in terms
        )
        identity = self._widened(skin.points.identity, weights[:, skin.vertices])
        return widened, skin.with_identity(identity)

    def _widened(self, modes: Array, weights: Array) -> Array:
        """Return ``modes``, (K, n, 3), and after them those of segments with ``weights``, (s, n)."""
        own = self.settings.segment_spread * modes[: self.settings.segment_modes]
        return np.concatenate([modes, *(weight[None, :, None] * own for weight in weights)])

    def _segment_weights(self) -> Array:
        """Return the weights of the segments on the skin, shape (s, N)."""
        editor = self._basis.editor
        return np.clip(editor.template.skin(editor.segments.weights.T).T, 0.0, 1.0)

    def _landmark_weights(self, weights: Array, points: FacePoints) -> Array:
        """Return the weights of the segments at the landmarks, shape (s, n), from the nearest vertices."""
        from scipy.spatial import cKDTree

        skin = self._basis.character.vertices[: self._basis.n_skin]
        return weights[:, cKDTree(skin).query(points.mean)[1]]

    def _better(self, state: FitState, terms: tuple[LandmarkTerm, ...], skin: SkinSamples) -> DenseFit:
        """Return ``state``, or the fit of landmarks if its whole cost is less."""
        start = self._start
        photos = self._photos(skin, self.settings.levels[-1][0])
        before = replace(
            start.state,
            shape=np.concatenate([start.state.shape, np.zeros(len(state.shape) - len(start.state.shape))]),
            texture=state.texture,
        )
        costs, samples, lights = [], [], []
        for tried in (state, before):
            rest = self._rest(tried)
            cost = start.priors.cost(tried)
            chosen = []
            for number, (photo, view, term) in enumerate(zip(photos, tried.views, terms, strict=True)):
                posed = rest + np.tensordot(view.pose, self._expression, 1)
                seen = photo.visible(tried, number, posed, self._skin_triangles)
                mine = photo.chosen(tried, number, seen, np.random.default_rng(1))
                chosen.append(mine)
                if len(mine) and tried is state:
                    # Both are compared with the noise that is left here.
                    photo.lit(tried, number, mine)
                cost += term.cost(tried, view) + (photo.cost(tried, number, mine) if len(mine) else np.inf)
            lights.append([photo.light for photo in photos])
            costs.append(cost)
            samples.append(chosen)
        refined = bool(np.isfinite(costs[0]) and costs[0] < costs[1])
        kept = state if refined else before
        found = [
            photo.residual(kept, number, mine, light)
            for number, (photo, mine, light) in enumerate(
                zip(photos, samples[0 if refined else 1], lights[0 if refined else 1], strict=True)
            )
        ]
        return DenseFit(
            kept,
            self.rows(kept),
            tuple(one.harmonic_light() for one in found),
            tuple(one.size() for one in found),
            refined,
            tuple(one.lit.light for one in found),
        )
