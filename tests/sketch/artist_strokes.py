"""Strokes with which an artist posed the characters at rest in the window, in pixels of views of 960 x 960.

Features separated by | are alike in the place of the stroke; "" stands for strokes that depict nothing.
"""

from collections.abc import Iterator

import numpy as np

_DRAWN = """
man front left brow: 541,326 583,293 642,281 702,308
man front left brow: 547,293 583,308 642,332 696,356
man front left brow: 529,362 571,340 642,314 700,326
man front right brow: 416,314 356,272 308,266 254,308
man front left upper lid: 544,421 571,431 601,436 630,431 651,419
man front left upper lid: 544,417 568,388 597,376 628,386 651,414
man front left lower lid: 544,420 571,421 601,419 630,417 651,414
man front left lower lid: 544,421 571,439 601,448 630,441 651,419
man front left eye outline: 544,419 571,386 601,379 630,388 651,417 630,438 597,443 568,436 544,420
man front mouth line: 368,648 416,675 479,684 543,675 592,646
man front mouth line: 380,699 427,677 479,667 531,677 579,699
man front mouth line: 386,675 479,672 535,663 589,642
man front inner lower lip|outer lower lip: 382,677 421,726 479,744 537,726 574,677
man front outer lower lip|inner lower lip: 392,679 427,756 479,792 535,756 568,679
man front outer upper lip: 380,675 439,630 463,624 479,632 496,624 523,630 577,675
man front inner upper lip|outer upper lip: 389,672 433,654 479,651 525,654 568,672
man front inner lower lip|outer lower lip: 389,675 433,720 479,732 525,720 568,675
man front mouth outline: 427,675 445,636 479,624 513,636 533,675 513,720 479,734 445,720 427,675
man front mouth outline: 368,654 427,646 479,648 531,646 592,654 541,702 479,718 421,702 368,657
man front left nose wing: 535,529 542,553 533,574 511,572
man front left nose wing: 540,519 556,543 547,567 523,574
man front jaw line: 290,732 332,827 404,887 479,905 553,887 624,827 669,732
man front jaw line: 296,732 344,804 427,845 505,845 583,816 654,732
man front left cheek line: 565,529 601,505 654,493 696,469
man front inner lower lip|outer lower lip: 362,654 421,696 479,710 541,696 597,654
man front left brow: 547,308 583,312 642,326 696,352
man front left brow: 544,300 595,304 654,326 702,362
man front left brow: 535,278 595,302 654,332 702,362
man front left brow: 549,296 601,293 654,312 700,347
man front right brow: 416,293 380,302 320,328 260,356
man front right brow: 413,304 362,300 308,314 260,347
man front left brow: 541,302 583,260 642,248 708,278
man front left brow: 541,284 583,236 642,221 708,254
man front right brow: 430,368 380,344 320,314 260,332
man front left brow: 535,368 696,308
man front left brow: 541,338 696,332
man front left brow: 535,362 607,347 702,356
man front left brow: 517,356 583,344 696,347
man front left brow: 702,308 642,281 583,293 541,326
man front left brow: 541,314 583,281 642,269 702,296
man front left brow: 547,308 696,359
man front left brow: 529,362 696,312
man front left brow: 607,290 642,281 696,302
man front left brow: 547,302 589,303 642,321 696,356
man front left brow: 523,364 571,344 642,314 700,324
man front right brow: 416,314 356,281 308,276 254,308
man front mouth line: 380,651 421,675 479,684 537,675 583,651
man front left lower lid|left upper lid: 544,421 568,426 601,426 630,423 651,416
man front left upper lid: 544,419 571,405 601,400 630,405 651,416
man front left upper lid: 544,421 568,405 601,402 630,412 651,424
man front mouth line: 386,694 427,677 479,670 531,677 573,694
man front left upper lid: 542,424 568,398 601,393 630,402 651,419
man front left lower lid: 544,421 571,429 601,429 630,424 651,417
man front outer upper lip: 392,660 439,639 463,636 479,641 496,636 521,640 568,660
man front outer lower lip|inner lower lip: 389,675 427,714 479,722 531,714 571,675
man front left lower lid: 544,421 571,438 601,443 630,438 651,414
man front outer lower lip|inner lower lip: 396,679 427,744 479,770 535,744 564,679
man front jaw line: 290,708 302,756 344,804 410,839 479,847 549,839 615,804 657,756 669,708
man front jaw line: 320,768 356,816 427,851 479,857 531,851 601,816 639,768
man front : 583,684 595,699 630,648
man front : 589,326 607,322
man front : -2,326 57,302 129,314
man front : 762,636 810,684 833,744
man front : 380,183 479,171 583,183
man front : 481,583 482,613
man front : 356,875 479,911 607,875
man three-quarter left brow: 310,344 356,314 427,302 487,312 525,344
man three-quarter left brow: 302,380 356,362 427,336 487,336 523,356
man three-quarter left brow: 320,326 380,324 451,344 517,383
man three-quarter right brow: 228,344 207,320 167,308
man three-quarter left upper lid: 350,427 380,443 416,448 457,443
man three-quarter left upper lid: 347,424 374,398 404,395 433,410 460,442
man three-quarter mouth line: 224,666 260,690 308,699 386,672
man three-quarter mouth line: 219,699 242,682 296,682 377,714
man three-quarter outer lower lip|inner lower lip: 222,682 230,744 278,780 332,762 370,699
man three-quarter left eye outline: 347,427 374,400 404,398 433,410 460,442 427,460 392,464 362,448 347,429
man three-quarter outer upper lip: 222,672 230,642 266,648 320,666 380,691
man three-quarter left nose wing: 318,541 332,565 326,586 302,589
creature front left brow: 529,320 607,281 690,269 774,314
creature front left brow: 541,308 607,314 690,338 780,380
creature front left brow: 523,380 595,338 678,302 774,326
creature front left upper lid: 541,407 595,419 642,421 690,419 736,412
creature front left upper lid: 541,405 589,371 642,364 696,380 736,410
creature front mouth line: 302,607 380,640 479,648 583,640 660,604
creature front mouth line: 320,672 404,646 479,636 553,646 642,672
creature front outer lower lip|inner lower lip: 326,639 392,708 479,732 565,708 630,639
creature front mouth outline: 344,636 392,607 479,598 565,607 613,636 565,702 479,718 392,702 344,638
creature front mouth outline: 296,638 380,607 479,601 577,607 654,638 577,690 479,702 380,690 297,639
creature front left nose wing: 547,493 583,511 577,535 541,539
creature front jaw line: 278,726 344,774 416,800 479,806 547,800 613,774 681,726
creature front jaw line: 284,722 344,768 416,796 479,801 543,796 613,768 676,722
creature front left upper lid: 541,407 595,426 642,431 690,426 736,412
woman front left brow: 541,332 589,302 642,296 700,332
woman front left brow: 544,326 589,324 642,344 696,376
woman front left brow: 525,374 583,352 642,324 696,336
woman front left upper lid: 541,443 571,460 601,463 630,460 658,445
woman front left upper lid: 541,441 571,410 597,402 628,410 658,442
woman front left lower lid: 541,442 571,453 601,455 630,451 658,443
woman front mouth line: 375,651 421,675 479,684 537,675 585,651
woman front mouth line: 387,699 433,682 479,675 525,682 573,699
woman front outer lower lip|inner lower lip: 392,679 433,744 479,765 525,744 567,679
woman front mouth outline: 421,675 445,639 479,632 513,639 537,675 513,732 479,744 445,732 421,676
woman front left nose wing: 525,553 537,571 533,591 511,596
woman front jaw line: 326,770 368,810 427,837 479,841 531,837 589,810 634,770
"""


def artist_strokes() -> Iterator[tuple[str, str, tuple[str, ...], np.ndarray]]:
    """Yield the character, the view, the features and the pixels, (n, 2), of each stroke."""
    for line in _DRAWN.strip().splitlines():
        head, _, tail = line.partition(":")
        character, view, features = head.split(" ", 2)
        points = np.array([pair.split(",") for pair in tail.split()], dtype=np.float64)
        yield character, view, tuple(features.strip().split("|")), points
