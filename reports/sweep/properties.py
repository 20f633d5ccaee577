# SPDX-License-Identifier: BSD-3-Clause
"""The properties of scenes in words, for sentences, figures and tables."""

from validation.properties.properties import PROPERTIES


def property_words(name: str) -> str:
    """Return a property in words; of one that has none here its name without underscores."""
    return PROPERTIES[name][0] if name in PROPERTIES else name.replace("_", " ")
