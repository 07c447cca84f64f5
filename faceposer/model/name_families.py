"""Naming conventions of other programs, recognised in order to say why their shapes are not ARKit's."""

import re
from collections.abc import Iterable

# Convention, pattern of its names without scopes, and remedy.
_FAMILIES = (
    (
        "VRoid Studio",
        r"(.*_)?Fcl_(ALL|BRW|EYE|MTH|HA)_\w+",
        "add ARKit's shapes to the avatar ('perfect sync') before its export",
    ),
    (
        "the presets of VRM",
        r"(neutral|a|i|u|e|o|aa|ih|ou|ee|oh|blink(_?(l|r|left|right))?|joy|angry|sorrow|fun|happy|sad|relaxed|surprised"
        r"|look_?(up|down|left|right))",
        "add ARKit's shapes to the avatar ('perfect sync') before its export",
    ),
    (
        "visemes",
        r"(.*[_.])?(viseme|vrc\.v|v)[_.](sil|PP|FF|TH|DD|kk|CH|SS|nn|RR|aa|E|ih|I|oh|O|ou|U)|(.*[_.])?mouth_?[A-HX]",
        "export the rig with ARKit's shapes, of which visemes are combinations",
    ),
    (
        "Reallusion's standard set",
        r"(.*[_.])?(Brow_(Raise|Drop)_\w+|Eyes?_(Blink|Wide|Squint)(_[LR])?|Mouth_(Smile|Frown|Open|Pucker|Narrow)\w*"
        r"|V_(Open|Explosive|Wide|Tight\w*|Lip_Open|Dental_Lip|Affricate))",
        "choose the ARKit (extended) facial profile in Character Creator",
    ),
    (
        "MetaHuman",
        r"(.*[_.])?(CTRL_(expressions_|[LRC]_)\w+|\w*(mouthCornerPull|browRaiseIn|browLateral|mouthUpperLipRaise)[LR]?)",
        "export the face with ARKit's curves mapped to shapes (the pose asset PA_MetaHuman_ARKit_Mapping)",
    ),
    (
        "FACS action units",
        r"(.*[_.])?AU_?\d{1,2}([_ ]?\w{1,12})?",
        "add shapes with ARKit's names made from the action units",
    ),
    (
        "MikuMikuDance",
        "(まばたき|笑い|ウィンク.*|あ|い|う|え|お|にこり|怒り|困る|真面目|じと目|びっくり)",
        "add ARKit's shapes ('perfect sync') before the export",
    ),
)
_FEWEST = 3
_LONGEST = 200


def family_hint(names: Iterable[str]) -> str:
    """Return a sentence about the convention that most of the ``names`` follow; "" if none of them is known."""
    texts = [text for name in names if len(text := re.split(r"[|:/]", name)[-1]) <= _LONGEST]
    counts = [
        sum(re.fullmatch(pattern, text, re.IGNORECASE) is not None for text in texts) for _, pattern, _ in _FAMILIES
    ]
    best = max(range(len(counts)), key=counts.__getitem__)
    if counts[best] < _FEWEST or 3 * counts[best] < len(texts):
        return ""
    title, _, remedy = _FAMILIES[best]
    return f"Its names are those of {title}, which are not ARKit's: {remedy}."
