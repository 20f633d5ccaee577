# SPDX-License-Identifier: BSD-3-Clause
"""What a report says besides its scenes, by hand: stability of kernels, claims of papers."""

_ERRORS = {"rays": 77, "refused": 5, "median": 1.5e-7, "p99": 2.5e-6, "max": 4.5e-6}
_ERRORS |= {"nan": 0, "infinite": 0, "negative": 2}
STABILITY = [
    {
        "kernel": "my-kernel",
        "broken": ["law of scale"],
        "sets": [{"name": "certified", "single": {"all": _ERRORS}, "double": {"all": _ERRORS}}],
    }
]

_CLAIM = {"paper": "biri", "item": "eq. 0", "words": "a claim of words", "verdict": "not reproduced"}
_CLAIM |= {"published": None, "measured": 3.0, "low": 2.5, "high": 3.5, "unit": "times", "why": "at most 1: so"}
_RATE = {"item": "Fig. 0", "words": "a rate", "verdict": None, "published": 23.0, "unit": "frames/s", "why": ""}
PAPERS = [_CLAIM, _CLAIM | _RATE]
