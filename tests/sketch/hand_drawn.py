"""Strokes drawn by eye on pictures of the characters at rest, in pixels of views of 960 x 960, with what they depict.

"" stands for lines that are no features: folds, dashes, lines between features.
"""

from collections.abc import Iterator

import numpy as np

from faceposer.geometry.camera import Camera
from faceposer.sketch.recognition import DrawnStroke

_DRAWN = """
man front mouth line: 358,649 414,674 480,681 546,674 604,649
man front mouth line: 368,662 420,676 480,680 540,676 592,662
man front mouth line: 352,640 410,672 480,684 550,672 608,640
man front mouth line: 372,690 425,676 480,671 535,676 588,690
man front mouth line: 380,698 430,678 480,672 530,678 580,698
man front mouth line: 380,676 430,675 480,676 530,675 580,677
man front mouth line: 384,678 430,677 480,677 540,668 596,652
man front outer lower lip: 386,680 425,698 480,705 535,697 576,679
man front outer lower lip: 384,678 425,708 480,720 536,707 578,678
man front outer lower lip: 574,681 532,693 480,699 428,693 388,681
man front outer upper lip: 382,673 437,648 467,646 479,650 492,647 527,648 576,674
man front outer upper lip: 380,668 436,642 480,641 528,642 580,668
man front left upper lid: 545,418 571,398 601,390 626,394 652,416
man front left upper lid: 547,421 575,415 601,413 628,415 650,420
man front left lower lid: 547,421 572,424 606,425 630,423 649,419
man front right lower lid: 413,421 388,430 354,432 330,429 310,418
man front left eye outline: 546,420 575,402 602,397 630,402 652,418 630,430 604,433 573,430 546,421
man front left brow: 540,318 587,298 635,293 672,302 700,318
man front right brow: 425,352 380,338 330,330 285,335 262,345
man front left nose wing: 540,550 538,564 522,578 505,590 482,601
man front jaw line: 277,690 335,790 400,850 480,868 560,850 625,790 683,690
man front mouth outline: 384,675 430,654 480,652 530,654 576,675 535,697 480,706 425,698 384,676
man front : 424,534 385,570 362,605 356,640
man front : 545,452 600,472 655,454
man front : 640,555 682,572
man front : 458,782 502,784
man front : 400,240 480,235 560,240
man three-quarter mouth line: 226,668 250,690 300,697 345,690 392,668
man three-quarter mouth line: 228,684 262,689 310,693 374,699
man three-quarter mouth line: 230,694 262,686 315,690 378,714
man three-quarter outer lower lip: 229,684 240,706 272,720 324,718 374,698
man three-quarter outer upper lip: 226,677 240,660 260,655 290,658 330,672 375,694
man three-quarter left upper lid: 357,440 372,420 394,412 424,416 453,437
man three-quarter left brow: 317,340 356,326 405,324 458,333 508,350
man three-quarter left eye outline: 357,441 375,426 394,420 424,424 453,439 428,452 398,456 372,452 357,442
man three-quarter : 348,560 380,600 402,650
man three-quarter : 450,560 495,580
woman front mouth line: 372,656 420,677 480,685 540,677 588,656
woman front mouth line: 376,668 424,680 480,684 536,680 584,668
woman front mouth line: 384,697 430,681 480,676 530,681 576,697
woman front mouth line: 384,680 430,679 480,681 530,679 576,680
woman front outer lower lip: 387,682 425,707 480,714 535,707 573,682
woman front outer lower lip: 385,680 425,716 480,728 535,716 575,680
woman front outer upper lip: 386,676 432,655 465,650 480,654 495,650 528,655 574,676
woman front left upper lid: 540,443 565,425 595,417 624,421 650,438
woman front right upper lid: 420,446 395,438 365,435 335,437 311,443
woman front left lower lid: 540,446 565,452 595,456 624,452 648,443
woman front left brow: 546,330 586,318 628,317 665,330 690,348
woman front right brow: 418,360 374,350 332,346 296,356 272,372
woman front : 424,560 390,600 372,650
woman front : 560,480 600,494 642,480
woman three-quarter mouth line: 230,668 258,688 305,697 350,690 396,670
woman three-quarter mouth line: 238,685 270,691 318,694 372,700
woman three-quarter outer lower lip: 236,684 248,714 280,728 330,725 377,699
woman three-quarter left upper lid: 367,462 383,444 403,438 432,442 460,461
woman three-quarter left lower lid: 368,465 386,474 407,480 435,477 459,464
woman three-quarter : 356,590 390,630 404,670
low front mouth line: 366,648 420,670 480,680 540,670 594,648
low front mouth line: 372,660 425,672 480,677 535,672 588,660
low front mouth line: 380,692 430,675 480,669 530,675 580,692
low front mouth line: 384,672 430,673 480,671 530,673 576,671
low front outer lower lip: 382,671 422,706 480,721 536,709 578,671
low front outer lower lip: 380,670 422,718 480,736 536,720 580,670
low front left upper lid: 548,401 575,378 604,370 630,376 653,393
low front left lower lid: 548,403 576,405 605,406 630,403 652,397
low front right lower lid: 412,404 384,413 355,416 330,411 308,397
low front left brow: 543,300 590,284 632,282 671,294 698,310
low front mouth outline: 382,668 435,645 480,648 525,645 578,668 540,740 480,765 420,740 382,670
low front mouth outline: 384,668 435,643 480,644 525,643 576,668 538,712 480,722 422,712 384,670
low front : 410,550 372,590 358,640
low front : 550,432 602,452 652,432
low front : 632,560 676,575
low three-quarter mouth line: 196,662 218,682 262,693 305,688 355,664
low three-quarter mouth line: 196,682 226,686 270,691 338,695
low three-quarter outer lower lip: 195,680 207,719 242,737 292,731 341,695
low three-quarter outer upper lip: 193,674 200,651 230,647 255,649 305,661 342,691
low three-quarter left brow: 313,328 354,310 400,307 450,318 497,334
low three-quarter left upper lid: 345,423 362,402 383,394 412,400 441,417
low three-quarter : 345,575 385,615 400,660
creature front mouth line: 346,580 415,600 480,610 545,600 614,580
creature front mouth line: 352,590 415,603 480,607 545,603 608,590
creature front mouth line: 358,622 420,607 480,600 540,607 602,622
creature front outer lower lip: 361,604 414,620 480,622 543,620 599,604
creature front outer lower lip: 360,603 414,632 480,640 543,632 600,603
creature front left upper lid: 530,423 564,398 604,396 641,405 677,425
creature front left lower lid: 530,428 565,440 605,446 643,440 676,429
creature front left brow: 535,358 583,344 631,340 673,350 705,366
creature front : 410,520 370,550 345,600
creature three-quarter mouth line: 220,592 252,612 300,622 350,616 420,600
creature three-quarter outer lower lip: 226,610 250,630 296,637 348,640 408,626
creature three-quarter left brow: 328,380 370,366 418,362 472,371 522,386
"""


def drawn_strokes() -> Iterator[tuple[str, str, str, np.ndarray]]:
    """Yield the character, the view, the feature and the pixels, (n, 2), of each stroke."""
    for line in _DRAWN.strip().splitlines():
        head, _, tail = line.partition(":")
        character, view, feature = head.split(" ", 2)
        yield character, view, feature.strip(), np.array([pair.split(",") for pair in tail.split()], dtype=np.float64)


def stroke_through(points: np.ndarray, camera: Camera) -> DrawnStroke:
    """Return a smooth stroke through ``points``, shape (n, 2)."""
    from scipy.interpolate import PchipInterpolator

    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return DrawnStroke(PchipInterpolator(along, points)(np.linspace(0.0, along[-1], 60)), camera)
