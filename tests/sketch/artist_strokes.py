"""Strokes with which an artist posed the characters at rest in the window, in pixels of views of 1012 x 804.

Features separated by | are alike in the place of the stroke; "" stands for strokes that depict nothing.
"""

from collections.abc import Iterator

import numpy as np

_DRAWN = """
man front left brow: 557,273 592,245 642,235 692,258
man front left brow: 562,245 592,258 642,278 687,298
man front left brow: 547,303 582,285 642,263 690,273
man front right brow: 452,263 402,228 362,223 317,258
man front left upper lid: 560,353 582,361 607,365 632,361 649,351
man front left upper lid: 560,349 580,325 604,315 630,323 649,347
man front left lower lid: 560,352 582,353 607,351 632,349 649,347
man front left lower lid: 560,353 582,368 607,375 632,369 649,351
man front left eye outline: 560,351 582,323 607,317 632,325 649,349 632,367 604,371 580,365 560,352
man front mouth line: 412,543 452,565 505,573 559,565 600,541
man front mouth line: 422,585 462,567 505,559 549,567 589,585
man front mouth line: 427,565 505,563 552,555 597,538
man front inner lower lip|outer lower lip: 424,567 457,608 505,623 554,608 585,567
man front outer lower lip|inner lower lip: 432,569 462,633 505,663 552,633 580,569
man front outer upper lip: 422,565 472,528 492,523 505,529 519,523 542,528 587,565
man front inner upper lip|outer upper lip: 430,563 467,548 505,545 544,548 580,563
man front inner lower lip|outer lower lip: 430,565 467,603 505,613 544,603 580,565
man front mouth outline: 462,565 477,533 505,523 534,533 550,565 534,603 505,615 477,603 462,565
man front mouth outline: 412,548 462,541 505,543 549,541 600,548 557,588 505,601 457,588 412,550
man front left nose wing: 552,443 558,463 550,481 532,479
man front left nose wing: 556,435 570,455 562,475 542,481
man front jaw line: 347,613 382,693 442,743 505,758 567,743 627,693 664,613
man front jaw line: 352,613 392,673 462,708 527,708 592,683 652,613
man front left cheek line: 577,443 607,423 652,413 687,393
man front inner lower lip|outer lower lip: 407,548 457,583 505,595 557,583 604,548
man front left brow: 562,258 592,261 642,273 687,295
man front left brow: 560,251 602,255 652,273 692,303
man front left brow: 552,233 602,253 652,278 692,303
man front left brow: 564,248 607,245 652,261 690,291
man front right brow: 452,245 422,253 372,275 322,298
man front right brow: 450,255 407,251 362,263 322,291
man front left brow: 557,253 592,218 642,208 697,233
man front left brow: 557,238 592,198 642,185 697,213
man front right brow: 464,308 422,288 372,263 322,278
man front left brow: 552,308 687,258
man front left brow: 557,283 687,278
man front left brow: 552,303 612,291 692,298
man front left brow: 537,298 592,288 687,291
man front left brow: 692,258 642,235 592,245 557,273
man front left brow: 557,263 592,235 642,225 692,248
man front left brow: 562,258 687,301
man front left brow: 547,303 687,261
man front left brow: 612,243 642,235 687,253
man front left brow: 562,253 597,254 642,269 687,298
man front left brow: 542,305 582,288 642,263 690,271
man front right brow: 452,263 402,235 362,231 317,258
man front mouth line: 422,545 457,565 505,573 554,565 592,545
man front left lower lid|left upper lid: 560,353 580,357 607,357 632,354 649,348
man front left upper lid: 560,351 582,339 607,335 632,339 649,348
man front left upper lid: 560,353 580,339 607,337 632,345 649,355
man front mouth line: 427,581 462,567 505,561 549,567 584,581
man front left upper lid: 558,355 580,333 607,329 632,337 649,351
man front left lower lid: 560,353 582,359 607,359 632,355 649,349
man front outer upper lip: 432,553 472,535 492,533 505,537 519,533 540,536 580,553
man front outer lower lip|inner lower lip: 430,565 462,598 505,605 549,598 582,565
man front left lower lid: 560,353 582,367 607,371 632,367 649,347
man front outer lower lip|inner lower lip: 436,569 462,623 505,645 552,623 576,569
man front jaw line: 347,593 357,633 392,673 447,703 505,709 564,703 619,673 654,633 664,593
man front jaw line: 372,643 402,683 462,713 505,718 549,713 607,683 639,643
man front : 592,573 602,585 632,543
man front : 597,273 612,270
man front : 102,273 152,253 212,263
man front : 742,533 782,573 802,623
man front : 422,153 505,143 592,153
man front : 507,488 508,513
man front : 402,733 505,763 612,733
man three-quarter left brow: 364,288 402,263 462,253 512,261 544,288
man three-quarter left brow: 357,318 402,303 462,281 512,281 542,298
man three-quarter left brow: 372,273 422,271 482,288 537,321
man three-quarter right brow: 295,288 277,268 244,258
man three-quarter left upper lid: 397,358 422,371 452,375 487,371
man three-quarter left upper lid: 395,355 417,333 442,331 467,343 489,370
man three-quarter mouth line: 292,558 322,578 362,585 427,563
man three-quarter mouth line: 287,585 307,571 352,571 420,598
man three-quarter outer lower lip|inner lower lip: 290,571 297,623 337,653 382,638 414,585
man three-quarter left eye outline: 395,358 417,335 442,333 467,343 489,370 462,385 432,389 407,375 395,359
man three-quarter outer upper lip: 290,563 297,538 327,543 372,558 422,579
man three-quarter left nose wing: 370,453 382,473 377,491 357,493
creature front left brow: 547,268 612,235 682,225 752,263
creature front left brow: 557,258 612,263 682,283 757,318
creature front left brow: 542,318 602,283 672,253 752,273
creature front left upper lid: 557,341 602,351 642,353 682,351 720,345
creature front left upper lid: 557,339 597,311 642,305 687,318 720,343
creature front mouth line: 357,508 422,536 505,543 592,536 657,506
creature front mouth line: 372,563 442,541 505,533 567,541 642,563
creature front outer lower lip|inner lower lip: 377,535 432,593 505,613 577,593 632,535
creature front mouth outline: 392,533 432,508 505,501 577,508 617,533 577,588 505,601 432,588 392,534
creature front mouth outline: 352,534 422,508 505,503 587,508 652,534 587,578 505,588 422,578 353,535
creature front left nose wing: 562,413 592,428 587,448 557,451
creature front jaw line: 337,608 392,648 452,670 505,675 562,670 617,648 674,608
creature front jaw line: 342,605 392,643 452,667 505,671 559,667 617,643 670,605
creature front left upper lid: 557,341 602,357 642,361 682,357 720,345
woman front left brow: 557,278 597,253 642,248 690,278
woman front left brow: 560,273 597,271 642,288 687,315
woman front left brow: 544,313 592,295 642,271 687,281
woman front left upper lid: 557,371 582,385 607,388 632,385 655,373
woman front left upper lid: 557,369 582,343 604,337 630,343 655,370
woman front left lower lid: 557,370 582,379 607,381 632,378 655,371
woman front mouth line: 418,545 457,565 505,573 554,565 594,545
woman front mouth line: 428,585 467,571 505,565 544,571 584,585
woman front outer lower lip|inner lower lip: 432,569 467,623 505,641 544,623 579,569
woman front mouth outline: 457,565 477,535 505,529 534,535 554,565 534,613 505,623 477,613 457,566
woman front left nose wing: 544,463 554,478 550,495 532,499
woman front jaw line: 377,645 412,678 462,701 505,704 549,701 597,678 635,645
"""


def artist_strokes() -> Iterator[tuple[str, str, tuple[str, ...], np.ndarray]]:
    """Yield the character, the view, the features and the pixels, (n, 2), of each stroke."""
    for line in _DRAWN.strip().splitlines():
        head, _, tail = line.partition(":")
        character, view, features = head.split(" ", 2)
        points = np.array([pair.split(",") for pair in tail.split()], dtype=np.float64)
        yield character, view, tuple(features.strip().split("|")), points
