"""Techniques of the comparison by name; those of the extra "bench" import their packages when they are prepared."""

from faceposer.evaluation.methods.arap import Arap
from faceposer.evaluation.methods.bounded_weights import BoundedWeights
from faceposer.evaluation.methods.eos_pca import EosPca
from faceposer.evaluation.methods.gaussian import Pca, Ppca
from faceposer.evaluation.methods.interp_all import InterpAll
from faceposer.evaluation.methods.lwr import Lwr
from faceposer.evaluation.methods.method import Method
from faceposer.evaluation.methods.mfa import PlainMfa, ShippedMfa, UndampedMfa, WholeMfa
from faceposer.evaluation.methods.opt_blend import OptBlend

METHODS: dict[str, type[Method]] = {
    kind.name: kind
    for kind in (
        ShippedMfa,
        WholeMfa,
        UndampedMfa,
        PlainMfa,
        Ppca,
        Pca,
        Lwr,
        OptBlend,
        InterpAll,
        BoundedWeights,
        EosPca,
        Arap,
    )
}
