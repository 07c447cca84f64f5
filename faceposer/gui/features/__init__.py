"""The features of the window, one folder each. A new feature needs a folder and a line in ``build_features``."""

from faceposer.gui.context import EditorContext
from faceposer.gui.feature import Feature, Features


def build_features(context: EditorContext) -> Features:
    """Return the features of the editor, in the order of their tabs; dropped files are offered in the same order."""
    from faceposer.gui.features.animation_files.feature import AnimationFilesFeature
    from faceposer.gui.features.drawings.feature import DrawingsFeature
    from faceposer.gui.features.export.feature import ExportFeature
    from faceposer.gui.features.film.feature import FilmFeature
    from faceposer.gui.features.guide.feature import GuideFeature
    from faceposer.gui.features.head.feature import HeadFeature
    from faceposer.gui.features.import_character.feature import ImportCharacterFeature
    from faceposer.gui.features.keys.feature import KeysFeature
    from faceposer.gui.features.photo.feature import PhotoFeature
    from faceposer.gui.features.photo.saving import ChangedPhotoFeature
    from faceposer.gui.features.photo_head.feature import PhotoHeadFeature
    from faceposer.gui.features.poses.feature import PosesFeature
    from faceposer.gui.features.preferences.feature import PreferencesFeature
    from faceposer.gui.features.range_marks.feature import RangeMarksFeature
    from faceposer.gui.features.recovery.feature import RecoveryFeature
    from faceposer.gui.features.scan.feature import ScanFeature
    from faceposer.gui.features.sketch.feature import SketchFeature
    from faceposer.gui.features.timeline.feature import TimelineFeature
    from faceposer.gui.features.trajectories.feature import TrajectoriesFeature
    from faceposer.gui.features.transfer.feature import TransferFeature

    kinds: tuple[type[Feature], ...] = (
        PosesFeature,
        HeadFeature,
        PhotoFeature,
        ChangedPhotoFeature,
        TimelineFeature,
        TrajectoriesFeature,
        AnimationFilesFeature,
        FilmFeature,
        KeysFeature,
        TransferFeature,
        ImportCharacterFeature,
        ScanFeature,
        PhotoHeadFeature,
        ExportFeature,
        RangeMarksFeature,
        SketchFeature,
        DrawingsFeature,
        PreferencesFeature,
        GuideFeature,
        RecoveryFeature,
    )
    return Features([kind(context) for kind in kinds])
